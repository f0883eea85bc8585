"""Whether the ground carries a vehicle that takes off or lands: what it does there is no error.

In a take-off the ground carries the vehicle until it is 2 cm higher than it stood. In a landing,
whose setpoint goes on below a ground that may lie anywhere, it does from when the vehicle stays
behind a sinking setpoint: 3 cm above it, with less than a quarter of its vertical speed; unless
it comes 2 cm lower again. For figures only; the failsafe and the landing itself have their own.
"""

from __future__ import annotations

from kybflow.core.signals import Setpoint
from kybflow.parts import GROUND, Leg

_LIFTED, _BEHIND = 0.02, 0.03
"""Metres."""
_SINKS, _STAYS = -0.05, 0.25
"""The vertical speed (m/s) of a setpoint that sinks; the share of it that the vehicle has."""


class GroundContact:
    """Judges one take-off or landing, the `leg`, which begins at the height `stood`, metres."""

    def __init__(self, leg: Leg, stood: float) -> None:
        self.leg, self._stood = leg, stood
        self._met: float | None = None

    def carries(self, wanted: Setpoint | None, height: float, climb: float) -> bool:
        """Return whether the ground carries the vehicle now; call it once a tick. wanted: what the
        behavior asks for, height and climb: what the vehicle does, m and m/s."""
        if self.leg.end is not GROUND:
            return self.leg.start is GROUND and height < self._stood + _LIFTED
        if self._met is not None and height < self._met - _LIFTED:
            self._met = None
        if self._met is None and wanted is not None and _leaves_behind(wanted, height, climb):
            self._met = height
        return self._met is not None


def _leaves_behind(wanted: Setpoint, height: float, climb: float) -> bool:
    """Return whether a setpoint sinks away below a vehicle that does not follow it."""
    if wanted.position is None or wanted.velocity is None:
        return False
    sinks = wanted.velocity[2]
    return sinks < _SINKS and height > wanted.position[2] + _BEHIND and climb > _STAYS * sinks
