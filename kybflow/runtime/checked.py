"""What parts give, checked for numbers that are not finite: such a value fails its vehicle.

Each function returns what it was given, or raises ValueError. A sum is finite only when every part
of it is, and x - x is zero only for a finite x: one comparison judges a whole signal.
"""

from __future__ import annotations

from kybflow.geometry import ZERO
from kybflow.signals import Alarm, Command, Estimate, Reaction, Setpoint


def checked_estimate(estimate: Estimate) -> Estimate:
    _, (px, py, pz), (vx, vy, vz), (w, x, y, z), (ox, oy, oz), _, age, spread = estimate
    total = px + py + pz + vx + vy + vz + w + x + y + z + ox + oy + oz + age + spread
    if total - total != 0.0:
        raise ValueError(f"the estimate is not finite: {estimate}")
    return estimate


def checked_setpoint(setpoint: Setpoint) -> Setpoint:
    _, position, velocity, acceleration, jerk, heading, rate = setpoint
    px, py, pz = position or ZERO
    vx, vy, vz = velocity or ZERO
    ax, ay, az = acceleration or ZERO
    jx, jy, jz = jerk or ZERO
    total = px + py + pz + vx + vy + vz + ax + ay + az + jx + jy + jz + (heading or 0.0) + rate
    if total - total != 0.0:
        raise ValueError(f"the setpoint is not finite: {setpoint}")
    return setpoint


def checked_command(command: Command) -> Command:
    (w, x, y, z), thrust, (ox, oy, oz), heading, _ = command
    total = w + x + y + z + thrust + ox + oy + oz + (heading or 0.0)
    if total - total != 0.0:
        raise ValueError(f"the command is not finite: {command}")
    return command


def checked_alarm(alarm: Alarm) -> Alarm:
    """Raises ValueError for what is no alarm with a reaction."""
    if not isinstance(alarm, Alarm) or not isinstance(alarm.reaction, Reaction):
        raise ValueError(f"an alarm with a reaction is asked for, not {alarm!r}")
    return alarm
