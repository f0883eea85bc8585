"""What the callbacks of a mission may do, on the vehicles, options, events and flows of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from kybflow.core.errors import OptionRefused
from kybflow.parts.observables import EVENTS
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.requests import Requester

BY = "callback"
"""Who asks, as events say it."""
_OPERATOR = "operator."


class Asked(Protocol):
    """A vehicle, as callbacks see it."""

    def switch(self, state: str, by: Requester, at: str = "") -> None:
        """Ask it to enter a state."""

    def enable(self, label: str, on: bool, by: str, at: str = "") -> None:
        """Ask it to use a processor again, or no more."""


class Settings(Protocol):
    """The options, as callbacks see them."""

    def set(self, name: str, value: Any, by: str, at: str = "") -> None:
        """Ask for a change. Raises OptionRefused, which is told already."""


class Reach(NamedTuple):
    """What of a run is in reach of callbacks. phase: called with flow, phase, who asks and the
    mission line. stop: with a reason and the mission line."""

    vehicles: Mapping[str, Asked]
    options: Settings
    events: Events
    phase: Callable[[str, str, str, str], None]
    stop: Callable[[str, str], None]


class CallbackContext:
    """The context (`kybflow.parts.ActionContext`) of the callback at one line of the mission."""

    def __init__(self, reach: Reach, at: str) -> None:
        self._reach, self._at = reach, at

    def switch(self, vehicle: str, state: str) -> None:
        self._reach.vehicles[vehicle].switch(state, Requester.CALLBACK, self._at)

    def set(self, option: str, value: Any) -> None:
        try:
            self._reach.options.set(option, value, BY, self._at)
        except OptionRefused:
            return  # it is told

    def enable(self, vehicle: str, label: str, on: bool) -> None:
        self._reach.vehicles[vehicle].enable(label, on, BY, self._at)

    def emit(self, name: str) -> None:
        """See `ActionContext.emit`."""
        if name in EVENTS or name.startswith(_OPERATOR):
            raise ValueError(f"`{name}` is not an action's to tell")
        self._reach.events.tell(name, at=self._at)

    def phase(self, flow: str, phase: str) -> None:
        self._reach.phase(flow, phase, BY, self._at)

    def log(self, text: str) -> None:
        self._reach.events.tell("logged", at=self._at, text=text)

    def stop(self, reason: str) -> None:
        self._reach.stop(reason, self._at)
