"""The motion that poses tell, where it is predicted over a camera's latency."""

from __future__ import annotations

from math import atan2, cos, pi, sin

from kybflow.core.geometry import GRAVITY, distance, from_euler
from kybflow.core.signals import NS, Pose
from kybflow.flight.tracked_pose import TrackedParams, TrackedPose

REACH, RATE, LATE = 0.02, 2.0 * pi * 1.5, 0.07


def swaying(t: float) -> tuple[Pose, tuple[float, float, float]]:
    """To and fro along x, tilted as that takes; and the velocity."""
    x, pull = REACH * sin(RATE * t), -REACH * RATE**2 * sin(RATE * t)
    attitude = from_euler(0.0, atan2(pull, GRAVITY), 0.0)
    velocity = (REACH * RATE * cos(RATE * t), 0.0, 0.0)
    return Pose(round(t * NS), (x, 0.0, 1.0), attitude), velocity


def test_what_the_attitude_does_meanwhile_halves_the_velocity_error() -> None:
    track = TrackedPose(TrackedParams(), drag=0.0)
    straight, bent = [], []
    for i in range(90):
        track.take(swaying(i / 30)[0])
        velocity = swaying(i / 30 + LATE)[1]
        motion = track.predicted(round((i / 30 + LATE) * NS), "")
        if i > 30:
            straight.append(distance(motion.velocity, velocity))
            bent.append(distance(track.bent(motion).velocity, velocity))
    assert max(bent) < 0.5 * max(straight)


def test_a_first_pose_tells_no_change() -> None:
    track = TrackedPose(TrackedParams(), drag=0.0)
    track.take(swaying(0.1)[0])
    motion = track.predicted(round(0.15 * NS), "")
    assert track.bent(motion) == motion
