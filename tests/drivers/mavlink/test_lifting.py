"""The set-points that lift a vehicle from the ground."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink")

from fake import ARM, RESTING, Bench, at
from hypothesis import given
from hypothesis import strategies as st

from kybflow.drivers.mavlink.arming import LIFTED
from kybflow.drivers.mavlink.lifting import raised
from kybflow.errors import Refused
from kybflow.geometry import ZERO
from kybflow.signals import CommandKind, Setpoint, SetpointKind

STREAM = "SET_POSITION_TARGET_LOCAL_NED"
MOVING = Setpoint(
    SetpointKind.POSITION, (1.0, 2.0, 0.1), (0.0, 0.0, 0.3), (0.0, 0.0, 0.5), (0.0, 0.0, 1.0), 0.7
)


@given(st.floats(0.0, 3.0))
def test_a_place_is_raised_and_rests_there(height):
    command = at(ZERO)._replace(setpoint=MOVING)
    higher = raised(command, height)
    assert higher.setpoint.position == pytest.approx((1.0, 2.0, 0.1 + height))
    assert higher.setpoint[2:5] == (ZERO, ZERO, ZERO)
    assert higher == command._replace(setpoint=higher.setpoint)
    assert higher.setpoint.heading == 0.7


def test_what_is_no_place_stays_as_it_is():
    speed = Setpoint(SetpointKind.VELOCITY, None, (0.0, 0.0, 0.2), ZERO)
    climbing = at(ZERO)._replace(kind=CommandKind.VELOCITY, setpoint=speed)
    for command in (RESTING, climbing):
        assert raised(command, 0.5) is command


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
