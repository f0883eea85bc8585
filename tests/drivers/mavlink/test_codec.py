"""Commands and estimates as messages, and messages as measurements."""

from __future__ import annotations

from math import pi

import pytest

pytest.importorskip("pymavlink")

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from kybflow.core import geometry as g
from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import (
    NS,
    Battery,
    Command,
    CommandKind,
    Estimate,
    Imu,
    Payload,
    Setpoint,
    SetpointKind,
    Sticks,
)
from kybflow.drivers.mavlink.protocol import codec
from kybflow.drivers.mavlink.protocol.codec import Throttle, encode, vision
from kybflow.drivers.mavlink.protocol.frames import (
    IDENTITY,
    Anchor,
    Tangent,
    attitude_to_ned,
    to_ned,
)
from kybflow.drivers.mavlink.protocol.framing import Packer

THROTTLE = Throttle(0.5, 20.0)
PLACE, SPEED, PUSH = (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), (0.4, 0.5, 0.6)
numbers = st.floats(-20.0, 20.0)
vectors = st.tuples(numbers, numbers, numbers)


def sent(command, anchor=IDENTITY, throttle=THROTTLE, own_heading=None):
    """The message, packed and read again, so that every field fits."""
    message = encode(
        command, target=(1, 1), boot_ms=5000, anchor=anchor, throttle=throttle,
        own_heading=own_heading,
    )  # fmt: skip
    return mavlink.MAVLink(None).decode(bytearray(Packer(245).pack(message)))


def moving(kind, **fields):
    setpoint = Setpoint(SetpointKind.POSITION, **fields)
    return Command(LEVEL, 0.0, ZERO, 0.0, kind=kind, setpoint=setpoint)


def place_of(message):
    return (message.x, message.y, message.z)


MASKS = [
    (CommandKind.POSITION, {"position": PLACE}, 0x05F8),
    (CommandKind.POSITION, {"position": PLACE, "heading": 0.0}, 0x09F8),
    (CommandKind.POSITION, {"position": PLACE, "heading": 0.0, "heading_rate": 0.1}, 0x01F8),
    (CommandKind.POSITION, {"position": PLACE, "velocity": SPEED, "heading": 0.0}, 0x09C0),
    (CommandKind.POSITION, {"position": PLACE, "acceleration": PUSH, "heading": 0.0}, 0x09F8),
    (
        CommandKind.POSITION,
        {"position": PLACE, "velocity": SPEED, "acceleration": PUSH, "heading": 0.0},
        0x0800,
    ),
    (CommandKind.VELOCITY, {"velocity": SPEED}, 0x05C7),
    (CommandKind.VELOCITY, {"position": PLACE, "velocity": SPEED, "heading": 0.0}, 0x09C7),
    (CommandKind.VELOCITY, {"velocity": SPEED, "acceleration": PUSH, "heading": 0.0}, 0x0807),
    (CommandKind.ACCELERATION, {"acceleration": PUSH, "heading": 0.0}, 0x083F),
    (CommandKind.ACCELERATION, {"velocity": SPEED, "acceleration": PUSH}, 0x043F),
]


@pytest.mark.parametrize(("kind", "fields", "mask"), MASKS)
def test_the_mask_ignores_what_a_setpoint_does_not_have(kind, fields, mask):
    message = sent(moving(kind, **fields))
    assert message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    assert (
        message.target_system, message.target_component, message.coordinate_frame,
        message.time_boot_ms,
    ) == (1, 1, 1, 5000)  # fmt: skip
    assert hex(mask) == hex(message.type_mask)


def test_a_setpoint_arrives_in_the_frame_of_the_autopilot():
    command = moving(
        CommandKind.POSITION, position=PLACE, velocity=SPEED, acceleration=PUSH, heading=0.0,
        heading_rate=0.25,
    )  # fmt: skip
    message = sent(command)
    assert pytest.approx((2.0, 1.0, -3.0)) == place_of(message)
    assert pytest.approx((0.2, 0.1, -0.3)) == (message.vx, message.vy, message.vz)
    assert pytest.approx((0.5, 0.4, -0.6)) == (message.afx, message.afy, message.afz)
    assert pytest.approx(pi / 2) == message.yaw
    assert pytest.approx(-0.25) == message.yaw_rate


def test_an_anchor_moves_and_turns_what_is_asked():
    command = moving(CommandKind.POSITION, position=PLACE, velocity=SPEED, heading=pi / 2)
    message = sent(command, Anchor((1.0, 0.0, 1.0), pi / 2))
    assert pytest.approx(to_ned((2.0, 0.0, 2.0)), abs=1e-6) == place_of(message)
    assert pytest.approx((-0.1, 0.2, -0.3)) == (message.vx, message.vy, message.vz)
    assert pytest.approx(pi / 2) == message.yaw


