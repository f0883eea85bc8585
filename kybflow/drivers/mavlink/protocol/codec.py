"""Conversion of commands and estimates to MAVLink messages, and of messages to measurements. Pure.

SET_POSITION_TARGET_LOCAL_NED: PX4 follows position, velocity or acceleration, and feeds forward any
others that are given. ArduPilot follows position; position and velocity; velocity; or acceleration;
acceleration is fed forward if a velocity is given. Position with acceleration alone would stop it,
so an acceleration is only sent with a velocity, or by itself. Without yaw and yaw rate ArduPilot
turns in the direction of flight, so at least one of them is always sent. Both autopilots accept yaw
with a yaw rate, which they feed forward.

SET_ATTITUDE_TARGET: if rates are given with an attitude, PX4 treats them as a second, competing
setpoint, and ArduPilot takes all three or none; so with an attitude all three are ignored.
ArduPilot treats `thrust` as a climb rate unless GUID_OPTIONS has bit 3, and raises the thrust by
the commanded tilt.

ODOMETRY: ArduPilot accepts only the frame LOCAL_FRD with the child frame BODY_FRD; PX4 accepts them
as well.

Messages are read only through their fields. `time` is when the content of a message was true, in
the run's time; `telemetry.clocks` converts the autopilot's stamps. A field that the message leaves
unset gives None."""

from __future__ import annotations

from itertools import takewhile
from typing import NamedTuple

from kybflow.core.geometry import LEVEL, ZERO, Vec3, conjugate, rotate, scale, to_euler
from kybflow.core.signals import (
    NS,
    Battery,
    Command,
    CommandKind,
    Estimate,
    Imu,
    Odometry,
    Payload,
    Position,
    Setpoint,
    Sticks,
    Time,
)
from kybflow.drivers.mavlink.protocol.frames import (
    Anchor,
    Tangent,
    attitude_from_ned,
    attitude_to_ned,
    from_frd,
    from_ned,
    heading_from_ned,
    heading_to_ned,
    lean,
    to_frd,
    to_ned,
    with_heading,
)
from kybflow.drivers.mavlink.protocol.framing import LAYOUTS, Message, mavlink

ODOMETRY = LAYOUTS[mavlink.MAVLINK_MSG_ID_ODOMETRY]
POSITION_TARGET = LAYOUTS[mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED]
NO_POSITION, NO_VELOCITY, NO_ACCELERATION = 0b111, 0b111 << 3, 0b111 << 6
NO_YAW, NO_YAW_RATE = 1 << 10, 1 << 11
"""Bits of the type mask of SET_POSITION_TARGET_LOCAL_NED: the fields to ignore."""
NO_RATES, NO_ATTITUDE = 0b111, 1 << 7
"""Bits of the type mask of SET_ATTITUDE_TARGET: the fields to ignore."""
ATTITUDE_SPREAD, VELOCITY_SPREAD = 0.03, 0.05
"""The standard deviations of attitude, rad, and velocity, m/s, sent to an autopilot; no estimator
provides them."""
POSE_QUALITY = 100
"""The quality of a pose in ODOMETRY, per cent."""


class Throttle(NamedTuple):
    """Converts thrust to throttle in proportion: the throttle `hover` (0 to 1) lifts `newtons`.
    raised: whether the autopilot itself raises the thrust with the tilt."""

    hover: float
    newtons: float
    raised: bool = False

    def share(self, newtons: float) -> float:
        """Return the throttle for this thrust, 0 to 1."""
        return min(max(self.hover * newtons / self.newtons, 0.0), 1.0)


