"""land_blind: a 1-D vehicle with a wrong thrust model comes down, as fast as the page says."""

import re
from math import atan2

import pytest
from part_bench import DT, MASS, SITE, entry, estimate, tick

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    Vec3,
    body_z,
    from_heading,
    heading_of,
    tilt_of,
)
from kybflow.core.signals import NS, Command, Done, Imu, Setpoint, SetpointKind
from kybflow.parts import AIR, GROUND, MOVING, Entry
from kybflow.runtime.behaviors import land_blind
from kybflow.runtime.behaviors.land_blind import LandBlind, LandBlindParams

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


def felt(i: int, thrust: float, start: int = 0) -> Imu:
    """The IMU of a vehicle in the air, at the `i`th tick."""
    return Imu(round((start + i) * DT * NS), DT, (0.0, 0.0, thrust / MASS), ZERO)


def page() -> dict[float, list[tuple[float, float]]]:
    """The table of the part's docstring: height → (speed, time) for each error."""
    table = land_blind.__doc__.partition("open loop e =")[2]
    rows = re.findall(r"^ +([\d.]+) m +(.*)$", table, re.MULTILINE)
    cell = r"([\d.]+) \(([\d.]+)"
    return {float(h): [(float(v), float(t)) for v, t in re.findall(cell, row)] for h, row in rows}


@pytest.mark.parametrize("height", [1.0, 1.5, 2.5])
def test_without_an_imu_it_touches_down_as_its_page_says(height: float) -> None:
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


def test_while_its_imu_is_heard_no_time_stops_the_rotors_in_the_air() -> None:
    behavior = LandBlind(LandBlindParams(time_bound=1.0), entry((0.0, 0.0, 1.5)))
    thrust = MASS * GRAVITY
    for i in range(1, 300):
        output = behavior.update(tick(i * DT)._replace(imu=felt(i, thrust)))
        assert isinstance(output, Command)
        thrust = output.thrust
    assert i * DT > 1.0


def test_on_the_ground_it_is_done_at_once() -> None:
    behavior = LandBlind(LandBlindParams(), entry(ZERO, flight=GROUND))
    assert behavior.update(tick()) == Done(Setpoint(SetpointKind.IDLE))


def test_it_asks_for_the_imu_while_it_is_active() -> None:
    assert LandBlind.needs == frozenset({Imu})


def test_it_holds_its_descent_by_what_the_imu_feels() -> None:
    """Ten percent more thrust than believed is seen and taken back within half a second."""
    behavior = LandBlind(LandBlindParams(), entry((0.0, 0.0, 1.5)))
    thrust, speed = MASS * GRAVITY, 0.0
    for i in range(1, 500):
        lift = 1.1 * thrust
        speed += (lift / MASS - GRAVITY) * DT
        thrust = behavior.update(tick(i * DT)._replace(imu=felt(i, lift))).thrust
        assert speed < 0.05
        if i * DT > 1.0:
            assert -0.85 < speed < -0.4
    assert 1.1 * thrust == pytest.approx(MASS * GRAVITY, rel=0.05)


@pytest.mark.parametrize("carries", [True, False])
def test_an_impact_stops_the_rotors_if_the_floor_carries_the_vehicle(carries: bool) -> None:
    behavior = LandBlind(LandBlindParams(), entry((0.0, 0.0, 1.5)))
    output, thrust = None, MASS * GRAVITY
    for i in range(1, 140):
        force = (1.0 + 1e-4 * i) * thrust if i < 60 else 3.0 * MASS * GRAVITY
        if i > 60:
            force = (1.0 + 1e-4 * i) * (max(MASS * GRAVITY, thrust) if carries else thrust)
        output = behavior.update(tick(i * DT)._replace(imu=felt(i, force)))
        if isinstance(output, Done):
            break
        thrust += (output.thrust - thrust) * DT / 0.03
    assert isinstance(output, Done) is carries


def lost(velocity: Vec3, setpoint: Setpoint | None, heading: float = 0.0) -> Entry:
    """Entered after the estimate of this velocity and heading was lost."""
    known = estimate((0.0, 0.0, 1.0), velocity)._replace(attitude=from_heading(heading))
    return Entry(0, SITE, None, setpoint, MASS * GRAVITY, AIR, lost=known)


