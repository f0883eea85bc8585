"""Laps of a closed path, and their events."""

from __future__ import annotations

from kybflow.core.events import BehaviorEvent, Emitting
from kybflow.core.signals import Done, Setpoint
from kybflow.core.units import Number

_ROUNDING = 1e-9
"""The share of a lap by which the end of the last one may fall short."""


class LapCompleted(BehaviorEvent):
    """A lap is complete. `lap` is its number, from 1."""

    lap: Number


class Laps:
    """Counts laps of `length`, in metres or radians. next: how far along the path the next ends."""

    def __init__(self, length: float) -> None:
        self._length = length * (1.0 - _ROUNDING)
        self._flown = 0
        self.next = self._length

    def completed(self, output: Setpoint | Done) -> Emitting:
        """Return the update of the tick in which a lap ends, with its event."""
        self._flown += 1
        self.next = self._length * (self._flown + 1)
        return Emitting(output, LapCompleted(lap=float(self._flown)))
