"""run_until: a steady velocity, and a smooth end in any case."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from part_bench import DT, entry, fly, worst_mismatch

from kybflow.core.errors import Refused
from kybflow.core.geometry import ZERO, add, distance, norm, scale
from kybflow.core.signals import Done, Failed, SetpointKind
from kybflow.runtime.behaviors.run_until import RunUntil, RunUntilParams

START = (0.0, 0.5, 1.0)
EAST = (0.4, 0.0, 0.0)


def drifting(start, wind=ZERO, share=1.0):
    """A vehicle that flies a share of the velocity that it is asked for, and drifts."""
    state = [start, ZERO]

    def move(setpoint):
        if setpoint is not None:
            state[1] = add(scale(setpoint.velocity, share), wind)
            state[0] = add(state[0], scale(state[1], DT))
        return state[0], state[1]

    return move


def flight_until(start=START, entered=ZERO, body=None, **params):
    body = body or drifting(start)
    behavior = RunUntil(RunUntilParams(**{"velocity": EAST, **params}), entry(start, entered))
    return fly(behavior, body), body(None)[0]


@settings(max_examples=12)
@given(st.floats(0.05, 3.0), st.floats(0.1, 0.9), st.floats(0.2, 2.0))
def test_it_stops_smoothly_after_its_way(at_most: float, speed: float, pull: float) -> None:
    asked = {"velocity": (0.0, -speed, 0.0), "at_most": at_most, "acceleration": pull}
    flown, end = flight_until(**asked)
    assert isinstance(flown.end, Done)
    assert distance(end, START) == pytest.approx(at_most, abs=0.01)
    assert flown.end.setpoint.velocity == ZERO
    setpoints = [s.setpoint for s in flown.samples]
    assert {s.kind for s in setpoints} == {SetpointKind.VELOCITY}
    assert max(norm(s.velocity) for s in setpoints) <= speed + 1e-9
    assert max(norm(s.acceleration) for s in setpoints) <= pull * 1.001
    assert worst_mismatch(flown.samples, "velocity", "acceleration") < 0.1 * pull


def test_it_flies_the_velocity_that_it_is_asked_for() -> None:
    flown, _ = flight_until(at_most=2.0)
    steady = [s for s in flown.samples if s.setpoint.velocity == pytest.approx(EAST)]
    assert len(steady) * DT > 3.0
    assert steady[len(steady) // 2].setpoint.acceleration == ZERO


@pytest.mark.parametrize("time", [0.5, 2.0, 6.0])
def test_a_time_ends_it_as_well(time: float) -> None:
    flown, end = flight_until(at_most=50.0, for_time=time)
    assert isinstance(flown.end, Done)
    assert flown.duration == pytest.approx(time, abs=0.02)
    assert distance(end, START) < 0.4 * time
    assert worst_mismatch(flown.samples, "velocity", "acceleration") < 0.05


def test_its_way_is_that_of_the_vehicle_not_of_the_setpoint() -> None:
    flown, end = flight_until(at_most=1.0, body=drifting(START, share=0.5))
    assert isinstance(flown.end, Done)
    assert 0.8 < end[0] < 1.0
    _, end = flight_until(at_most=1.0, body=drifting(START, wind=(0.2, 0.0, 0.0)))
    assert end[0] == pytest.approx(1.0 + 0.5 * 0.2 * 15 / 8 * 0.4 / 0.7, abs=0.15)


def test_held_back_it_fails() -> None:
    flown, _ = flight_until(at_most=1.0, patience=3.0, body=lambda _: (START, ZERO))
    assert isinstance(flown.end, Failed)
    assert flown.end.reason == "only 0.00 m of 1 m"


def test_entered_in_motion_it_has_no_step() -> None:
    flown, _ = flight_until(entered=(0.0, 0.5, 0.0), at_most=1.0)
    assert flown.samples[0].setpoint.velocity == pytest.approx((0.0, 0.5, 0.0))
    assert worst_mismatch(flown.samples, "velocity", "acceleration") < 0.05
    assert isinstance(flown.end, Done)


def test_without_a_velocity_it_refuses() -> None:
    with pytest.raises(Refused, match="its velocity is zero"):
        RunUntil(RunUntilParams(velocity=ZERO, at_most=1.0), entry(START))


def test_its_footprint_is_its_way() -> None:
    params = RunUntilParams(velocity=EAST, at_most=2.0)
    footprint = RunUntil.footprint(params, START)
    assert footprint.points == (START, (2.0, 0.5, 1.0))
    assert footprint.exit == (2.0, 0.5, 1.0)
    assert footprint.speed == pytest.approx(0.4)
    timed = RunUntilParams(velocity=EAST, at_most=2.0, for_time=1.0)
    assert RunUntil.footprint(timed, START).exit is None
    assert RunUntil.footprint(params, None) is None
