"""The hover throttle, which converts newtons to throttle.

At first it is the autopilot's own parameter; then, while the vehicle hovers under position or
acceleration setpoints, the slowly averaged throttle of its attitude controller."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from types import MappingProxyType

from kybflow.core.geometry import norm
from kybflow.core.signals import NS, Command, CommandKind, Odometry, Time
from kybflow.drivers.mavlink.protocol.codec import Throttle

STREAMS = MappingProxyType({"ATTITUDE_TARGET": 10.0})
"""The stream from which `HoverThrottle` learns, Hz."""
USUAL_THROTTLE = 0.5
MIN_SHARE, MAX_SHARE = 0.1, 0.9
AVERAGING_S = 5.0
"""The time constant of the average, seconds."""
HOVER_SPEED = 0.3
"""Below this speed, m/s, the vehicle counts as hovering."""

THRUST_BY_AUTOPILOT = frozenset({CommandKind.POSITION, CommandKind.ACCELERATION})
"""Kinds of commands under which the autopilot itself sets the thrust."""


class HoverThrottle:
    """The hover throttle of one vehicle.

    parameter: the autopilot's parameter that holds it.
    newtons: the vehicle's weight, N.
    raised: whether the autopilot itself raises the thrust with the tilt."""

    def __init__(self, parameter: str, newtons: float, raised: bool) -> None:
        self._parameter, self._newtons, self._raised = parameter, newtons, raised
        self._share: float | None = None
        self._last: Time | None = None

    def throttle(self, values: Mapping[str, float]) -> Throttle:
        """Return the conversion from thrust to throttle. values: the parameters that were read."""
        share = self._share or values.get(self._parameter, USUAL_THROTTLE)
        share = share if isfinite(share) else USUAL_THROTTLE
        return Throttle(min(max(share, MIN_SHARE), MAX_SHARE), self._newtons, self._raised)

    def learn(
        self, asked: float | None, command: Command, odometry: Odometry | None,
        values: Mapping[str, float], now: Time,
    ) -> None:  # fmt: skip
        """Learn from one tick of hovering. asked: the throttle that the attitude controller
        commands, 0 to 1; None while the vehicle is not in the air."""
        still = odometry is not None and norm(odometry.velocity) < HOVER_SPEED
        if asked is None or not still or command.kind not in THRUST_BY_AUTOPILOT:
            self._last = None
            return
        if self._last is not None:
            dt = (now - self._last) / NS
            share = self.throttle(values).hover
            self._share = share + (asked - share) * dt / (AVERAGING_S + dt)
        self._last = now
