"""Set-points sent ahead of their time.

An autopilot comes after what it is sent: its attitude loop and its rotors take a moment. What it is
sent is the set-point of that much later, by its own velocity, acceleration and jerk; one that rests
stays where it is.
"""

from __future__ import annotations

from kybflow.geometry import ZERO, add, scale
from kybflow.signals import Command


def led(command: Command, time: float) -> Command:
    """A command `time` seconds ahead; as it is where it says not how it moves."""
    setpoint = command.setpoint
    if setpoint is None:
        return command
    _, position, velocity, acceleration, *_ = setpoint
    if velocity is None or acceleration is None:
        return command
    jerk = setpoint.jerk or ZERO
    if position is not None:
        position = add(position, scale(velocity, time))
        position = add(position, scale(acceleration, 0.5 * time * time))
        position = add(position, scale(jerk, time**3 / 6.0))
    velocity = add(velocity, add(scale(acceleration, time), scale(jerk, 0.5 * time * time)))
    acceleration = add(acceleration, scale(jerk, time))
    ahead = setpoint._replace(position=position, velocity=velocity, acceleration=acceleration)
    return command._replace(setpoint=ahead)
