"""Collisions, as a simulator knows them: told to who records, not heard by any vehicle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from kybflow.parts import Link
from kybflow.parts.link import ReportsCollisions
from kybflow.runtime.events import Events


class Collisions:
    """The engine calls `step` twenty times a second. `first` says what ran into what first, None
    while nothing did; a run with a collision has not ended as it should."""

    def __init__(self, links: Mapping[str, Link], events: Events) -> None:
        self.first: str | None = None
        reporting = [(n, link) for n, link in links.items() if isinstance(link, ReportsCollisions)]
        self._links, self._events = tuple(reporting), events

    def step(self) -> None:
        """Tell what vehicles ran into since the last step."""
        for name, link in self._links:
            for other in self._reported(link):
                self.first = self.first or f"`{name}` ran into `{other}`"
                self._events.note("collided", name, into=other)

    def _reported(self, link: ReportsCollisions) -> Sequence[str]:
        try:
            return link.collisions()
        except Exception:  # who looks on must not stop who flies
            self._links = tuple(other for other in self._links if other[1] is not link)
            return ()
