"""A landing by the land mode of the vehicle itself, which for `land` the failsafe prefers to its
own, and for `land_blind` too where that mode comes down without a position.

The autopilot lands by what it knows; this program sends no command meanwhile and asks in every
tick. A vehicle that won't, that leaves the mode, or that has not landed within 10 s and its height
at 0.2 m/s, is landed by the state `auto_land` or `land_blind`.
"""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.errors import Refused
from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import NS, Command, Time

HANDED_OVER = Command(LEVEL, 0.0, ZERO, None)
"""What is recorded as the command meanwhile: armed, and nothing is asked of the rotors."""
TIMEOUT, SLOWEST = 10.0, 0.2
"""Seconds, and m/s: a landing may take `TIMEOUT`, and as long as its height takes at `SLOWEST`."""


class LandMode:
    """`land` is the link's; `height`: metres above where the ground is expected."""

    def __init__(self, land: Callable[[Time], bool], now: Time, height: float) -> None:
        self._land = land
        self._timeout = TIMEOUT + max(height, 0.0) / SLOWEST
        self._until = now + round(self._timeout * NS)

    def has_landed(self, now: Time) -> bool:
        """Ask for it, once a tick. Raises Refused."""
        if now > self._until:
            raise Refused(f"it has not landed within {self._timeout:.0f} s")
        return self._land(now)
