"""Landing by the vehicle's own land mode, which the failsafe prefers for the reaction `land`, and
for `land_blind` where the mode needs no position.

The autopilot lands by its own estimate; the runtime sends no command meanwhile and requests the
mode in every tick. If the vehicle refuses, leaves the mode, or has not landed in time (10 s plus
its height at 0.2 m/s), the state `auto_land` or `land_blind` lands it.
"""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.errors import Refused
from kybflow.core.signals import NS, Time

TIMEOUT, SLOWEST = 10.0, 0.2
"""Seconds, and m/s: a landing may take `TIMEOUT` plus the height divided by `SLOWEST`."""


class LandMode:
    """land: the link's method. height: metres above the expected ground."""

    def __init__(self, land: Callable[[Time], bool], now: Time, height: float) -> None:
        self._land = land
        self._timeout = TIMEOUT + max(height, 0.0) / SLOWEST
        self._until = now + round(self._timeout * NS)

    def has_landed(self, now: Time) -> bool:
        """Request the land mode; return whether the vehicle has landed. Called once a tick. Raises
        Refused."""
        if now > self._until:
            raise Refused(f"it has not landed within {self._timeout:.0f} s")
        return self._land(now)