def encode(
    command: Command, *, target: tuple[int, int], boot_ms: int, anchor: Anchor,
    throttle: Throttle, own_heading: float | None = None,
) -> Message:  # fmt: skip
    """Return the setpoint message for a command. A command that is not armed has no thrust.

    target: system and component id.
    boot_ms: the time since the vehicle's boot, ms.
    own_heading: the heading in the autopilot's own frame, in the ENU convention, radians; held if
    the command has none.
    Raises ValueError if the setpoint lacks what its kind needs, which is a bug of the tracker."""
    boot_ms &= 0xFFFFFFFF
    if command.kind in (CommandKind.ATTITUDE_THRUST, CommandKind.RATES_THRUST):
        return _attitude_target(command, target, boot_ms, anchor, throttle, own_heading)
    return _position_target(command, target, boot_ms, anchor)


def command_long(target: tuple[int, int], command: int, *params: float, again: int = 0) -> Message:
    """Return a COMMAND_LONG with up to seven parameters; missing ones are 0. again: how often it
    has been sent already, at most 255."""
    filled = (*params, *(0.0,) * (7 - len(params)))
    return mavlink.MAVLink_command_long_message(*target, command, again, *filled)


def vision(estimate: Estimate, *, stamp_us: int, resets: int) -> Message:
    """Return an ODOMETRY message of kybflow's estimate; kybflow's world becomes the autopilot's own
    frame. stamp_us: the time of the estimate by the vehicle's clock, us. resets: how often the
    estimate has jumped."""
    body = conjugate(estimate.attitude)
    return ODOMETRY.of(
        stamp_us, *to_ned(estimate.position), *attitude_to_ned(estimate.attitude),
        *to_frd(rotate(body, estimate.velocity)), *to_frd(estimate.angular_velocity),
        *_covariance(estimate.spread), *VELOCITY_COVARIANCE,
        mavlink.MAV_FRAME_LOCAL_FRD, mavlink.MAV_FRAME_BODY_FRD, resets & 0xFF,
        mavlink.MAV_ESTIMATOR_TYPE_VISION, POSE_QUALITY,
    )  # fmt: skip


def _position_target(
    command: Command, target: tuple[int, int], boot_ms: int, anchor: Anchor
) -> Message:
    setpoint = command.setpoint
    if setpoint is None:
        raise ValueError(f"a command of kind {command.kind.value} without a setpoint")
    position, velocity, acceleration = _followed(command.kind, setpoint)
    mask = NO_POSITION if position is None else 0
    mask |= NO_VELOCITY if velocity is None else 0
    mask |= NO_ACCELERATION if acceleration is None else 0
    yaw = 0.0
    if setpoint.heading is None:
        mask |= NO_YAW
    else:
        yaw = heading_to_ned(anchor.heading_from_world(setpoint.heading))
        mask |= 0 if setpoint.heading_rate else NO_YAW_RATE
    return POSITION_TARGET.of(
        boot_ms, *(ZERO if position is None else to_ned(anchor.from_world(position))),
        *to_ned(anchor.unturned(velocity or ZERO)), *to_ned(anchor.unturned(acceleration or ZERO)),
        yaw, -setpoint.heading_rate + 0.0, mask, *target, mavlink.MAV_FRAME_LOCAL_NED,
    )  # fmt: skip


def _followed(
    kind: CommandKind, setpoint: Setpoint
) -> tuple[Vec3 | None, Vec3 | None, Vec3 | None]:
    """Return the position, velocity and acceleration to send; None for those that are not sent."""
    _, position, velocity, acceleration, *_ = setpoint
    if kind is CommandKind.POSITION:
        wanted = position
        acceleration = None if velocity is None else acceleration
    elif kind is CommandKind.VELOCITY:
        wanted, position = velocity, None
    else:
        wanted, position, velocity = acceleration, None, None
    if wanted is None:
        raise ValueError(f"a setpoint without {kind.value} in a command of that kind")
    return position, velocity, acceleration


