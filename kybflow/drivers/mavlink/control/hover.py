"""Which share of the throttle holds the vehicle in the air, for commands in newtons.

First the autopilot's own parameter; then, as it hovers under set-points of position or of
acceleration, what its attitude controller asks for in truth, averaged slowly.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite

from kybflow.core.geometry import norm
from kybflow.core.signals import NS, Command, CommandKind, Odometry, Time
from kybflow.drivers.mavlink.protocol.codec import Throttle

USUAL = 0.5
LEAST, MOST = 0.1, 0.9
SLOW = 5.0
"""Seconds over which it is averaged."""
STILL = 0.3
"""Metres a second below which it hovers."""

FLIES_ITSELF = frozenset({CommandKind.POSITION, CommandKind.ACCELERATION})
"""Commands under which the thrust is its own."""


class Hover:
    """parameter: the autopilot's name for it. newtons: what the vehicle weighs. raised: whether the
    autopilot itself asks for more where it leans."""

    def __init__(self, parameter: str, newtons: float, raised: bool) -> None:
        self._parameter, self._newtons, self._raised = parameter, newtons, raised
        self._share: float | None = None
        self._last: Time | None = None

    def throttle(self, values: Mapping[str, float]) -> Throttle:
        """values: the parameters that the autopilot has told."""
        share = self._share or values.get(self._parameter, USUAL)
        share = share if isfinite(share) else USUAL
        return Throttle(min(max(share, LEAST), MOST), self._newtons, self._raised)

    def learn(
        self, asked: float | None, command: Command, odometry: Odometry | None,
        values: Mapping[str, float], now: Time,
    ) -> None:  # fmt: skip
        """asked: the throttle that its controller asks for, 0 to 1, in the air."""
        still = odometry is not None and norm(odometry.velocity) < STILL
        if asked is None or not still or command.kind not in FLIES_ITSELF:
            self._last = None
            return
        if self._last is not None:
            dt = (now - self._last) / NS
            share = self.throttle(values).hover
            self._share = share + (asked - share) * dt / (SLOW + dt)
        self._last = now
