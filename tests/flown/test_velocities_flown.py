"""Processors on setpoints of velocity, in the simulator: towards the fence, too fast, held back."""

import itertools

import pytest
from plans import FENCE, part, state, then, vehicle
from short_flights import hold, named, path, up

from kybflow.core.geometry import norm

LOOK = 0.052
"""Seconds from one look of an observer to the next, at most."""
TRACKERS = ("cascade", "velocity", "geometric")
VELOCITIES = ((0.9, 0.0, 0.0), (-0.6, 0.6, 0.0), (0.0, 0.0, 0.7))


def flight(run, tracker: str, processors: list, velocity=(0.9, 0.0, 0.0), **more):
    """Fly with a velocity for as long as the vehicle is let; what was observed on the way."""
    search = part("behaviors", "run_until", velocity=velocity, at_most=9.0, **more)
    states = [up("search", 1.0), state("search", search, then("hold")), hold(1.0, "auto_land")]
    seen: list = []

    def watch(engine) -> None:
        (own,) = engine.vehicles
        if engine.seconds() > 1.0 and own.state == "search":
            seen.append((own.truth.position, own.truth.velocity, own.followed))

    own = {"processors": tuple(processors), "tracker": part("trackers", tracker)}
    return *run(vehicle("a", states, **own), observers=(watch,)), seen


@pytest.mark.parametrize(
    ("tracker", "velocity"),
    [
        pytest.param(
            tracker,
            velocity,
            marks=[] if i == k == 0 else pytest.mark.thorough if i == k else pytest.mark.slow,
        )
        for i, tracker in enumerate(TRACKERS)
        for k, velocity in enumerate(VELOCITIES)
    ],
)
def test_a_velocity_towards_the_fence_stops_at_the_wall(run, tracker: str, velocity) -> None:
    flown, told, seen = flight(run, tracker, [part("processors", "fence")], velocity, for_time=8.0)
    assert flown.summary["outcome"] == "succeeded"
    assert named(told, "fence_breached") == []
    inside = max(FENCE.outside_by(position) for position, _, _ in seen)
    assert -0.25 < inside < -0.18
    assert path(told, "a")[:3] == ["up", "search", "hold"]
    assert norm(seen[-1][1]) < 0.05


@pytest.mark.thorough
def test_limits_hold_for_velocities(run) -> None:
    processors = [
        part("processors", "limit_acceleration", acceleration=0.4),
        part("processors", "limit_speed", speed=0.3),
    ]
    _, _, seen = flight(run, "velocity", processors, for_time=4.0, acceleration=2.0)
    speeds = [followed.velocity[0] for _, _, followed in seen if followed is not None]
    assert max(speeds) == pytest.approx(0.3)
    steepest = max(b - a for a, b in itertools.pairwise(speeds[1:]))
    assert steepest <= 0.4 * LOOK * 1.01
    assert max(velocity[0] for _, velocity, _ in seen) < 0.36
