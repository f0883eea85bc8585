"""Laps of a path that closes, and the event that tells each."""

from __future__ import annotations

from kybflow.core.signals import Done, Setpoint, Told

LAP_EVENTS = {"lap_completed": ("lap",)}
"""The event of a behavior that flies laps, and what it carries: the number of the lap, from 1."""
_ROUNDING = 1e-9
"""The share of a lap by which the end of the last one may fall short."""


class Laps:
    """Counts laps of `length`, in metres or radians. next: how far along the path the next ends."""

    def __init__(self, length: float) -> None:
        self._length = length * (1.0 - _ROUNDING)
        self._flown = 0
        self.next = self._length

    def told(self, output: Setpoint | Done) -> Told:
        """Return the update of the tick in which a lap ends, with the event `lap_completed`."""
        self._flown += 1
        self.next = self._length * (self._flown + 1)
        return Told(output, "lap_completed", {"lap": float(self._flown)})
