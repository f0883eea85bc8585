"""ground: a vehicle that lies where it stood, while it should fly, is noticed."""

from pathlib import Path

import pytest
from part_bench import SITE, at_rest, estimate, tick
from plans import part, plan, vehicle
from short_flights import down, hold, up
from toolchain import flight_of

from kybflow.core.signals import NS, Alarm, Reaction, Setpoint, SetpointKind
from kybflow.dsl.plan import FaultPlan
from kybflow.runtime.supervisors.ground import Ground, GroundParams

TOUCHED = Alarm(
    "ground_touched", Reaction.LAND, "it is on the ground, but should fly", is_failure=True
)
HOVER = at_rest((0.0, 0.0, 1.0))


def heard(
    *heights: float, setpoint: Setpoint | None = HOVER, climb: float = 0.0, off_ground: bool = True
) -> list[Alarm | None]:
    """What it says at each height, 0.3 s apart, of a vehicle that stood at 0."""
    supervisor, found = Ground(GroundParams(), SITE), []
    for index, height in enumerate(heights):
        known = estimate((0.0, 0.0, height), (0.0, 0.0, climb))
        found.append(supervisor.check(tick(0.3 * index, known, setpoint), off_ground))
    return found


def test_one_that_has_sunk_to_the_ground_is_noticed_after_half_a_second():
    assert heard(1.0, 0.02, 0.0, 0.0) == [None, None, None, TOUCHED]


def test_one_that_has_not_flown_yet_takes_off():
    assert heard(0.0, 0.0, 0.0, 0.0, 0.0) == [None] * 5


def test_one_that_fell_below_where_it_was_held_is_noticed_too():
    """A brake comes to rest where the fall leads, which may be below the ground."""
    held = at_rest((0.0, 0.0, -0.4))
    assert heard(1.0, 0.0, 0.0, 0.0, setpoint=held)[-1] == TOUCHED


@pytest.mark.parametrize("held", [-0.05, 0.0, 0.04])
def test_one_that_a_brake_holds_on_the_ground_is_noticed_too(held: float):
    assert heard(1.0, 0.02, 0.0, 0.01, setpoint=at_rest((0.0, 0.0, held)))[-1] == TOUCHED


def test_one_that_flies_beside_its_table_at_the_height_of_its_start_is_not():
    context = SITE._replace(start=(0.0, 0.0, 0.8))
    supervisor = Ground(GroundParams(), context)
    there = (2.0, 0.0, 0.82)
    for now, place in enumerate(((0.0, 0.0, 1.5), *[there] * 4)):
        known = estimate(place)
        assert supervisor.check(tick(0.3 * now, known, at_rest(place)), off_ground=True) is None
    above = (0.1, 0.0, 0.82)
    for now in range(5, 8):
        alarm = supervisor.check(tick(0.3 * now, estimate(above), at_rest(above)), off_ground=True)
    assert alarm == TOUCHED


def test_the_setpoint_of_a_landing_sinks():
    landing = at_rest((0.0, 0.0, -0.3), (0.0, 0.0, -0.2))
    assert heard(1.0, 0.0, 0.0, 0.0, setpoint=landing) == [None] * 4


def test_one_that_follows_its_setpoint_flies_at_the_height_of_its_start():
    assert heard(1.0, 0.0, 0.0, 0.0, setpoint=at_rest((1.0, 0.0, 0.05))) == [None] * 4


def test_one_that_passes_low_and_moves_flies():
    assert heard(1.0, 0.02, 0.02, 0.02, climb=0.2) == [None] * 4


def test_one_that_is_above_the_ground_flies_however_badly():
    assert heard(1.0, 0.2, 0.2, 0.2) == [None] * 4


def test_one_that_should_climb_is_noticed_too():
    climbing = Setpoint(SetpointKind.VELOCITY, velocity=(0.0, 0.0, 0.3))
    assert heard(1.0, 0.0, 0.0, 0.0, setpoint=climbing)[-1] == TOUCHED


def test_on_the_ground_without_an_estimate_and_without_a_setpoint_it_is_silent():
    assert heard(1.0, 0.0, 0.0, 0.0, off_ground=False) == [None] * 4
    assert heard(1.0, 0.0, 0.0, 0.0, setpoint=None) == [None] * 4
    assert Ground(GroundParams(), SITE).check(tick(), off_ground=True) is None


def test_a_vehicle_that_gets_too_heavy_is_landed_and_the_run_has_failed(tmp_path: Path):
    """Its rotors lift 2.3 times its weight at most."""
    heavy = FaultPlan(
        part=part("faults", "mass_change", factor=2.45),
        vehicle="a",
        time=6.0,
        when=None,
        duration=60.0,
        at="m.yaml:9",
    )
    flier = vehicle("a", [up("hold"), hold(30.0, "down"), down()])
    flown, told = flight_of(plan(flier, faults=(heavy,)), tmp_path)
    times = {event.name: event.time / NS for event in reversed(told)}
    assert 6.0 < times["ground_touched"] < times["landed"] < times["ground_touched"] + 3.0
    assert flown.summary["outcome"] == "failed"
    assert "it is on the ground, but should fly" in flown.summary["reason"]
