"""The sensors of SYS_STATUS, and in plain words those that an autopilot reports as not well.

PX4 gives no text where it is merely not ready; then this is all that it says.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import NamedTuple

NAMES = MappingProxyType(
    {
        1 << bit: name
        for bit, name in enumerate(
            (
                "gyroscope", "accelerometer", "compass", "barometer", "airspeed sensor",
                "GPS receiver", "optical flow", "position from outside", "range finder",
                "ground truth from outside", "control of turn rates", "control of attitude",
                "control of heading", "control of height", "control of position", "motors",
                "receiver of the transmitter", "second gyroscope", "second accelerometer",
                "second compass", "fence", "estimate of attitude and position", "terrain data",
                "reversed motors", "log", "battery", "proximity sensor", "satellite link", "",
                "obstacle avoidance", "propulsion",
            )
        )
        if name
    }
)  # fmt: skip
"""MAV_SYS_STATUS_SENSOR. Bit 28 says whether it is ready, bit 31 that there are more bits."""
WAYS_OUT = MappingProxyType(
    {
        1 << 7: "is it told poses, and set up to take them?",
        1 << 16: "is the transmitter on?",
        1 << 24: "is its memory card missing, or full?",
        1 << 25: "is it charged, and its monitor set up?",
    }
)


class Sensors(NamedTuple):
    """The sensors of SYS_STATUS, a bit each (MAV_SYS_STATUS_SENSOR)."""

    present: int
    enabled: int
    health: int

    @property
    def ill(self) -> int:
        """Those that are there and in use, and not well."""
        return self.present & self.enabled & ~self.health

    @property
    def words(self) -> str:
        """Those that are ill, by name, with what to look at where that is known; empty where all
        are well."""
        return ", ".join(_named(bit) for bit in NAMES if bit & self.ill)


def _named(bit: int) -> str:
    way_out = WAYS_OUT.get(bit)
    return NAMES[bit] if way_out is None else f"{NAMES[bit]} ({way_out})"
