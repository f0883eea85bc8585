"""Converts commands into the fractions of AT*PCMD.

The tilt is split into forward and left relative to the command's heading; the drone applies both
relative to its own heading. With the compass both are relative to the world's x axis instead. Each
value is a fraction, -1 to 1, of a configured limit.
"""

from __future__ import annotations

from math import asin, atan2
from typing import NamedTuple

from kybflow.core.geometry import ZERO, body_z, from_heading, heading_of, rotate_back
from kybflow.core.signals import Command
from kybflow.drivers.ardrone.params import ArdroneLinkParams
from kybflow.drivers.ardrone.protocol.at import Move
from kybflow.world.vehicle_context import Airframe


class Limits(NamedTuple):
    """The limits, which a fraction of 1 commands. tilt: rad. climb: climb rate, m/s. turn: heading
    rate, rad/s."""

    tilt: float
    climb: float
    turn: float


def limits_of(params: ArdroneLinkParams, airframe: Airframe) -> Limits:
    """Return the limits to configure: the driver's parameters, or the airframe's limits by
    default."""
    p = params
    tilt = airframe.tilt if p.euler_angle_max is None else p.euler_angle_max
    climb = airframe.climb if p.control_vz_max is None else p.control_vz_max
    return Limits(tilt, climb, p.control_yaw)


def move_of(command: Command, limits: Limits, *, by_compass: bool = False) -> Move:
    """Return the move of a TILT_CLIMB command."""
    heading = heading_of(command.attitude) if command.heading is None else command.heading
    heading = 0.0 if by_compass else heading
    x, y, z = rotate_back(from_heading(heading), body_z(command.attitude))
    setpoint = command.setpoint
    climb = (ZERO if setpoint is None else setpoint.velocity or ZERO)[2]
    return Move(
        _fraction(asin(max(-1.0, min(1.0, -y))), limits.tilt),
        _fraction(-atan2(x, z), limits.tilt),
        _fraction(climb, limits.climb),
        _fraction(-command.rates[2], limits.turn),
    )


def _fraction(value: float, most: float) -> float:
    return max(-1.0, min(1.0, value / most))