@pytest.mark.parametrize("setpoint", [None, Setpoint(SetpointKind.VELOCITY, velocity=None)])
@pytest.mark.parametrize("heading", [0.0, 2.5])
def test_the_last_known_velocity_is_braked_first_in_the_last_known_heading(
    setpoint: Setpoint | None, heading: float
) -> None:
    behavior = LandBlind(LandBlindParams(), lost((0.8, -0.4, 0.0), setpoint, heading))
    first = behavior.update(tick())
    x, y, _ = body_z(first.attitude)
    assert atan2(y, x) == pytest.approx(atan2(0.4, -0.8), abs=0.05)
    assert heading_of(first.attitude) == pytest.approx(heading, abs=0.05)
    assert 0.1 < tilt_of(first.attitude) <= SITE.airframe.tilt + 1e-6
    assert first.heading is None
    for i in range(1, 400):
        last = behavior.update(tick(i * DT))
    assert last.attitude == LEVEL


def test_the_last_known_climb_is_the_climb_it_begins_with_whatever_the_setpoint_lacks() -> None:
    """Without an IMU the thrust takes the climb away."""
    still, climbs = (
        LandBlind(LandBlindParams(), lost((0.0, 0.0, climb), None)) for climb in (0.0, 0.5)
    )
    assert climbs.update(tick()).thrust < 0.95 * still.update(tick()).thrust


def test_an_imu_that_falls_silent_leaves_the_open_loop_with_what_was_learnt() -> None:
    """The vehicle weighs 10 % more than believed; what follows is the ramp of that weight."""
    behavior = LandBlind(LandBlindParams(), entry((0.0, 0.0, 2.0)))
    thrust = MASS * GRAVITY
    for i in range(1, 500):
        imu = felt(i, thrust / 1.1)
        thrust = behavior.update(tick(i * DT)._replace(imu=imu)).thrust
    silent = tick(500 * DT + 0.15)._replace(imu=imu)
    ramp = 0.9 - 0.01 * (silent.elapsed - 1.0)
    expected = 1.1 * MASS * GRAVITY * ramp
    behavior.update(silent)
    assert behavior.update(silent).thrust == pytest.approx(expected, rel=0.03)


def test_its_thrust_never_rises_from_rest_and_never_exceeds_what_the_rotors_have() -> None:
    rested = LandBlind(LandBlindParams(), entry((0.0, 0.0, 1.0)))
    thrusts = [rested.update(tick(0.1 * i)).thrust for i in range(110)]
    assert thrusts == sorted(thrusts, reverse=True)
    weak = Entry(0, SITE, None, None, 99.0, AIR)
    assert LandBlind(LandBlindParams(), weak).update(tick()).thrust == pytest.approx(5.2)


@pytest.mark.parametrize("lift", [float("nan"), MASS * GRAVITY, 0.0])
def test_an_imu_that_is_stuck_or_mad_is_not_believed(lift: float) -> None:
    """It reads the same for ever: the thrust stays near the believed weight's ramp."""
    behavior = LandBlind(LandBlindParams(), entry((0.0, 0.0, 2.0)))
    for i in range(1, 500):
        output = behavior.update(tick(i * DT)._replace(imu=felt(i, lift)))
        assert isinstance(output, Command)
        assert 0.8 * MASS * GRAVITY < output.thrust < 1.2 * MASS * GRAVITY


def test_a_vehicle_that_is_not_heard_at_all_is_left_to_its_own_watchdog() -> None:
    behavior = LandBlind(LandBlindParams(), entry((0.0, 0.0, 1.0)))
    behavior.update(tick(0.15)._replace(link_age=0.24))
    assert not behavior.lets_go
    behavior.update(tick(0.2)._replace(link_age=0.26))
    assert behavior.lets_go
    behavior.update(tick(0.3)._replace(link_age=0.0))
    assert not behavior.lets_go
    assert behavior.waits_for is None
