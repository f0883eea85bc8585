"""Publishes what only a simulator knows: collisions, and where released payloads come to rest.

Listeners such as a recording receive these events; vehicles, flows and callbacks don't.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import PayloadState
from kybflow.parts import Link
from kybflow.parts.link import ReportsCollisions
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.vehicle import Vehicle

_STILL = 0.001
"""Metres that a payload at rest moves at most between two steps."""
_STEPS = 10
"""Steps in a row that must find a payload at rest."""


class Collisions:
    """Publishes collisions. The engine calls `step` twenty times a second. `first` describes the
    first collision, None without one; a collision fails the run."""

    def __init__(self, links: Mapping[str, Link], events: Events) -> None:
        self.first: str | None = None
        reporting = [(n, link) for n, link in links.items() if isinstance(link, ReportsCollisions)]
        self._links, self._events = tuple(reporting), events

    def step(self) -> None:
        """Publish the collisions since the last step."""
        for name, link in self._links:
            for other in self._reported(link):
                self.first = self.first or f"`{name}` ran into `{other}`"
                self._events.note("collided", name, into=other)

    def _reported(self, link: ReportsCollisions) -> Sequence[str]:
        try:
            return link.collisions()
        except Exception:  # reporting must not stop the flight
            self._links = tuple(other for other in self._links if other[1] is not link)
            return ()


class PayloadDrops:
    """Publishes where payloads come to rest. The engine calls `step` twenty times a second."""

    def __init__(self, vehicles: Sequence[Vehicle], events: Events) -> None:
        self._falling = [_PayloadDrop(v, events) for v in vehicles if v.plan.payload is not None]

    def step(self) -> None:
        """Publish the payloads that came to rest in this step."""
        for drop in self._falling:
            drop.look()


class _PayloadDrop:
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
        if self._still == _STEPS:
            x, y, z = place
            self._events.note("payload_rested", self._vehicle.name, x=x, y=y, z=z)
