"""Gives a rehearsal the events that a person would give.

An event is given two seconds after it is waited for: something that can't go on by itself hears it.
That is a state whose behavior never ends by itself, or a phase all of whose vehicles are in such
states. Of several events that one thing hears, the first is given that was not given there before,
so that a mission that goes round and round on a button comes out in the end. Where nothing in the
mission goes on by itself, that is also true of what callbacks hear. An event that was given a time
(`--emit`) is never assumed; nor are the buttons of an input that a file moves.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from kybflow.core.events import Custom
from kybflow.core.signals import NS, Time
from kybflow.dsl.plan import Plan, TransitionPlan
from kybflow.parts.behavior import Behavior
from kybflow.runtime.commanding.awaited import awaited, heard_always, heard_by
from kybflow.runtime.commanding.command_queue import CommandQueue, GivenCommand
from kybflow.runtime.commanding.lease import SCHEDULE
from kybflow.runtime.commanding.orders import PREFIX, named
from kybflow.runtime.engine import Engine
from kybflow.runtime.vehicle.vehicle import Vehicle

AFTER = 2 * NS


class Assumed(NamedTuple):
    """An event that was assumed: when, and what waited for it."""

    seconds: float
    name: str
    waiting: str


class _Listener(NamedTuple):
    """Something that waits: what it is called, and the person's events that it hears."""

    name: str
    events: tuple[str, ...]
    begun: Time


class Person:
    """An observer of the engine. assumed: the events given so far."""

    def __init__(self, plan: Plan, commands: CommandQueue, emitted: Iterable[str]) -> None:
        self.assumed: list[Assumed] = []
        own, given = set(awaited(plan)), set(emitted)
        self._buttons = dict(_buttons(plan))
        operators = {name for name in own if name.startswith(PREFIX)}
        self._names = (operators | set(self._buttons)) - given
        self._always = tuple(sorted(heard_always(plan) & self._names))
        self._commands = commands
        self._since: dict[str, tuple[Time, Time]] = {}
        self._told: set[tuple[str, str]] = set()

    def __call__(self, engine: Engine) -> None:
        if not self._names or not engine.flying:
            return
        now, waiting = engine.clock.now, {one.name: one for one in self._waiting(engine)}
        self._since = {
            name: (one.begun, since if since is not None else now)
            for name, one in waiting.items()
            for since in (self._kept(name, one.begun),)
        }
        for name, one in waiting.items():
            if now - self._since[name][1] < AFTER:
                continue
            event = next((e for e in one.events if (name, e) not in self._told), None)
            if event is not None:
                self._told.add((name, event))
                self._give(event, name, engine)
                return  # what it changes is seen first

    def _kept(self, name: str, begun: Time) -> Time | None:
        """Since when something has waited that began at `begun`; None where it is new."""
        before, since = self._since.get(name, (None, 0))
        return since if before == begun else None

    def _waiting(self, engine: Engine) -> Iterator[_Listener]:
        resting = {v.name: v for v in engine.vehicles if waits(v)}
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

    def _give(self, name: str, waiting: str, engine: Engine) -> None:
        self.assumed.append(Assumed(engine.seconds(), name, waiting))
        if name in self._buttons:
            engine.events.emit(Custom(name), at=self._buttons[name])
        else:
            command = GivenCommand(named(name), SCHEDULE, name=name)
            self._commands.scheduled.appendleft((engine.clock.now, command))


def waits(vehicle: Vehicle) -> bool:
    """Return whether a vehicle is in a behavior that does not end by itself."""
    runner = vehicle.runner
    if not runner.begun:
        return False
    part = runner.state.behavior
    cls: type[Behavior[object]] = part.cls
    estimate = vehicle.estimate
    told = cls.footprint(part.params, None if estimate is None else estimate.position)
    return told is not None and told.is_endless


def _is_stuck(transitions: Iterable[TransitionPlan]) -> bool:
    """Whether none of these leads on by time or by what is true."""
    return all(t.implied or (t.when is None and t.after is None) for t in transitions)


def _buttons(plan: Plan) -> Iterator[tuple[str, str]]:
    """Each button of an input that a person moves, as the event that it is, with its line."""
    for own in plan.inputs:
        if own.part.cls.real_time(own.part.params):
            buttons: Mapping[str, str] = own.button_names
            for button in buttons.values():
                yield f"{own.name}.{button}", own.at