def _attitude_target(
    command: Command, target: tuple[int, int], boot_ms: int, anchor: Anchor, throttle: Throttle,
    own_heading: float | None,
) -> Message:  # fmt: skip
    thrust = command.thrust if command.armed else 0.0
    if command.kind is CommandKind.RATES_THRUST:
        mask, attitude, rates = NO_ATTITUDE, LEVEL, to_frd(command.rates)
    else:
        mask, attitude, rates = NO_RATES, anchor.attitude_from_world(command.attitude), ZERO
        if command.heading is None and own_heading is not None:
            attitude = with_heading(command.attitude, own_heading)
        thrust *= lean(attitude) if throttle.raised else 1.0
        attitude = attitude_to_ned(attitude)
    return mavlink.MAVLink_set_attitude_target_message(
        boot_ms, *target, mask, attitude, *rates, throttle.share(thrust)
    )


def _covariance(spread: float) -> tuple[float, ...]:
    """Return the upper triangle, by rows, of the covariance of a pose or a velocity, without
    correlations. spread: the standard deviation of the first three components."""
    p, a = spread * spread, ATTITUDE_SPREAD * ATTITUDE_SPREAD
    return (
        p, 0.0, 0.0, 0.0, 0.0, 0.0,
        p, 0.0, 0.0, 0.0, 0.0,
        p, 0.0, 0.0, 0.0,
        a, 0.0, 0.0,
        a, 0.0,
        a,
    )  # fmt: skip


VELOCITY_COVARIANCE = _covariance(VELOCITY_SPREAD)


MILLI_G, MILLI = 9.80665e-3, 1e-3
"""The units of RAW_IMU and SCALED_IMU in m/s^2 and rad/s."""
UNSET_FIELD = 0xFFFF
"""The value of an unset unsigned 16-bit field."""
NO_STICK = 0x7FFF
"""The value of an unset signed 16-bit field."""
FIX = mavlink.GPS_FIX_TYPE_3D_FIX
"""The lowest GPS fix type that includes a height."""
DILUTION_SPREAD = 2.5
"""The standard deviation of a GPS position, metres per unit of its dilution of precision, used if
the receiver reports no accuracy."""
SERVO_MIDDLE = 1500
"""Pulse length in microseconds: shorter pulses open, longer ones close."""
BUTTONS = 16


def odometry(
    local: Message, attitude: Message, time: Time, *, spread: float, anchor: Anchor
) -> Odometry:
    """Return the autopilot's own estimate, from LOCAL_POSITION_NED, which was true at `time`, and
    the newest ATTITUDE_QUATERNION. spread: the standard deviation of the position, metres."""
    turn = attitude_from_ned((attitude.q1, attitude.q2, attitude.q3, attitude.q4))
    return Odometry(
        time,
        anchor.to_world(from_ned((local.x, local.y, local.z))),
        anchor.turned(from_ned((local.vx, local.vy, local.vz))),
        anchor.attitude_to_world(turn),
        from_frd((attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed)),
        spread,
    )


def is_finite(*numbers: float) -> bool:
    """Return whether all numbers are finite; a sum is finite only if every part of it is."""
    total = sum(numbers)
    return total - total == 0.0


def is_attitude(message: Message) -> bool:
    """Return whether an ATTITUDE_QUATERNION has a valid rotation and finite rates."""
    w, x, y, z = message.q1, message.q2, message.q3, message.q4
    turns = 0.9 < w * w + x * x + y * y + z * z < 1.1
    return turns and is_finite(message.rollspeed, message.pitchspeed, message.yawspeed)


def own_heading(attitude: Message) -> float:
    """Return the heading from ATTITUDE_QUATERNION in the autopilot's own frame, in the ENU
    convention, radians."""
    yaw = to_euler((attitude.q1, attitude.q2, attitude.q3, attitude.q4))[2]
    return heading_from_ned(yaw)


def imu(message: Message, time: Time, last: Time | None) -> Imu | None:
    """Return an IMU sample from HIGHRES_IMU, or from RAW_IMU or SCALED_IMU, which count in
    thousandths of g and rad/s. last: the time of the previous sample; without it the period is
    unknown and the result is None."""
    if last is None or time <= last:
        return None
    force: Vec3 = (message.xacc, message.yacc, message.zacc)
    turn: Vec3 = (message.xgyro, message.ygyro, message.zgyro)
    if message.get_type() != "HIGHRES_IMU":
        force, turn = scale(force, MILLI_G), scale(turn, MILLI)
    return Imu(time, (time - last) / NS, from_frd(force), from_frd(turn))


