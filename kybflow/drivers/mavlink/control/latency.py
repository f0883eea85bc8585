"""Set-points sent ahead of their time.

An autopilot comes after what it is sent: its attitude loop and its rotors take a moment. What it is
sent is the set-point of that much later, by its own velocity, acceleration and jerk; one that rests
stays where it is. An acceleration, which has no position loop of the autopilot's before it, comes
later by another time.
"""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.geometry import ZERO, add, scale
from kybflow.core.signals import Command, SetpointKind


class Lag(NamedTuple):
    """Seconds by which a vehicle comes after set-points of position and velocity, and after those
    of acceleration alone."""

    position: float
    acceleration: float


def led(command: Command, lag: Lag) -> Command:
    """A command so far ahead as the vehicle comes after it; as it is where it says not how it
    moves."""
    setpoint = command.setpoint
    if setpoint is None or (acceleration := setpoint.acceleration) is None:
        return command
    position, velocity = setpoint.position, setpoint.velocity
    jerk, time = setpoint.jerk or ZERO, lag.position
    if setpoint.kind is SetpointKind.ACCELERATION:
        pushed = setpoint._replace(acceleration=add(acceleration, scale(jerk, lag.acceleration)))
        return command._replace(setpoint=pushed)
    if velocity is None:
        return command
    if position is not None:
        position = add(position, scale(velocity, time))
        position = add(position, scale(acceleration, 0.5 * time * time))
        position = add(position, scale(jerk, time**3 / 6.0))
    velocity = add(velocity, add(scale(acceleration, time), scale(jerk, 0.5 * time * time)))
    acceleration = add(acceleration, scale(jerk, time))
    ahead = setpoint._replace(position=position, velocity=velocity, acceleration=acceleration)
    return command._replace(setpoint=ahead)
