"""The setpoints that lift a vehicle from the ground."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink")

from framing import ARM
from hypothesis import given
from hypothesis import strategies as st
from scripted_autopilot import RESTING, Bench, at, pushed

from kybflow.core.errors import Refused
from kybflow.core.geometry import ZERO
from kybflow.core.signals import NS, CommandKind, Setpoint, SetpointKind
from kybflow.drivers.mavlink.control.arming import LIFTED
from kybflow.drivers.mavlink.control.setpoints import raised

STREAM = "SET_POSITION_TARGET_LOCAL_NED"
MOVING = Setpoint(
    SetpointKind.POSITION, (1.0, 2.0, 0.1), (0.0, 0.0, 0.3), (0.0, 0.0, 0.5), (0.0, 0.0, 1.0), 0.7
)


@given(st.floats(0.0, 3.0))
def test_a_place_is_raised_and_rests_there(height):
    command = at(ZERO)._replace(setpoint=MOVING)
    higher = raised(command, height, 0.0)
    assert higher.setpoint.position == pytest.approx((1.0, 2.0, 0.1 + height))
    assert higher.setpoint[2:5] == (ZERO, ZERO, ZERO)
    assert higher == command._replace(setpoint=higher.setpoint)
    assert higher.setpoint.heading == 0.7


def test_what_is_no_place_stays_as_it_is():
    speed = Setpoint(SetpointKind.VELOCITY, None, (0.0, 0.0, 0.2), ZERO)
    climbing = at(ZERO)._replace(kind=CommandKind.VELOCITY, setpoint=speed)
    for command in (RESTING, climbing):
        assert raised(command, 0.5, 2.0) is command


def test_px4_obeys_once_set_points_above_the_first_have_lifted_it():
    bench = Bench("px4")
    bench.run(1.0)
    assert bench.arm(command=at((1.0, 2.0, 0.1)))
    assert bench.fake.position[2] >= LIFTED
    lifting = [m for m in bench.fake.took(STREAM) if m.z == pytest.approx(-0.6)]
    assert lifting
    assert {(m.x, m.y, m.vz) for m in lifting} == {(2.0, 1.0, 0.0)}
    armed = bench.fake.sent.index(bench.fake.commands(ARM)[0])
    before = [m.z for m in bench.fake.sent[:armed] if m.get_type() == STREAM]
    assert before == pytest.approx([-0.1] * len(before))
    bench.fake.sent.clear()
    bench.run(0.5, at((1.0, 2.0, 0.2)))
    after = [m.z for m in bench.fake.took(STREAM)][2:]
    assert after == pytest.approx([-0.2] * len(after))


def test_one_that_does_not_rise_is_refused_and_rests():
    bench = Bench("px4", arming_time=5.0)
    bench.run(1.0)
    bench.fake.is_heavy = True
    with pytest.raises(Refused, match="has not left the ground"):
        bench.arm()
    bench.run(2.0, RESTING)
    assert not bench.fake.armed


def test_commands_of_velocity_lift_it_themselves():
    speed = Setpoint(SetpointKind.VELOCITY, None, (0.0, 0.0, 0.2), ZERO)
    bench = Bench("px4")
    bench.run(1.0)
    bench.fake.is_heavy = True
    assert bench.arm(command=at(ZERO)._replace(kind=CommandKind.VELOCITY, setpoint=speed))


@pytest.mark.parametrize(("seconds", "push"), [(0.0, 1.5), (2.0, 2.5), (60.0, 4.0)])
def test_an_acceleration_is_pushed_up_by_what_grows_to_a_bound_and_keeps_its_place(seconds, push):
    sideways = Setpoint(
        SetpointKind.ACCELERATION, None, None, (0.3, 0.0, -1.0), (0.0, 0.0, 9.0), 0.7
    )
    command = pushed(0.0)._replace(setpoint=sideways)
    harder = sideways._replace(acceleration=(0.3, 0.0, push), jerk=ZERO)
    assert raised(command, 0.5, seconds) == command._replace(setpoint=harder)


def test_px4_obeys_by_acceleration_once_a_push_up_has_lifted_it():
    bench = Bench("px4")
    bench.run(1.0)
    assert bench.arm(command=pushed(-0.5))
    assert bench.fake.position[2] >= LIFTED
    armed = bench.fake.sent.index(bench.fake.commands(ARM)[0])
    before = [m.afz for m in bench.fake.sent[:armed] if m.get_type() == STREAM]
    assert before == pytest.approx([0.5] * len(before))
    lifting = [m.afz for m in bench.fake.took(STREAM) if m.afz < 0.0]
    assert lifting[0] == pytest.approx(-1.5, abs=0.1)
    assert lifting == sorted(lifting, reverse=True)
    bench.fake.sent.clear()
    bench.run(0.5, pushed(-0.5))
    after = [m.afz for m in bench.fake.took(STREAM)][2:]
    assert after == pytest.approx([0.5] * len(after))


def test_one_that_does_not_rise_by_acceleration_is_refused_and_rests():
    bench = Bench("px4")
    bench.run(1.0)
    bench.fake.is_heavy = True
    with pytest.raises(Refused, match="armed, it has not left the ground"):
        bench.arm(command=pushed(0.5))
    assert bench.now / NS == pytest.approx(16.0, abs=0.1)
    assert bench.fake.took(STREAM)[-1].afz == pytest.approx(-4.0)
    bench.run(2.0, RESTING)
    assert not bench.fake.armed


def taking_off() -> Bench:
    """ArduPilot by acceleration, on its way up by its own take-off, in the tick in which it
    obeys."""
    bench = Bench("ardupilot")
    bench.run(1.0)
    assert bench.arm(command=pushed(-1.0))
    return bench


def test_no_downward_acceleration_ends_a_take_off():
    bench = taking_off()
    bench.run(4.5, pushed(-1.0))
    assert bench.fake.took(STREAM) == []
    bench.run(0.5, pushed(0.2))
    assert {round(m.afz, 3) for m in bench.fake.took(STREAM)} == {-0.2}
    bench.fake.sent.clear()
    bench.run(0.5, pushed(-1.0))
    assert bench.fake.took(STREAM)[-1].afz == pytest.approx(1.0)


def test_downward_accelerations_are_kept_back_for_five_seconds_at_most():
    bench = taking_off()
    bench.run(5.5, pushed(-1.0))
    assert bench.fake.took(STREAM)[-1].afz == pytest.approx(1.0)
