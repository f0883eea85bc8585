"""What an emulated drone performs by itself; it takes no moves meanwhile.

The SDK names the axis of an animation and how long it lasts, no more: here the drone hovers and
rocks or turns about that axis, and turns no flip over. To calibrate its magnetometer it turns once.
"""

from __future__ import annotations

from math import pi, sin
from typing import NamedTuple

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.control.acts import FLIGHTS

ROCKS, TURNS = 0.15, 1.0
"""The tilt, rad, once a second to either side, and the heading rate, rad/s, clockwise."""
SHORTEST: Time = NS
"""What takes as long as it does, as a flip."""


class Performance(NamedTuple):
    """roll, pitch: amplitudes, rad. turn: heading rate, rad/s."""

    begins: Time
    ends: Time
    roll: float
    pitch: float
    turn: float

    def tilts(self, now: Time) -> tuple[float, float]:
        """The roll and pitch of this time, rad."""
        phase = sin(2.0 * pi * (now - self.begins) / NS)
        return self.roll * phase, self.pitch * phase


def animation(value: str, now: Time) -> Performance:
    """The one that `control:flight_anim` asks for: its number and its milliseconds. Raises
    ValueError."""
    number, milliseconds = map(int, value.split(","))
    if not 0 <= number < len(FLIGHTS):
        raise ValueError("no animation has this number")
    name = [*FLIGHTS][number]
    lasts = max(SHORTEST, milliseconds * NS // 1000)
    roll, pitch = ROCKS * ("roll" in name), ROCKS * ("pitch" in name)
    return Performance(now, now + lasts, roll, pitch, -TURNS * ("turn" in name or "yaw" in name))


def calibration(now: Time) -> Performance:
    """Once around."""
    return Performance(now, now + round(2.0 * pi / TURNS * NS), 0.0, 0.0, -TURNS)