def battery(message: Message, time: Time) -> Battery | None:
    """Return the battery's state from BATTERY_STATUS (the first battery only) or SYS_STATUS. Return
    None if the message has no voltage or no remaining charge."""
    if message.battery_remaining < 0:
        return None
    if message.get_type() == "SYS_STATUS":
        millivolts = message.voltage_battery
        known = millivolts not in (0, UNSET_FIELD)
    else:
        cells = tuple(takewhile(lambda cell: cell != UNSET_FIELD, message.voltages))
        millivolts = sum(cells)
        known = message.id == 0 and millivolts > 0
    if not known:
        return None
    return Battery(time, message.battery_remaining / 100.0, millivolts / 1000.0)


def gps(message: Message, time: Time, *, origin: Tangent, anchor: Anchor) -> Position | None:
    """Return the GPS receiver's position from GPS_RAW_INT; None without a 3D fix. origin: the
    origin of the autopilot's own frame, from GPS_GLOBAL_ORIGIN."""
    if message.fix_type < FIX:
        return None
    place = origin.local(message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3)
    across = _gps_spread(message.h_acc, message.eph)
    up = _gps_spread(message.v_acc, message.epv)
    if across is None or up is None:
        return None
    return Position(time, anchor.to_world(place), (across, across, up))


def tangent(message: Message) -> Tangent:
    """Return the origin of the autopilot's own frame, from GPS_GLOBAL_ORIGIN."""
    degrees = (message.latitude * 1e-7, message.longitude * 1e-7)
    return Tangent.on_ellipsoid(*degrees, message.altitude * 1e-3)


def sticks(message: Message, time: Time) -> Sticks | None:
    """Return the pilot's sticks from RC_CHANNELS, whose first four channels are roll, pitch,
    throttle and yaw, or from MANUAL_CONTROL. Return None if no transmitter is received."""
    if message.get_type() == "RC_CHANNELS":
        count = min(message.chancount, 18)
        pulses = [getattr(message, f"chan{n}_raw") for n in range(1, count + 1)]
        known = takewhile(lambda pulse: pulse not in (0, UNSET_FIELD), pulses)
        channels = [min(max((pulse - 1500) / 500, -1.0), 1.0) for pulse in known]
        if len(channels) < 4:
            return None
        roll, pitch, throttle, yaw, *switches = channels
        return Sticks(time, roll, -pitch, -yaw, 0.5 + 0.5 * throttle, tuple(switches))
    axes = (message.y, message.x, message.r, message.z)
    if NO_STICK in axes:
        return None
    roll, pitch, yaw, throttle = (min(max(axis * MILLI, -1.0), 1.0) for axis in axes)
    pressed = tuple(1.0 if message.buttons >> n & 1 else -1.0 for n in range(BUTTONS))
    return Sticks(time, roll, pitch, -yaw, max(throttle, 0.0), pressed)


def payload(servos: tuple[int, ...], channel: int, time: Time) -> Payload | None:
    """Return whether the payload's servo is open; None while its output has no pulses. Whether it
    holds a payload is unknown. servos: the pulses of SERVO_OUTPUT_RAW, microseconds, channel 1
    first."""
    pulse = servos[channel - 1] if channel <= len(servos) else 0
    if pulse in (0, UNSET_FIELD):
        return None
    return Payload(time, pulse < SERVO_MIDDLE, None)


def _gps_spread(accuracy: int, dilution: int) -> float | None:
    """Return the standard deviation in metres, from an accuracy in millimetres or else from a
    dilution in hundredths; None if both are unset."""
    if accuracy > 0:
        return accuracy * MILLI
    return None if dilution == UNSET_FIELD else DILUTION_SPREAD * dilution / 100.0
