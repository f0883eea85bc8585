"""What the callbacks of a mission may do, on the vehicles, options, events and flows of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from kybflow.core.errors import OptionRefused
from kybflow.parts.observables import EVENTS
from kybflow.runtime.events import Events
from kybflow.runtime.options import Options
from kybflow.runtime.vehicle.requests import Requester, Requests

BY = "callback"
"""Who asks, as events say it."""
_OPERATOR = "operator."


class RunControls(NamedTuple):
    """What callbacks may do to a run. phase: called with flow, phase, who asks and the mission
    line. stop: called with a reason and the mission line."""

    requests: Mapping[str, Requests]
    options: Options
    events: Events
    phase: Callable[[str, str, str, str], None]
    stop: Callable[[str, str], None]


class CallbackContext:
    """The context (`kybflow.parts.ActionContext`) of the callback at one line of the mission."""

    def __init__(self, controls: RunControls, at: str) -> None:
        self._controls, self._at = controls, at

    def switch(self, vehicle: str, state: str) -> None:
        self._controls.requests[vehicle].switch(state, Requester.CALLBACK, self._at)

    def set(self, option: str, value: Any) -> None:
        try:
            self._controls.options.set(option, value, BY, self._at)
        except OptionRefused:
            return  # it is told

    def enable(self, vehicle: str, label: str, on: bool) -> None:
        self._controls.requests[vehicle].enable(label, on, BY, self._at)

    def emit(self, name: str) -> None:
        """See `ActionContext.emit`."""
        if name in EVENTS or name.startswith(_OPERATOR):
            raise ValueError(f"`{name}` is not an action's to tell")
        self._controls.events.tell(name, at=self._at)

    def phase(self, flow: str, phase: str) -> None:
        self._controls.phase(flow, phase, BY, self._at)

    def log(self, text: str) -> None:
        self._controls.events.tell("logged", at=self._at, text=text)

    def stop(self, reason: str) -> None:
        self._controls.stop(reason, self._at)
