"""The run's events: listeners receive them at once, transitions one tick later."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from kybflow.core.errors import described
from kybflow.core.signals import Event, Time

Fields = str | float | bool | None


class Events:
    """Publishes events. `unanswered` holds those that no callback has handled yet. A listener that
    raises is removed."""

    def __init__(self, listeners: Iterable[Callable[[Event], None]] = ()) -> None:
        self.listeners = list(listeners)
        self.now: Time = 0
        self._fresh: list[Event] = []
        self.unanswered: list[Event] = []
        self._heard: dict[str, set[str]] = {}

    def tell(self, name: str, vehicle: str = "", at: str = "", **fields: Fields) -> None:
        """Publish an event that happened now. `name` is in the past tense."""
        event = Event(self.now, name, vehicle, fields, at)
        self._fresh.append(event)
        self.unanswered.append(event)
        self._hand(event)

    def note(self, name: str, vehicle: str, **fields: Fields) -> None:
        """Publish an event that only a simulator knows: to listeners, not to transitions or
        callbacks."""
        self._hand(Event(self.now, name, vehicle, fields))

    def _hand(self, event: Event) -> None:
        for listener in self.listeners:
            try:
                listener(event)
            except Exception as error:  # a listener must not stop the flight
                self.listeners = [other for other in self.listeners if other is not listener]
                self.tell("observer_failed", reason=described(error))

    def turn(self, now: Time) -> None:
        """Begin a tick, in which transitions hear the events of the last one."""
        self.now = now
        if self._fresh or self._heard:
            everybody = {f"{e.vehicle}.{e.name}" if e.vehicle else e.name for e in self._fresh}
            everybody |= {f"any.{e.name}" for e in self._fresh if e.vehicle}
            self._heard = {"": everybody} if everybody else {}
            for event in self._fresh:
                self._heard.setdefault(event.vehicle, set(everybody)).add(event.name)
            self._fresh = []

    def heard(self, vehicle: str) -> set[str] | frozenset[str]:
        """Return the names that `vehicle` hears in this tick: `NAME` for its own events,
        `VEHICLE.NAME` and `any.NAME` for those of every vehicle."""
        if not self._heard:
            return _SILENCE
        return self._heard.get(vehicle) or self._heard[""]


_SILENCE: frozenset[str] = frozenset()
