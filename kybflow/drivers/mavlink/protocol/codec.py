"""What is told to an autopilot, as MAVLink messages. Pure; `decode` is the way back.

SET_POSITION_TARGET_LOCAL_NED: PX4 follows any of position, velocity and acceleration, and feeds
what else is there forward. ArduPilot follows position; position and velocity; velocity;
acceleration; each of the last three with acceleration fed forward; but position with acceleration
alone stops it, so acceleration goes along only where velocity does, or nothing else. Without yaw
and without yaw rate ArduPilot turns to where it flies, so one of both is always there. Both take
both, the rate fed forward.

SET_ATTITUDE_TARGET: PX4 takes rates beside an attitude for a second, competing set-point, and
ArduPilot takes all three or none; so beside an attitude all three are ignored. ArduPilot takes
`thrust` for a climb rate unless GUID_OPTIONS has bit 3, and raises it by the tilt that is wanted.

ODOMETRY: ArduPilot drops all but frame LOCAL_FRD with child BODY_FRD; PX4 takes these too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.geometry import LEVEL, ZERO, Quat, Vec3, conjugate, rotate, to_euler
from kybflow.core.signals import Command, CommandKind, Estimate, Setpoint
from kybflow.drivers.mavlink.protocol.frames import (
    Anchor,
    attitude_to_ned,
    heading_to_ned,
    lean,
    to_frd,
    to_ned,
    with_heading,
)

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.protocol.framing import Message

NO_POSITION, NO_VELOCITY, NO_ACCELERATION = 0b111, 0b111 << 3, 0b111 << 6
NO_YAW, NO_YAW_RATE = 1 << 10, 1 << 11
"""Of SET_POSITION_TARGET_LOCAL_NED: what is not to be heeded."""
NO_RATES, NO_ATTITUDE = 0b111, 1 << 7
"""Of SET_ATTITUDE_TARGET, likewise."""
ATTITUDE_SPREAD, VELOCITY_SPREAD = 0.03, 0.05
"""What an autopilot is told of the standard deviation of an estimate's attitude, rad, and of its
velocity, m/s, which no estimator gives."""
WELL = 100
"""The quality of a pose, per cent."""


class Throttle(NamedTuple):
    """What thrust is as a share of the throttle: `hover` of it lifts `newtons`, in proportion.
    raised: whether the autopilot itself raises it where the vehicle leans."""

    hover: float
    newtons: float
    raised: bool = False

    def share(self, newtons: float) -> float:
        """0 to 1."""
        return min(max(self.hover * newtons / self.newtons, 0.0), 1.0)


def encode(
    command: Command, *, target: tuple[int, int], boot_ms: int, anchor: Anchor,
    throttle: Throttle, own_heading: float | None = None,
) -> Message:  # fmt: skip
    """The set-point message of a command. target: system and component. boot_ms: the vehicle's time
    since its start. own_heading: the autopilot's, in its own frame but as ENU; it is held where the
    command knows none. A command that is not armed asks for no thrust. Raises ValueError where the
    setpoint lacks what its kind needs, which is a tracker's mistake."""
    head = (boot_ms & 0xFFFFFFFF, *target)
    if command.kind in (CommandKind.ATTITUDE_THRUST, CommandKind.RATES_THRUST):
        return _attitude_target(command, head, anchor, throttle, own_heading)
    return _position_target(command, head, anchor)


def vision(estimate: Estimate, *, stamp_us: int, resets: int) -> Message:
    """ODOMETRY of what kybflow believes, whose world becomes the autopilot's own frame. stamp_us:
    when it was true, in the vehicle's time. resets: how often the estimate has jumped."""
    body = conjugate(estimate.attitude)
    place = to_ned(estimate.position)
    speed = to_frd(rotate(body, estimate.velocity))
    return mavlink.MAVLink_odometry_message(
        stamp_us, mavlink.MAV_FRAME_LOCAL_FRD, mavlink.MAV_FRAME_BODY_FRD, *place,
        attitude_to_ned(estimate.attitude), *speed, *to_frd(estimate.angular_velocity),
        _covariance(estimate.spread), _covariance(VELOCITY_SPREAD), resets & 0xFF,
        mavlink.MAV_ESTIMATOR_TYPE_VISION, WELL,
    )  # fmt: skip


def position_estimate(estimate: Estimate, *, stamp_us: int, resets: int) -> Message:
    """VISION_POSITION_ESTIMATE, the elder alternative to ODOMETRY; it has no velocity."""
    roll, pitch, yaw = to_euler(attitude_to_ned(estimate.attitude))
    return mavlink.MAVLink_vision_position_estimate_message(
        stamp_us, *to_ned(estimate.position), roll, pitch, yaw,
        _covariance(estimate.spread), resets & 0xFF,
    )  # fmt: skip


def _position_target(command: Command, head: tuple[int, ...], anchor: Anchor) -> Message:
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
    return mavlink.MAVLink_set_position_target_local_ned_message(
        *head, mavlink.MAV_FRAME_LOCAL_NED, mask,
        *(ZERO if position is None else to_ned(anchor.from_world(position))),
        *to_ned(anchor.unturned(velocity or ZERO)), *to_ned(anchor.unturned(acceleration or ZERO)),
        yaw, -setpoint.heading_rate + 0.0,
    )  # fmt: skip


def _followed(
    kind: CommandKind, setpoint: Setpoint
) -> tuple[Vec3 | None, Vec3 | None, Vec3 | None]:
    """What of position, velocity and acceleration is sent."""
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
    command: Command, head: tuple[int, ...], anchor: Anchor, throttle: Throttle,
    own_heading: float | None,
) -> Message:  # fmt: skip
    thrust = command.thrust if command.armed else 0.0
    if command.kind is CommandKind.RATES_THRUST:
        mask, attitude, rates = NO_ATTITUDE, LEVEL, to_frd(command.rates)
    else:
        mask, attitude, rates = NO_RATES, _wanted(command, anchor, own_heading), ZERO
        thrust *= lean(attitude) if throttle.raised else 1.0
        attitude = attitude_to_ned(attitude)
    return mavlink.MAVLink_set_attitude_target_message(
        *head, mask, attitude, *rates, throttle.share(thrust)
    )


def _wanted(command: Command, anchor: Anchor, own_heading: float | None) -> Quat:
    """The attitude in the autopilot's frame, FLU to ENU."""
    if command.heading is None and own_heading is not None:
        return with_heading(command.attitude, own_heading)
    return anchor.attitude_from_world(command.attitude)


def _covariance(spread: float) -> tuple[float, ...]:
    """The upper triangle of a pose's covariance, or a velocity's, by rows: no correlations."""
    linear, angular = spread * spread, ATTITUDE_SPREAD * ATTITUDE_SPREAD
    entries: list[Any] = [0.0] * 21
    for place, variance in zip((0, 6, 11, 15, 18, 20), (linear,) * 3 + (angular,) * 3, strict=True):
        entries[place] = variance
    return tuple(entries)