@pytest.mark.parametrize("kind", [CommandKind.POSITION, CommandKind.VELOCITY])
def test_a_command_without_what_its_kind_needs_is_a_mistake(kind):
    with pytest.raises(ValueError, match=kind.value):
        sent(moving(kind, acceleration=PUSH))
    with pytest.raises(ValueError, match="without a setpoint"):
        sent(Command(LEVEL, 0.0, ZERO, 0.0, kind=kind))


def test_an_attitude_goes_with_its_thrust_and_without_rates():
    tilted = g.from_euler(0.1, -0.2, 0.3)
    message = sent(Command(tilted, 30.0, (0.1, 0.2, 0.3), 0.3))
    assert (
        message.type_mask,
        (message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate),
    ) == (7, (0.0, 0.0, 0.0))
    assert pytest.approx(attitude_to_ned(tilted), abs=1e-6) == tuple(message.q)
    assert pytest.approx(0.75) == message.thrust


def test_an_autopilot_that_raises_the_thrust_by_the_tilt_is_told_the_lift_alone():
    command = Command(g.from_euler(0.3, 0.0, 1.0), 30.0, ZERO, 1.0)
    message = sent(command, throttle=THROTTLE._replace(raised=True))
    assert pytest.approx(0.75 * 0.955336) == message.thrust


def test_where_nobody_knows_the_heading_the_autopilot_keeps_its_own():
    command = Command(g.from_euler(0.1, -0.2, 0.3), 20.0, ZERO, None)
    message = sent(command, Anchor(ZERO, 1.0), own_heading=-0.7)
    wanted = attitude_to_ned(g.from_euler(0.1, -0.2, -0.7))
    assert pytest.approx(wanted, abs=1e-6) == tuple(message.q)


def test_rates_go_without_an_attitude():
    kind = CommandKind.RATES_THRUST
    message = sent(Command(LEVEL, 20.0, (0.1, 0.2, 0.3), None, kind=kind))
    rates = (message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate)
    assert message.type_mask == 128
    assert pytest.approx((0.1, -0.2, -0.3)) == rates
    assert pytest.approx(0.5) == message.thrust


def test_thrust_is_a_share_of_the_throttle_and_none_where_rotors_are_to_rest():
    assert sent(Command(LEVEL, 20.0, ZERO, 0.0, armed=False)).thrust == 0.0
    assert [THROTTLE.share(force) for force in (-3.0, 10.0, 70.0)] == [0.0, 0.25, 1.0]


ESTIMATE = Estimate(
    0, PLACE, (0.0, 1.0, 0.0), g.from_heading(pi / 2), (0.1, 0.2, 0.3), "mocap", 0.0, 0.02
)


def test_an_estimate_goes_out_as_odometry():
    message = vision(ESTIMATE, stamp_us=7_000_000, resets=258)
    message = mavlink.MAVLink(None).decode(bytearray(Packer(245).pack(message)))
    assert (
        message.frame_id, message.child_frame_id, message.time_usec, message.reset_counter,
    ) == (20, 12, 7_000_000, 2)  # fmt: skip
    assert pytest.approx((2.0, 1.0, -3.0)) == place_of(message)
    assert pytest.approx((1.0, 0.0, 0.0), abs=1e-6) == (message.vx, message.vy, message.vz)
    rates = (message.rollspeed, message.pitchspeed, message.yawspeed)
    assert pytest.approx((0.1, -0.2, -0.3)) == rates
    assert pytest.approx(1.0) == abs(message.q[0])
    assert pytest.approx([0.0004] * 3) == [message.pose_covariance[n] for n in (0, 6, 11)]
    assert pytest.approx([0.0009] * 3) == [message.pose_covariance[n] for n in (15, 18, 20)]
    assert sum(1 for entry in message.pose_covariance if entry) == 6
    assert pytest.approx(0.0025) == message.velocity_covariance[0]


@given(vectors, vectors, st.floats(-3.0, 3.0), st.builds(Anchor, vectors, st.floats(-3.0, 3.0)))
def test_odometry_is_what_the_autopilot_knows_of_itself(place, speed, heading, anchor):
    q = g.from_euler(0.1, -0.2, heading)
    local = mavlink.MAVLink_local_position_ned_message(0, *to_ned(place), *to_ned(speed))
    attitude = mavlink.MAVLink_attitude_quaternion_message(0, *attitude_to_ned(q), 0.1, -0.2, -0.3)
    known = codec.odometry(local, attitude, 9, spread=0.1, anchor=anchor)
    assert (known.time, known.spread) == (9, 0.1)
    assert pytest.approx(anchor.to_world(place), abs=1e-9) == known.position
    assert pytest.approx(anchor.turned(speed), abs=1e-9) == known.velocity
    assert pytest.approx(anchor.attitude_to_world(q), abs=1e-9) == known.attitude
    assert known.angular_velocity == (0.1, 0.2, 0.3)
    assert abs(g.wrap(heading - codec.own_heading(attitude))) < 1e-9


