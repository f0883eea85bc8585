"""What an autopilot says, as measurements. Pure; `codec` is the way there.

Messages are read by their fields alone. `time` is when a message was true, in the run: autopilots
count from their own start, which `clocks` translates. What a message leaves open gives None.
"""

from __future__ import annotations

from itertools import takewhile
from typing import TYPE_CHECKING

from kybflow.core.geometry import Vec3, scale, to_euler
from kybflow.core.signals import NS, Battery, Imu, Odometry, Payload, Position, Sticks, Time
from kybflow.drivers.mavlink.protocol.frames import (
    Anchor,
    Tangent,
    attitude_from_ned,
    from_frd,
    from_ned,
    heading_from_ned,
)

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.protocol.framing import Message

MILLI_G, MILLI = 9.80665e-3, 1e-3
"""m/s^2 and rad/s in a unit of RAW_IMU and SCALED_IMU."""
UNKNOWN = 0xFFFF
"""An unsigned 16-bit field that says nothing."""
NO_STICK = 0x7FFF
"""A signed 16-bit field that says nothing."""
FIX = 3
"""The first kind of GPS fix that has a height."""
DILUTED = 2.5
"""Metres that a position of GPS spreads by for each unit of its dilution, where it says no more."""
SERVO_MIDDLE = 1500
"""Microseconds: shorter pulses open, longer ones close."""
BUTTONS = 16


def odometry(
    local: Message, attitude: Message, time: Time, *, spread: float, anchor: Anchor
) -> Odometry:
    """Of LOCAL_POSITION_NED, which was true at `time`, and the newest ATTITUDE_QUATERNION. spread:
    the profile's reading of the estimator's status."""
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
    """Whether all of them are; a sum is finite only where every part of it is."""
    total = sum(numbers)
    return total - total == 0.0


def is_attitude(message: Message) -> bool:
    """Whether ATTITUDE_QUATERNION has a rotation and rates that can be true."""
    w, x, y, z = message.q1, message.q2, message.q3, message.q4
    turns = 0.9 < w * w + x * x + y * y + z * z < 1.1
    return turns and is_finite(message.rollspeed, message.pitchspeed, message.yawspeed)


def own_heading(attitude: Message) -> float:
    """The heading of ATTITUDE_QUATERNION in the autopilot's own frame, as ENU, radians."""
    yaw = to_euler((attitude.q1, attitude.q2, attitude.q3, attitude.q4))[2]
    return heading_from_ned(yaw)


def imu(message: Message, time: Time, last: Time | None) -> Imu | None:
    """Of HIGHRES_IMU, or of RAW_IMU and SCALED_IMU in thousandths of g and of rad/s. last: the time
    of the one before; without one there is no period to speak of."""
    if last is None or time <= last:
        return None
    force: Vec3 = (message.xacc, message.yacc, message.zacc)
    turn: Vec3 = (message.xgyro, message.ygyro, message.zgyro)
    if message.get_type() != "HIGHRES_IMU":
        force, turn = scale(force, MILLI_G), scale(turn, MILLI)
    return Imu(time, (time - last) / NS, from_frd(force), from_frd(turn))


def battery(message: Message, time: Time) -> Battery | None:
    """Of BATTERY_STATUS, the first battery's alone, or of SYS_STATUS; None where it has no voltage
    or does not know what remains."""
    if message.battery_remaining < 0:
        return None
    if message.get_type() == "SYS_STATUS":
        millivolts = message.voltage_battery
        known = millivolts not in (0, UNKNOWN)
    else:
        cells = tuple(takewhile(lambda cell: cell != UNKNOWN, message.voltages))
        millivolts = sum(cells)
        known = message.id == 0 and millivolts > 0
    if not known:
        return None
    return Battery(time, message.battery_remaining / 100.0, millivolts / 1000.0)


def gps(message: Message, time: Time, *, origin: Tangent, anchor: Anchor) -> Position | None:
    """Of GPS_RAW_INT: a position of the receiver alone. origin: where the autopilot's own frame
    begins, as GPS_GLOBAL_ORIGIN says. None without a fix in three dimensions."""
    if message.fix_type < FIX:
        return None
    place = origin.local(message.lat * 1e-7, message.lon * 1e-7, message.alt * 1e-3)
    across = _gps_spread(message.h_acc, message.eph)
    up = _gps_spread(message.v_acc, message.epv)
    if across is None or up is None:
        return None
    return Position(time, anchor.to_world(place), (across, across, up))


def tangent(message: Message) -> Tangent:
    """Of GPS_GLOBAL_ORIGIN."""
    degrees = (message.latitude * 1e-7, message.longitude * 1e-7)
    return Tangent.on_ellipsoid(*degrees, message.altitude * 1e-3)


def sticks(message: Message, time: Time) -> Sticks | None:
    """Of RC_CHANNELS, whose first four are roll, pitch, throttle and yaw, or of MANUAL_CONTROL.
    None where no transmitter is heard."""
    if message.get_type() == "RC_CHANNELS":
        return _transmitter(message, time)
    axes = (message.y, message.x, message.r, message.z)
    if NO_STICK in axes:
        return None
    roll, pitch, yaw, throttle = (min(max(axis * MILLI, -1.0), 1.0) for axis in axes)
    pressed = tuple(1.0 if message.buttons >> n & 1 else -1.0 for n in range(BUTTONS))
    return Sticks(time, roll, pitch, -yaw, max(throttle, 0.0), pressed)


def payload(servos: tuple[int, ...], channel: int, time: Time) -> Payload | None:
    """Of the pulses in SERVO_OUTPUT_RAW, microseconds, the first channel first: whether the servo
    that holds the payload is open. None while that output gives no pulses. It is not told whether
    anything hangs there."""
    pulse = servos[channel - 1] if channel <= len(servos) else 0
    if pulse in (0, UNKNOWN):
        return None
    return Payload(time, pulse < SERVO_MIDDLE, None)


def _transmitter(message: Message, time: Time) -> Sticks | None:
    count = min(message.chancount, 18)
    pulses = [getattr(message, f"chan{n}_raw") for n in range(1, count + 1)]
    heard = [(pulse - 1500) / 500 for pulse in takewhile(_is_pulse, pulses)]
    if len(heard) < 4:
        return None
    roll, pitch, throttle, yaw, *switches = (min(max(axis, -1.0), 1.0) for axis in heard)
    return Sticks(time, roll, -pitch, -yaw, 0.5 + 0.5 * throttle, tuple(switches))


def _is_pulse(pulse: int) -> bool:
    return pulse not in (0, UNKNOWN)


def _gps_spread(accuracy: int, dilution: int) -> float | None:
    """Metres: of an accuracy in millimetres, else of a dilution in hundredths."""
    if accuracy > 0:
        return accuracy * MILLI
    return None if dilution == UNKNOWN else DILUTED * dilution / 100.0
