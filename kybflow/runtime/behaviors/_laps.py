"""Counting the laps of a closed path, and their events."""

from __future__ import annotations

from kybflow.core.events import BehaviorEvent, Emitting
from kybflow.core.signals import Done, Setpoint
from kybflow.core.units import Number

_ROUNDING = 1e-9
"""The fraction of a lap by which the end of the last lap may fall short."""


class LapCompleted(BehaviorEvent):
    """A lap is complete. `lap` is its number, from 1."""

    lap: Number


class Laps:
    """Counts laps of `length` (m or rad). next: the distance along the path at which the current
    lap ends, in the same unit."""

    def __init__(self, length: float) -> None:
        self._length = length * (1.0 - _ROUNDING)
        self._flown = 0
        self.next = self._length

    def completed(self, output: Setpoint | Done) -> Emitting:
        """Count a completed lap; return the behavior's output with the event `lap_completed`."""
        self._flown += 1
        self.next = self._length * (self._flown + 1)
        return Emitting(output, LapCompleted(lap=float(self._flown)))