def test_at_rest_the_specific_force_points_up():
    rest = Imu(NS, 0.5, (0.0, 0.0, 9.80665), (0.1, -0.2, -0.3))
    fine = mavlink.MAVLink_highres_imu_message(
        0, 0, 0, -9.80665, 0.1, 0.2, 0.3, *[0] * 8
    )  # fmt: skip
    coarse = mavlink.MAVLink_raw_imu_message(0, 0, 0, -1000, 100, 200, 300, 0, 0, 0)
    for message in (fine, coarse):
        felt = codec.imu(message, NS, NS // 2)
        assert (rest.time, rest.dt) == (felt.time, felt.dt)
        assert pytest.approx(rest.specific_force) == felt.specific_force
        assert pytest.approx(rest.angular_velocity) == felt.angular_velocity
        assert codec.imu(message, NS, None) is None
        assert codec.imu(message, NS, NS) is None


def pack(remaining=80, cells=(4000, 4100), number=0):
    voltages = [*cells, *[65535] * (10 - len(cells))]
    return mavlink.MAVLink_battery_status_message(
        number, 0, 0, 0, voltages, -1, -1, -1, remaining
    )  # fmt: skip


def health(voltage, remaining):
    return mavlink.MAVLink_sys_status_message(0, 0, 0, 0, voltage, -1, remaining, 0, 0, 0, 0, 0, 0)


BATTERIES = [
    (pack(), Battery(5, 0.8, 8.1)),
    (pack(remaining=-1), None),
    (pack(cells=()), None),
    (pack(number=1), None),
    (health(11100, 55), Battery(5, 0.55, 11.1)),
    (health(65535, 55), None),
    (health(11100, -1), None),
]


@pytest.mark.parametrize(("message", "battery"), BATTERIES)
def test_a_battery_is_told_where_it_is_known(message, battery):
    assert battery == codec.battery(message, 5)


def fix(kind=3, accuracy=(400, 600)):
    return mavlink.MAVLink_gps_raw_int_message(
        0, kind, 474000100, 85000000, 501000, 120, 200, 0, 0, 9, 0, *accuracy, 0, 0
    )


def test_a_fix_of_gps_is_a_position_in_the_world():
    origin = codec.tangent(mavlink.MAVLink_gps_global_origin_message(474000000, 85000000, 500000))
    assert Tangent.on_ellipsoid(47.4, 8.5, 500.0) == pytest.approx(origin)
    anchor = Anchor((10.0, 0.0, 0.0), 0.0)
    position = codec.gps(fix(), 3, origin=origin, anchor=anchor)
    assert pytest.approx((10.0, 1.112, 1.0), abs=1e-3) == position.position
    assert pytest.approx((0.4, 0.4, 0.6)) == position.spread
    vague = codec.gps(fix(accuracy=(0, 0)), 3, origin=origin, anchor=anchor)
    assert pytest.approx((3.0, 3.0, 5.0)) == vague.spread
    assert codec.gps(fix(kind=2), 3, origin=origin, anchor=anchor) is None


def transmitter(*pulses):
    padded = [*pulses, *[65535] * (18 - len(pulses))]
    return mavlink.MAVLink_rc_channels_message(0, len(pulses), *padded, 255)


def test_sticks_of_a_transmitter():
    message = transmitter(1750, 1250, 2000, 1250, 1000, 2000)
    assert Sticks(4, 0.5, 0.5, 0.5, 1.0, (-1.0, 1.0)) == codec.sticks(message, 4)
    assert codec.sticks(transmitter(), 4) is None
    assert codec.sticks(transmitter(1500, 1500, 0, 1500), 4) is None


def test_sticks_of_a_ground_station():
    message = mavlink.MAVLink_manual_control_message(1, 500, -250, 750, 100, 0b10)
    heard = codec.sticks(message, 4)
    assert (heard.roll, heard.pitch, heard.yaw, heard.throttle) == (-0.25, 0.5, -0.1, 0.75)
    assert heard.switches[:3] == (-1.0, 1.0, -1.0)
    unheard = mavlink.MAVLink_manual_control_message(1, 500, 32767, 750, 100, 0)
    assert codec.sticks(unheard, 4) is None


def test_a_servo_is_open_where_its_pulses_are_short():
    pulses = (1500, 1100, 1900, 0)
    assert Payload(6, True, None) == codec.payload(pulses, 2, 6)
    assert Payload(6, False, None) == codec.payload(pulses, 3, 6)
    assert codec.payload(pulses, 4, 6) is None
    assert codec.payload(pulses, 5, 6) is None
