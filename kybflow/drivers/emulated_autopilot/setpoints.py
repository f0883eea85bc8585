"""Conversion of setpoint messages (SET_POSITION_TARGET_* and SET_ATTITUDE_TARGET) to targets in the
local ENU frame of an emulated autopilot."""

from __future__ import annotations

from math import atan2, hypot, isfinite
from typing import Any, NamedTuple

from kybflow.core.geometry import Quat, Vec3, add, from_heading, rotate
from kybflow.drivers.emulation.control import FREE, Axes, PositionTarget
from kybflow.drivers.mavlink.protocol.codec import (
    NO_ACCELERATION,
    NO_ATTITUDE,
    NO_POSITION,
    NO_RATES,
    NO_VELOCITY,
    NO_YAW,
    NO_YAW_RATE,
)
from kybflow.drivers.mavlink.protocol.frames import attitude_from_ned, from_frd, heading_from_ned
from kybflow.drivers.mavlink.protocol.framing import mavlink

LOCAL, LOCAL_OFFSET = mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_OFFSET_NED
BODY, BODY_OFFSET = mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED
BODY_FRD = mavlink.MAV_FRAME_BODY_FRD
NO_THRUST = 1 << 6
"""A bit of the type mask of SET_ATTITUDE_TARGET that the driver's codec doesn't use."""


LEAST_LOOK = 0.5
"""The least distance of a target towards which a vehicle turns, metres."""


class AttitudeTarget(NamedTuple):
    """An attitude, or body rates if `attitude` is None, and a throttle from 0 to 1. rates: None if
    none are given."""

    attitude: Quat | None
    rates: Vec3 | None
    throttle: float


def position_target(message: Any, at: Vec3, heading: float, by_axis: bool) -> PositionTarget | None:
    """Return the target of a SET_POSITION_TARGET_LOCAL_NED; None if it is empty or its frame
    unknown. at, heading: the vehicle's position and heading, for frames that move with it. by_axis:
    whether single axes can be left out; otherwise leaving out one leaves out its whole group."""
    m, mask = message, message.type_mask
    if m.coordinate_frame not in (LOCAL, LOCAL_OFFSET, BODY, BODY_OFFSET, BODY_FRD):
        return None
    position = _axes((m.x, m.y, m.z), mask, NO_POSITION, by_axis)
    velocity = _axes((m.vx, m.vy, m.vz), mask, NO_VELOCITY, by_axis)
    acceleration = _axes((m.afx, m.afy, m.afz), mask, NO_ACCELERATION, by_axis)
    turned = m.coordinate_frame in (BODY, BODY_OFFSET, BODY_FRD)
    if turned:
        position, velocity, acceleration = (
            _turned(axes, heading) for axes in (position, velocity, acceleration)
        )
    if m.coordinate_frame in (LOCAL_OFFSET, BODY_OFFSET) and None not in position:
        x, y, z = position
        position = add(at, (x or 0.0, y or 0.0, z or 0.0))
    to = rate = None
    if not mask & NO_YAW and isfinite(m.yaw):
        to = heading - m.yaw if turned else heading_from_ned(m.yaw)
    if not mask & NO_YAW_RATE and isfinite(m.yaw_rate):
        rate = -m.yaw_rate
    if position == velocity == acceleration == FREE:
        return None
    return PositionTarget(position, velocity, acceleration, to, rate)


def looking_ahead(target: PositionTarget, before: object, at: Vec3) -> PositionTarget:
    """Return the target with a heading towards its position, if it is only a position, far enough
    from `at`. before: the target until now; its heading is kept while its position is the same."""
    x, y, _ = target.position
    if x is None or y is None or target[1:] != (FREE, FREE, None, None):
        return target
    if isinstance(before, PositionTarget) and before.position == target.position:
        return target._replace(heading=before.heading)
    ahead = (x - at[0], y - at[1])
    if hypot(*ahead) < LEAST_LOOK:
        return target
    return target._replace(heading=atan2(ahead[1], ahead[0]))


def attitude_target(message: Any) -> AttitudeTarget | None:
    """Return the target of a SET_ATTITUDE_TARGET; None if it has no thrust, or neither attitude nor
    rates."""
    mask = message.type_mask
    if mask & NO_THRUST or not isfinite(message.thrust):
        return None
    rates = None
    if not mask & NO_RATES:
        rates = from_frd((message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate))
    w, x, y, z = message.q
    attitude = None if mask & NO_ATTITUDE else attitude_from_ned((w, x, y, z))
    if attitude is None and rates is None:
        return None
    return AttitudeTarget(attitude, rates, message.thrust)


def as_local(message: Any, ned: Vec3) -> Any:
    """Convert a SET_POSITION_TARGET_GLOBAL_INT to the equivalent local message. ned: its position
    in the local frame."""
    m, (x, y, z) = message, ned
    return mavlink.MAVLink_set_position_target_local_ned_message(
        m.time_boot_ms, m.target_system, m.target_component, LOCAL, m.type_mask, x, y, z,
        m.vx, m.vy, m.vz, m.afx, m.afy, m.afz, m.yaw, m.yaw_rate,
    )  # fmt: skip


def _axes(values: tuple[float, float, float], mask: int, group: int, by_axis: bool) -> Axes:
    """Convert north, east, down to east, north, up; axes that the mask ignores become None."""
    first = group & -group
    left = [mask & first << axis or not isfinite(v) for axis, v in enumerate(values)]
    if not by_axis and any(left):
        return FREE
    n, e, d = (None if out else v for out, v in zip(left, values, strict=True))
    return (e, n, None if d is None else -d)


def _turned(axes: Axes, heading: float) -> Axes:
    """Rotate body-frame axes (forward, right, down), already reordered by `_axes`, into the
    world."""
    right, forward, up = axes
    if right is None or forward is None:
        return (None, None, up)
    x, y, _ = rotate(from_heading(heading), (forward, -right, 0.0))
    return (x, y, up)
