"""Checks that all numbers in a part's output are finite.

Each function returns its argument, or raises ValueError if a number is not finite. A sum is finite
only if all its terms are, and x - x is zero only for a finite x, so one comparison checks a whole
signal.
"""

from __future__ import annotations

from kybflow.core.geometry import ZERO
from kybflow.core.signals import Alarm, Command, CommandKind, Estimate, Reaction, Setpoint

_ATTITUDE_THRUST = CommandKind.ATTITUDE_THRUST
_FOLLOWED = {
    CommandKind.POSITION: "position",
    CommandKind.VELOCITY: "velocity",
    CommandKind.ACCELERATION: "acceleration",
    CommandKind.TILT_CLIMB: "velocity",
}
"""The setpoint field that each kind of command requires."""


def checked_estimate(estimate: Estimate) -> Estimate:
    _, position, velocity, attitude, rates, _, age, spread = estimate
    px, py, pz = position
    vx, vy, vz = velocity
    w, x, y, z = attitude
    ox, oy, oz = rates
    total = px + py + pz + vx + vy + vz + w + x + y + z + ox + oy + oz + age + spread
    if total - total != 0.0:
        raise ValueError(f"the estimate is not finite: {estimate}")
    return estimate


def checked_setpoint(setpoint: Setpoint) -> Setpoint:
    _, position, velocity, acceleration, jerk, heading, rate, _ = setpoint
    px, py, pz = position or ZERO
    vx, vy, vz = velocity or ZERO
    ax, ay, az = acceleration or ZERO
    jx, jy, jz = jerk or ZERO
    total = px + py + pz + vx + vy + vz + ax + ay + az + jx + jy + jz + (heading or 0.0) + rate
    if total - total != 0.0:
        raise ValueError(f"the setpoint is not finite: {setpoint}")
    return setpoint


def checked_command(command: Command) -> Command:
    """Return `command`. Raises ValueError if it is not finite or lacks the setpoint field that its
    kind requires."""
    attitude, thrust, rates, heading, _, kind, setpoint = command
    w, x, y, z = attitude
    ox, oy, oz = rates
    total = w + x + y + z + thrust + ox + oy + oz + (heading or 0.0)
    if total - total != 0.0:
        raise ValueError(f"the command is not finite: {command}")
    if kind is not _ATTITUDE_THRUST:
        if setpoint is not None:
            checked_setpoint(setpoint)
        needed = _FOLLOWED.get(kind)
        if needed is not None and getattr(setpoint, needed, None) is None:
            raise ValueError(f"a command of {needed} has no {needed}: {setpoint}")
    return command


def checked_alarm(alarm: Alarm) -> Alarm:
    """Return `alarm`. Raises ValueError unless it is an Alarm with a Reaction."""
    if not isinstance(alarm, Alarm) or not isinstance(alarm.reaction, Reaction):
        raise ValueError(f"expected an alarm with a reaction, not {alarm!r}")
    return alarm
