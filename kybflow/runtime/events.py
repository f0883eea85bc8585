"""The run's events: handed to every listener as they happen, and heard by transitions one tick
later."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from kybflow.core.errors import described
from kybflow.core.signals import Event, Time

Fields = str | float | bool | None


class Events:
    """Where events are told. `heard` holds the names of the last tick's: `NAME` for a vehicle's own
    under its name, `VEHICLE.NAME` and `any.NAME` for everybody. `unanswered` are those that no
    callback has looked at yet. A listener that raises is told no more."""

    def __init__(self, listeners: Iterable[Callable[[Event], None]] = ()) -> None:
        self.listeners = list(listeners)
        self.now: Time = 0
        self._fresh: list[Event] = []
        self.unanswered: list[Event] = []
        self._heard: dict[str, set[str]] = {}

    def tell(self, name: str, vehicle: str = "", at: str = "", **fields: Fields) -> None:
        """Something happened now. `name` is in the past tense."""
        event = Event(self.now, name, vehicle, fields, at)
        self._fresh.append(event)
        self.unanswered.append(event)
        self._hand(event)

    def note(self, name: str, vehicle: str, **fields: Fields) -> None:
        """Something happened that only a simulator knows: listeners are told, transitions don't
        hear it."""
        self._hand(Event(self.now, name, vehicle, fields))

    def _hand(self, event: Event) -> None:
        for listener in self.listeners:
            try:
                listener(event)
            except Exception as error:  # who listens must not stop who flies
                self.listeners = [other for other in self.listeners if other is not listener]
                self.tell("observer_failed", reason=described(error))

    def turn(self, now: Time) -> None:
        """A new tick begins: what was told in the last one is heard in this one."""
        self.now = now
        if self._fresh or self._heard:
            everybody = {f"{e.vehicle}.{e.name}" if e.vehicle else e.name for e in self._fresh}
            everybody |= {f"any.{e.name}" for e in self._fresh if e.vehicle}
            self._heard = {"": everybody} if everybody else {}
            for event in self._fresh:
                self._heard.setdefault(event.vehicle, set(everybody)).add(event.name)
            self._fresh = []

    def heard(self, vehicle: str) -> set[str] | frozenset[str]:
        """The names that `vehicle` hears in this tick."""
        if not self._heard:
            return _SILENCE
        return self._heard.get(vehicle) or self._heard[""]


_SILENCE: frozenset[str] = frozenset()
