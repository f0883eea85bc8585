"""The motion that poses tell, where it is predicted over a camera's latency."""

from __future__ import annotations

from math import atan2, cos, degrees, pi, radians, sin

import pytest

from kybflow.core.geometry import GRAVITY, ZERO, distance, from_euler, tilt_of
from kybflow.core.signals import NS, Pose
from kybflow.flight.tracked_pose import MAX_EXTRAPOLATION_S, TrackedParams, TrackedPose

AGES = (0.0, 0.05, 0.12, 0.26)
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


def test_without_poses_it_neither_turns_nor_accelerates_on_and_its_doubt_grows() -> None:
    """Banking at 150 deg/s and 30 deg when the last pose arrives, as in a manoeuvre."""
    track = TrackedPose(TrackedParams(), drag=0.0)
    for i in range(51):
        t = i / 125
        attitude = from_euler(0.0, radians(30.0 - 150.0 * max(0.4 - t, 0.0)), 0.0)
        track.take(Pose(round((1.0 + t) * NS), (0.0, 0.0, 1.0), attitude))
    motions = [track.predicted(track.stamp + round(age * NS), "") for age in AGES]
    tilts = [degrees(tilt_of(motion.attitude)) for motion in motions]
    assert tilts[0] == pytest.approx(30.0, abs=2.0)
    assert tilts[1] == pytest.approx(37.5, abs=2.0)
    assert max(tilts) < 46.0
    assert [motion.angular_velocity == ZERO for motion in motions] == [False, False, True, True]
    pull = (motions[1].velocity[0] - motions[0].velocity[0]) / AGES[1]
    assert motions[-1].velocity[0] == pytest.approx(
        motions[0].velocity[0] + MAX_EXTRAPOLATION_S * pull
    )
    spreads = [motion.spread for motion in motions]
    assert spreads[1] == spreads[0] < spreads[2] < 0.01
    assert spreads[3] > 0.05


def test_the_prediction_has_no_step_where_its_bound_is() -> None:
    track = TrackedPose(TrackedParams(), drag=0.0)
    for i in range(60):
        track.take(swaying(i / 30)[0])
    before, after = (
        track.bent(track.predicted(track.stamp + round((MAX_EXTRAPOLATION_S + off) * NS), ""))
        for off in (-1e-6, 1e-6)
    )
    assert distance(before.position, after.position) < 1e-5
    assert distance(before.velocity, after.velocity) < 1e-4
    assert after.spread == pytest.approx(before.spread)
