"""Gives a rehearsal the events that a person would give.

A state whose behavior is endless waits for events, and so does a phase if all its vehicles are in
such states. When a state or phase has waited two seconds, the person gives the first of its events
not yet given to it, so that a mission that loops on a button ends at last. If everything waits, the
person also gives the events of callbacks. The person never gives events that have a scheduled time
(`--emit`), nor buttons of an input that is replayed from a file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from kybflow.core.events import Custom
from kybflow.core.signals import NS, Time
from kybflow.dsl.plan import Plan, TransitionPlan
from kybflow.parts.behavior import Behavior
from kybflow.runtime.commanding.command_queue import CommandQueue, GivenCommand
from kybflow.runtime.commanding.legal import awaited, heard_always, heard_by
from kybflow.runtime.commanding.orders import PREFIX, SCHEDULE, named
from kybflow.runtime.engine import Engine
from kybflow.runtime.vehicle.vehicle import Vehicle

REQUEST_DELAY_NS = 2 * NS


class Assumed(NamedTuple):
    """An event that the rehearsal gave for a person. waiting: the state or phase that waited for
    it."""

    seconds: float
    name: str
    waiting: str


class _Listener(NamedTuple):
    """A waiting state or phase, and the events by which a person could end it."""

    name: str
    events: tuple[str, ...]
    begun: Time


class Person:
    """An observer of the engine that acts as the person. assumed: the events given so far."""

    def __init__(self, plan: Plan, commands: CommandQueue, emitted: Iterable[str]) -> None:
        self.assumed: list[Assumed] = []
        own, given = set(awaited(plan)), set(emitted)
        self._buttons = dict(_buttons(plan))
        operators = {name for name in own if name.startswith(PREFIX)}
        self._names = (operators | set(self._buttons)) - given
        self._always = tuple(sorted(heard_always(plan) & self._names))
        self._commands = commands
        self._since: dict[str, tuple[Time, Time]] = {}
        self._given: set[tuple[str, str]] = set()

    def __call__(self, engine: Engine) -> None:
        if not self._names or not engine.flying:
            return
        now, waiting = engine.clock.now, {one.name: one for one in self._waiting(engine)}
        before = self._since
        self._since = {
            name: before[name] if before.get(name, (None,))[0] == one.begun else (one.begun, now)
            for name, one in waiting.items()
        }
        for name, one in waiting.items():
            if now - self._since[name][1] < REQUEST_DELAY_NS:
                continue
            event = next((e for e in one.events if (name, e) not in self._given), None)
            if event is not None:
                self._given.add((name, event))
                self.assumed.append(Assumed(engine.seconds(), event, name))
                if event in self._buttons:
                    engine.events.emit(Custom(event), at=self._buttons[event])
                else:
                    command = GivenCommand(named(event), SCHEDULE, name=event)
                    self._commands.scheduled.appendleft((now, command))
                return  # one event per tick, because it may change what waits

    def _waiting(self, engine: Engine) -> Iterator[_Listener]:
        resting = {v.name: v for v in engine.vehicles if _waits(v)}
        goes_on = len(resting) < len(engine.vehicles)
        for vehicle in resting.values():
            state = vehicle.runner.state
            goes_on = goes_on or not _is_stuck(state.transitions)
            events = self._of(state.transitions)
            if events:
                name = f"`{state.name}` of `{vehicle.name}`"
                yield _Listener(name, events, vehicle.runner.entered)
        for plan in engine.plan.flows:
            flow = engine.flows.running(plan.name)
            if not flow.active:
                continue
            goes_on = goes_on or not _is_stuck(flow.phase.transitions)
            events = self._of(flow.phase.transitions)
            if events and all(v in resting for v in engine.flows.driven(plan.name)):
                yield _Listener(f"`{flow.phase.name}` of `{plan.name}`", events, flow.entered)
        if self._always and not goes_on:
            yield _Listener("`on`", self._always, 0)

    def _of(self, transitions: Iterable[TransitionPlan]) -> tuple[str, ...]:
        return tuple(name for name in heard_by(transitions) if name in self._names)


def _waits(vehicle: Vehicle) -> bool:
    """Return whether a vehicle's current behavior is endless."""
    runner = vehicle.runner
    if not runner.begun:
        return False
    part = runner.state.behavior
    cls: type[Behavior[object]] = part.cls
    estimate = vehicle.estimate
    footprint = cls.footprint(part.params, None if estimate is None else estimate.position)
    return footprint is not None and footprint.is_endless


def _is_stuck(transitions: Iterable[TransitionPlan]) -> bool:
    """Return whether none of the transitions can fire by time or by a condition."""
    return all(t.implied or (t.when is None and t.after is None) for t in transitions)


def _buttons(plan: Plan) -> Iterator[tuple[str, str]]:
    """Yield (event, mission line) for each button of the inputs that a person moves."""
    for own in plan.inputs:
        if own.part.cls.real_time(own.part.params):
            buttons: Mapping[str, str] = own.button_names
            for button in buttons.values():
                yield f"{own.name}.{button}", own.at
