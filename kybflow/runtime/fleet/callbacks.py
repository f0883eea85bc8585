"""Callbacks: what a mission does when an event is heard.

They are asked at the end of each tick, about everything that was told since the last one, in the
order in which it happened. What they ask of vehicles is decided in the next tick, and an event that
they emit is heard then: one round a tick, so that no circle of events holds up the flight.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from kybflow.core.errors import PartFailed, described
from kybflow.core.signals import NS, Event
from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import (
    ActionPlan,
    Call,
    CallbackPlan,
    Emit,
    Enable,
    EnterPhase,
    LogText,
    PartPlan,
    SetOption,
    Stop,
    Switch,
)
from kybflow.parts import Action, ActionContext
from kybflow.runtime.events import Events, Fields
from kybflow.runtime.fleet.action_context import CallbackContext, RunControls

Do = Callable[[Event], None]


class Callbacks:
    """Every callback of a plan. Raises PartFailed when an action of a package can't be made."""

    def __init__(
        self,
        plans: Sequence[CallbackPlan],
        controls: RunControls,
        conditions: Callable[[Expression], Callable[[], bool]],
    ) -> None:
        self._events = controls.events
        self._listening: dict[tuple[str, str], list[_Callback]] = {}
        for plan in plans:
            when = None if plan.when is None else conditions(plan.when)
            callback = _Callback(plan, when, CallbackContext(controls, plan.at))
            for vehicle in plan.vehicles:
                self._listening.setdefault((vehicle, plan.event), []).append(callback)

    def step(self) -> None:
        """Answer what was told since the last step."""
        if not self._events.unanswered:
            return
        events, self._events.unanswered = self._events.unanswered, []
        for event in events:
            for callback in self._listening.get((event.vehicle, event.name), ()):
                callback.answer(event, self._events)

    @property
    def pending(self) -> bool:
        """Whether something was told that the next step will answer."""
        return any((e.vehicle, e.name) in self._listening for e in self._events.unanswered)


class _Callback:
    """One entry of `on:`. An action that raises is told and left out from then on."""

    def __init__(
        self, plan: CallbackPlan, when: Callable[[], bool] | None, context: ActionContext
    ) -> None:
        self._plan, self._when = plan, when
        self._actions = [(_name(action), _bound(action, context)) for action in plan.actions]

    def answer(self, event: Event, events: Events) -> None:
        try:
            if not self._heeds(event):
                return
        except Exception as error:  # a lab's own link may show anything
            self._actions = []
            events.tell("action_failed", at=self._plan.at, action="when", reason=described(error))
        for name, do in tuple(self._actions):
            try:
                do(event)
            except Exception as error:  # a part may raise anything; it ends nothing but itself
                self._actions.remove((name, do))
                reason = described(error)
                events.tell("action_failed", at=self._plan.at, action=name, reason=reason)

    def _heeds(self, event: Event) -> bool:
        fields = event.fields
        if any(shown(fields.get(name)) != value for name, value in self._plan.fields):
            return False
        return self._when is None or self._when()


def _name(action: ActionPlan) -> str:
    return action.part.name if isinstance(action, Call) else type(action).__name__.lower()


def _bound(action: ActionPlan, context: ActionContext) -> Do:
    """The action as a function of the event that it answers."""
    match action:
        case Switch(vehicle, state):
            return lambda _: context.switch(vehicle, state)
        case SetOption(option, value):
            return lambda _: context.set(option, value)
        case Enable(vehicle, label, on):
            return lambda _: context.enable(vehicle, label, on)
        case Emit(name):
            return lambda _: context.emit(name)
        case EnterPhase(flow, phase):
            return lambda _: context.phase(flow, phase)
        case LogText(text):
            return lambda event: context.log(filled(text, event))
        case Stop(reason):
            return lambda _: context.stop(reason)
        case Call(part):
            made = _made(part)
            return lambda event: made(event, context)


def _made(part: PartPlan) -> Action[Any]:
    try:
        action: Action[Any] = part.cls(part.params)
    except Exception as error:  # a part may raise anything
        raise PartFailed(part.label, error) from error
    return action


def filled(text: str, event: Event) -> str:
    """`text` with the event's own in the place of `{vehicle}`, `{time}`, `{event}` and its
    fields."""
    fields = {name: shown(value) for name, value in event.fields.items()}
    own = {"event": event.name, "vehicle": event.vehicle, "time": f"{event.time / NS:.2f} s"}
    return text.format_map(_Known({**fields, **own}))


class _Known(dict[str, str]):
    """What an event carries; the compiler knows what it may be asked for."""

    def __missing__(self, name: str) -> str:
        return shown(None)


def shown(value: Fields) -> str:
    """A field as filters compare it and texts show it."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.4g}" if isinstance(value, float) else value
