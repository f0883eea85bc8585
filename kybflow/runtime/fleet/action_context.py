"""The actions that a mission's callbacks can take on the vehicles, options, events and flows of a
run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from kybflow.core.errors import OptionRefused
from kybflow.core.events import Custom
from kybflow.dsl.plan import Values
from kybflow.parts.events import AWAITED_EVENTS, Logged
from kybflow.runtime.events import Events
from kybflow.runtime.options import Options
from kybflow.runtime.vehicle.requests import Requester, Requests

BY = "callback"
"""The name of the requester in events."""
_OPERATOR = "operator."


class RunControls(NamedTuple):
    """The parts of a run that callbacks and the operator may use.

    requests: the requests to each vehicle, by its name.
    phase: phase(flow, phase, requester, mission line) enters a phase; returns why that is refused,
    or None.
    stop: stop(reason, mission line) ends the run.
    """

    requests: Mapping[str, Requests]
    options: Options
    events: Events
    phase: Callable[[str, str, str, str], str | None]
    stop: Callable[[str, str], None]


class CallbackContext:
    """The `kybflow.parts.ActionContext` of one callback. at: the callback's mission line."""

    def __init__(self, controls: RunControls, at: str) -> None:
        self._controls, self._at = controls, at

    def switch(self, vehicle: str, state: str, values: Values = ()) -> None:
        requests = self._controls.requests[vehicle]
        requests.switch(state, Requester.CALLBACK, self._at, values=values)

    def set(self, option: str, value: Any) -> None:
        try:
            self._controls.options.set(option, value, BY, self._at)
        except OptionRefused:
            return  # `Options` has published the refusal

    def enable(self, vehicle: str, label: str, on: bool) -> None:
        self._controls.requests[vehicle].enable(label, on, BY, self._at)

    def emit(self, name: str) -> None:
        """Emit the event `name`. Raises ValueError for an event of kybflow or of the operator."""
        if name in AWAITED_EVENTS or name.startswith(_OPERATOR):
            raise ValueError(f"an action can't emit `{name}`")
        self._controls.events.emit(Custom(name), at=self._at)

    def phase(self, flow: str, phase: str) -> None:
        self._controls.phase(flow, phase, BY, self._at)

    def perform(self, vehicle: str, act: str) -> None:
        self._controls.requests[vehicle].perform(act, BY, self._at)

    def log(self, text: str) -> None:
        self._controls.events.emit(Logged(text=text), at=self._at)

    def stop(self, reason: str) -> None:
        self._controls.stop(reason, self._at)
