"""Callbacks: the actions of a mission on events, and on conditions that begin to hold.

At the end of each tick, callbacks handle all events since the previous tick, in order. Vehicles
answer the callbacks' requests in the next tick, and the events that result are handled in that tick
too. There is only one round a tick, so that a loop of events can't block the flight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from kybflow.core.errors import OptionRefused, PartFailed, described, traceback_of
from kybflow.core.events import Custom
from kybflow.core.signals import NS, Event, FieldValue, Time
from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import (
    ActionPlan,
    Call,
    CallbackPlan,
    Emit,
    Enable,
    EnterPhase,
    LogText,
    Perform,
    SetOption,
    Stop,
    Switch,
    Values,
)
from kybflow.parts import Action, ActionContext
from kybflow.parts.events import AWAITED_EVENTS, ActionFailed, Logged
from kybflow.runtime.commanding.orders import PREFIX
from kybflow.runtime.events import Events
from kybflow.runtime.options import Options
from kybflow.runtime.vehicle.requests import Requester, Requests

BY = "callback"
"""The name of the requester in events."""


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
        if name in AWAITED_EVENTS or name.startswith(PREFIX):
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


Do = Callable[[Event], None]
_NO_EVENT = Event(0, "", "", {})
"""The event that the actions of a callback on a condition receive."""


class Callbacks:
    """The callbacks of a plan. Raises PartFailed if a package's action can't be constructed."""

    def __init__(
        self,
        plans: Sequence[CallbackPlan],
        controls: RunControls,
        conditions: Callable[[Expression], Callable[[], bool]],
    ) -> None:
        self._events = controls.events
        self._listening: dict[tuple[str, str], list[_Callback]] = {}
        self.watching: list[_Watch] = []
        for plan in plans:
            when = None if plan.when is None else conditions(plan.when)
            callback = _Callback(plan, when, CallbackContext(controls, plan.at))
            if not plan.event:
                self.watching.append(_Watch(callback, round(plan.hold * NS)))
            for vehicle in plan.vehicles:
                self._listening.setdefault((vehicle, plan.event), []).append(callback)

    def step(self) -> None:
        """Carry out the callbacks on all events since the last step."""
        for event in self._events.take_unanswered():
            for callback in self._listening.get((event.vehicle, event.name), ()):
                callback.answer(event, self._events)

    def watch(self) -> None:
        """Carry out the callbacks whose conditions have begun to hold."""
        for watched in self.watching:
            watched.look(self._events)

    @property
    def pending(self) -> bool:
        """Whether a callback waits for an event that the next step will handle."""
        return any((e.vehicle, e.name) in self._listening for e in self._events.unanswered)


class _Watch:
    """A callback on a condition. It is carried out when the condition has held for `hold`, and
    again only after the condition has ceased to hold."""

    def __init__(self, callback: _Callback, hold: Time) -> None:
        self._callback, self._hold = callback, hold
        self._since: Time | None = None
        self._answered = False

    def look(self, events: Events) -> None:
        if not self._callback.matches(_NO_EVENT, events):
            self._since, self._answered = None, False
            return
        if self._since is None:
            self._since = events.now
        if not self._answered and events.now - self._since >= self._hold:
            self._answered = True
            self._callback.act(_NO_EVENT._replace(time=events.now), events)


class _Callback:
    """One entry of `on:` in a mission. An action that raises is reported and removed."""

    def __init__(
        self, plan: CallbackPlan, when: Callable[[], bool] | None, context: ActionContext
    ) -> None:
        self._plan, self._when = plan, when
        self._actions = [
            (a.part.name if isinstance(a, Call) else type(a).__name__.lower(), _bound(a, context))
            for a in plan.actions
        ]

    def answer(self, event: Event, events: Events) -> None:
        if self.matches(event, events):
            self.act(event, events)

    def act(self, event: Event, events: Events) -> None:
        """Carry out the actions, without checking whether the event matches."""
        for name, do in tuple(self._actions):
            try:
                do(event)
            except Exception as error:  # a part may raise anything; only it is removed
                self._actions.remove((name, do))
                failed = ActionFailed(
                    action=name, reason=described(error), traceback=traceback_of(error)
                )
                events.emit(failed, at=self._plan.at)

    def matches(self, event: Event, events: Events) -> bool:
        """Return whether the event has the required fields and the condition holds. A condition
        that raises is reported, and disables the callback."""
        fields = event.fields
        if any(shown(fields.get(name)) != value for name, value in self._plan.fields):
            return False
        try:
            return self._when is None or self._when()
        except Exception as error:  # a lab's own link may show anything
            self._actions, self._when = [], None
            failed = ActionFailed(action="when", reason=described(error))
            events.emit(failed, at=self._plan.at)
            return False


def _bound(action: ActionPlan, context: ActionContext) -> Do:
    """Return a function that carries out the action for an event."""
    match action:
        case Switch() | Enable() | Perform():
            return _of_vehicle(action, context)
        case SetOption(option, value):
            return lambda _: context.set(option, value)
        case Emit(name):
            return lambda _: context.emit(name)
        case EnterPhase(flow, phase):
            return lambda _: context.phase(flow, phase)
        case LogText(text):
            return lambda event: context.log(filled(text, event))
        case Stop(reason):
            return lambda _: context.stop(reason)
        case Call(part):
            try:
                made: Action[Any] = part.cls(part.params)
            except Exception as error:  # a part may raise anything
                raise PartFailed(part.label, error) from error
            return lambda event: made(event, context)


def _of_vehicle(action: Switch | Enable | Perform, context: ActionContext) -> Do:
    match action:
        case Switch(vehicle, state, values):
            return lambda _: context.switch(vehicle, state, values)
        case Enable(vehicle, label, on):
            return lambda _: context.enable(vehicle, label, on)
        case Perform(vehicle, act):
            return lambda _: context.perform(vehicle, act)


def filled(text: str, event: Event) -> str:
    """Return `text` with `{vehicle}`, `{time}`, `{event}` and the event's fields filled in."""
    fields = {name: shown(value) for name, value in event.fields.items()}
    own = {"event": event.name, "vehicle": event.vehicle, "time": f"{event.time / NS:.2f} s"}
    return text.format_map(_Known({**fields, **own}))


class _Known(dict[str, str]):
    """The values of an event by name. A name that the event lacks has the value `none`."""

    def __missing__(self, name: str) -> str:
        return shown(None)


def shown(value: FieldValue) -> str:
    """Return a field's value as the text that filters compare and that `log` shows."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.4g}" if isinstance(value, float) else value
