"""land_blind: a 1-D vehicle with a wrong thrust model comes down, as fast as the page says."""

import re

import pytest
from flying import DT, MASS, SITE, entry, tick

from kybflow.geometry import GRAVITY, ZERO, tilt_of
from kybflow.parts import AIR, GROUND, MOVING, Entry
from kybflow.runtime.behaviors import land_blind
from kybflow.runtime.behaviors.land_blind import LandBlind, LandBlindParams
from kybflow.signals import Command, Done, Setpoint, SetpointKind

DRAG = 0.3
ERRORS = (-0.10, -0.05, 0.0, 0.05, 0.10)


def fall(height: float, error: float, climb: float = 0.0) -> tuple[float, float, float]:
    """(touch-down speed, time, greatest height) of a vehicle whose thrust is wrong by `error`."""
    z, v, top = height, climb, height
    behavior = LandBlind(LandBlindParams(), entry((0.0, 0.0, height), (0.0, 0.0, climb)))
    for i in range(round(20.0 / DT)):
        output = behavior.update(tick(i * DT))
        thrust = output.thrust if isinstance(output, Command) else 0.0
        v += ((1.0 + error) * thrust / MASS - GRAVITY - DRAG * v) * DT
        z += v * DT
        top = max(top, z)
        if z <= 0.0:
            return -v, i * DT, top
    raise AssertionError("it did not come down")


def page() -> dict[float, list[tuple[float, float]]]:
    """The table of the part's docstring: height → (speed, time) for each error."""
    rows = re.findall(r"^ +([\d.]+) m +(.*)$", land_blind.__doc__, re.MULTILINE)
    cell = r"([\d.]+) \(([\d.]+)"
    return {float(h): [(float(v), float(t)) for v, t in re.findall(cell, row)] for h, row in rows}


@pytest.mark.parametrize("height", [1.0, 1.5, 2.5])
def test_it_touches_down_as_its_page_says(height: float) -> None:
    expected = page()[height]
    for error, (speed, time) in zip(ERRORS, expected, strict=True):
        assert fall(height, error)[:2] == pytest.approx((speed, time), abs=0.06)


def test_ten_percent_too_much_climbs_little_before_it_sinks() -> None:
    assert fall(1.0, 0.10)[2] - 1.0 == pytest.approx(0.56, abs=0.02)


@pytest.mark.parametrize("climb", [-0.5, 0.5])
def test_the_speed_of_entry_is_taken_away(climb: float) -> None:
    assert fall(1.5, 0.0, climb)[0] == pytest.approx(fall(1.5, 0.0)[0], abs=0.25)


def test_it_stays_level_and_leaves_the_heading_to_who_knows_it() -> None:
    command = LandBlind(LandBlindParams(), entry((0.0, 0.0, 1.0))).update(tick(0.5))
    assert tilt_of(command.attitude) == 0.0
    assert command.heading is None
    assert command.rates == ZERO


def test_it_flies_without_estimate_and_setpoint() -> None:
    lost = Entry(0, SITE, None, None, 2.0, MOVING)
    assert LandBlind(LandBlindParams(), lost).update(tick()).thrust == 2.0


def test_after_its_time_bound_the_rotors_stop() -> None:
    behavior = LandBlind(LandBlindParams(time_bound=5.0), entry((0.0, 0.0, 1.0)))
    assert isinstance(behavior.update(tick(4.99)), Command)
    assert behavior.update(tick(5.0)) == Done(Setpoint(SetpointKind.IDLE))


def test_on_the_ground_it_is_done_at_once() -> None:
    behavior = LandBlind(LandBlindParams(), entry(ZERO, flight=GROUND))
    assert behavior.update(tick()) == Done(Setpoint(SetpointKind.IDLE))


def test_its_thrust_never_rises_from_rest_and_never_exceeds_what_the_rotors_have() -> None:
    rested = LandBlind(LandBlindParams(), entry((0.0, 0.0, 1.0)))
    thrusts = [rested.update(tick(0.1 * i)).thrust for i in range(110)]
    assert thrusts == sorted(thrusts, reverse=True)
    weak = Entry(0, SITE, None, None, 99.0, AIR)
    assert LandBlind(LandBlindParams(), weak).update(tick()).thrust == pytest.approx(5.2)
