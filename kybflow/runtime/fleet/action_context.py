"""What a mission's callbacks may do to the vehicles, options, events and flows of a run."""

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
"""The requester, as it appears in events."""
_OPERATOR = "operator."


class RunControls(NamedTuple):
    """The parts of a run that callbacks may use. phase(flow, phase, requester, mission line) enters
    a phase and returns why it can't; stop(reason, mission line) ends the run."""

    requests: Mapping[str, Requests]
    options: Options
    events: Events
    phase: Callable[[str, str, str, str], str | None]
    stop: Callable[[str, str], None]


class CallbackContext:
    """The context (`kybflow.parts.ActionContext`) of the callback at one line of the mission."""

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
        """Raises ValueError for the events of kybflow and of the operator."""
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
