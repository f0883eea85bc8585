"""Where released payloads come to rest, as a simulator knows it: told to who records, not heard by
any vehicle."""

from __future__ import annotations

from collections.abc import Sequence

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import PayloadState
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.vehicle import Vehicle

_STILL = 0.001
"""Metres by which a payload at rest moves at most between two looks."""
_LOOKS = 10
"""So many looks in a row must have found it at rest."""


class Drops:
    """The engine calls `step` twenty times a second."""

    def __init__(self, vehicles: Sequence[Vehicle], events: Events) -> None:
        self._falling = [_Drop(v, events) for v in vehicles if v.plan.payload is not None]

    def step(self) -> None:
        """Tell where payloads have come to rest since the last step."""
        for drop in self._falling:
            drop.look()


class _Drop:
    def __init__(self, vehicle: Vehicle, events: Events) -> None:
        self._vehicle, self._events = vehicle, events
        self._last: Vec3 | None = None
        self._still = 0

    def look(self) -> None:
        truth = self._vehicle.truth
        place = None if truth is None else truth.payload
        if place is None or self._vehicle.knowledge.payload.state is not PayloadState.RELEASED:
            self._last, self._still = None, 0
            return
        rests = self._last is not None and distance(place, self._last) < _STILL
        self._still = self._still + 1 if rests else 0
        self._last = place
        if self._still == _LOOKS:
            x, y, z = place
            self._events.note("payload_rested", self._vehicle.name, x=x, y=y, z=z)
