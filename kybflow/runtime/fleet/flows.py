"""Flows: phases over several vehicles, stepped once a tick after every vehicle has acted.

Each flow has a state machine, whose states are its phases. On entry a phase gives vehicles to other
flows, sets options and asks vehicles to enter states, which they decide on in the next tick. One
flow at a time drives a vehicle: requests of another are refused with an event. If a phase lets its
vehicles arrive in turns, each is asked once the one before has left the requested state, and has
landed if the failsafe lands it; if together, their behaviors begin at a common pace. A flow that
ends returns the vehicles that it was given. Its time stands still while a vehicle that it drives is
paused. When a person lands every vehicle, every flow ends.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from collections.abc import Set as AbstractSet
from typing import Any, NamedTuple, Protocol

from kybflow.core.errors import OptionRefused, described
from kybflow.core.events import Custom
from kybflow.core.signals import NS, Time
from kybflow.dsl.expressions import Expression
from kybflow.dsl.machine import Exit, FlowMachine
from kybflow.dsl.plan import END, FlowPlan, PhasePlan, Plan
from kybflow.flight.profiles import Pace
from kybflow.parts.events import (
    DriverChanged,
    FlowEnded,
    FlowFailed,
    GiveRefused,
    PhaseEnded,
    PhaseRefused,
    PhaseStarted,
    SwitchRefused,
)
from kybflow.parts.observables import is_in
from kybflow.runtime.events import Events
from kybflow.runtime.scores import rounded
from kybflow.runtime.vehicle.requests import Requester, Requests

Conditions = Callable[[Expression], Callable[[], bool]]
_NOTHING: frozenset[str] = frozenset()


class Driven(Protocol):
    """A vehicle, as a flow sees it."""

    name: str

    @property
    def state(self) -> str:
        """The name of the state that it is in."""

    @property
    def requests(self) -> Requests:
        """The requests that the flow may make."""


class FlowOptions(Protocol):
    """The options, as a flow sees them."""

    def set(self, name: str, value: Any, by: str, at: str = "") -> None:
        """Ask for a change. Raises OptionRefused after the event `option_refused`."""


class PhaseVisit(NamedTuple):
    """One time that a phase was entered; `ended` is next, within, done, asked, operator, failed or
    run_ended."""

    name: str
    start_s: float
    end_s: float | None = None
    ended: str | None = None


class RunningFlow:
    """One flow: its machine, when it entered its phase, and the phases that it has been in.

    unpaced: whether its vehicles arrive together and begin in this tick. turn: the vehicle whose
    turn it is. waiting: those whose turn comes. missed: the events that were emitted while a turn
    passed.
    """

    def __init__(self, plan: FlowPlan, machine: FlowMachine) -> None:
        self.plan, self.machine = plan, machine
        self.entered: Time = 0
        self.visits: list[PhaseVisit] = []
        self.unpaced = False
        self.turn = ""
        self.waiting: deque[str] = deque()
        self.missed: AbstractSet[str] = _NOTHING

    @property
    def active(self) -> bool:
        """Whether the flow is in a phase: it has begun and not ended."""
        return self.machine.state != END

    @property
    def phase(self) -> PhasePlan:
        return self.plan.phases[self.machine.state]

    def arrived(self, now: Time) -> None:
        self.entered = now
        self.unpaced = self.phase.arrive == "together"
        self.visits.append(PhaseVisit(self.phase.name, rounded(now / NS)))

    def paced(self) -> None:
        """Note that the vehicles that begin together have their common pace."""
        self.unpaced = False

    def next_turn(self) -> str:
        """Pass the turn to the next vehicle that waits; return its name."""
        self.turn = self.waiting.popleft()
        return self.turn

    def keep_for_later(self, heard: AbstractSet[str]) -> None:
        """Keep the events of a tick in which the phase is not left."""
        self.missed |= heard

    def heard_with_missed(self, heard: AbstractSet[str]) -> AbstractSet[str]:
        """Return the events of a tick and those that were kept before."""
        missed, self.missed = self.missed, _NOTHING
        return heard | missed

    def is_in_its_state(self, vehicle: str, state: str) -> bool:
        """Return whether a vehicle in `state` does what the phase requested."""
        request = self.phase.run[vehicle]
        return is_in(state, request.chain or request.state)

    def left(self, how: str, now: Time) -> None:
        self.visits[-1] = self.visits[-1]._replace(end_s=rounded(now / NS), ended=how)
        self.waiting.clear()
        self.missed = _NOTHING

    def wait(self, dt: float) -> None:
        """Let a tick of `dt` seconds pass in which the phase's time stands still."""
        self.entered += round(dt * NS)


class Flows:
    """The flows of a plan. ended: none of them will request anything by itself any more."""

    def __init__(
        self,
        plan: Plan,
        vehicles: Sequence[Driven],
        conditions: Conditions,
        events: Events,
        options: FlowOptions,
    ) -> None:
        self._vehicles = {vehicle.name: vehicle for vehicle in vehicles}
        self._events, self._options = events, options
        self._flows = {flow.name: self._running(flow, conditions) for flow in plan.flows}
        self._drivers: dict[str, list[str]] = {}
        for flow in plan.flows:
            for vehicle in flow.vehicles:
                self._drivers[vehicle] = [flow.name]
        self._begun = not plan.flows

    @property
    def ended(self) -> bool:
        return self._begun and not any(flow.active for flow in self._flows.values())

    def driver(self, vehicle: str) -> str | None:
        """The flow that drives a vehicle now."""
        drivers = self._drivers.get(vehicle)
        return drivers[-1] if drivers else None

    def step(self, now: Time, dt: float) -> None:
        """One period of every flow."""
        if not self._begun:
            self._begin()
            return
        for flow in self._flows.values():
            if not flow.active or flow.entered == now:
                continue  # vehicles learn what a phase asks of them in the next tick
            self._guarded(flow, now, dt)

    def enter(self, flow: str, phase: str, by: str, at: str = "") -> str | None:
        """Enter a phase that a callback or a person requests. A flow that waits for vehicles and
        has none refuses with an event; return why."""
        reason = self.objection(flow)
        if reason is None:
            self._flows[flow].machine.switch(phase, at)
        else:
            self._events.emit(PhaseRefused(flow=flow, phase=phase, by=by, reason=reason), at=at)
        return reason

    def objection(self, flow: str) -> str | None:
        """Return why no phase of a flow can be entered now, None if each can."""
        running = self._flows[flow]
        if running.active or not running.plan.waits:
            return None
        return f"no flow has given `{flow}` a vehicle"

    def running(self, flow: str) -> RunningFlow:
        """Return a flow."""
        return self._flows[flow]

    def driven(self, flow: str) -> list[str]:
        """Return the vehicles that a flow drives now."""
        return [v for v, drivers in self._drivers.items() if drivers[-1] == flow]

    def give_up(self) -> None:
        """End every flow, because a person lands every vehicle: none may start it again."""
        self._begun = True
        for flow in self._flows.values():
            if flow.active:
                flow.machine.end("operator")

    def close(self, now: Time) -> None:
        """End the visits that still last, because the run is over."""
        for flow in self._flows.values():
            if flow.active:
                flow.left("run_ended", now)

    def record(self) -> dict[str, Any]:
        """Return the flows as they stand in `summary.json`."""
        return {
            name: {"phases": [visit._asdict() for visit in flow.visits]}
            for name, flow in self._flows.items()
        }

    def _running(self, plan: FlowPlan, conditions: Conditions) -> RunningFlow:
        flow: RunningFlow
        machine = FlowMachine(
            plan,
            conditions,
            on_enter=lambda phase: self._end(flow) if phase == END else self._enter(flow),
            on_exit=lambda reason: self._leave(flow, reason),
        )
        flow = RunningFlow(plan, machine)
        return flow

    def _begin(self) -> None:
        """Begin every flow that waits for no vehicle and that no other flow has begun."""
        self._begun = True
        for flow in self._flows.values():
            if not (flow.plan.waits or flow.active):
                flow.machine.begin()

    def _guarded(self, flow: RunningFlow, now: Time, dt: float) -> None:
        """Step one flow. A flow that raises ends alone; its vehicles continue what they do."""
        try:
            self._step(flow, now, dt)
        except Exception as error:  # a lab's own link may show anything
            self._events.emit(FlowFailed(flow=flow.plan.name, reason=described(error)))
            flow.machine.end("failed")

    def _step(self, flow: RunningFlow, now: Time, dt: float) -> None:
        phase = flow.phase
        if flow.unpaced:
            self._pace(flow)
        if any(self._vehicles[v].requests.paused for v in self.driven(flow.plan.name)):
            flow.wait(dt)
            return
        if flow.waiting and self._passes_turn(flow):
            return
        if phase.transitions:
            elapsed = (now - flow.entered) / NS
            heard: AbstractSet[str] = self._events.heard("")
            if flow.missed:
                heard = flow.heard_with_missed(heard)
            flow.machine.step(elapsed, heard, "running", dt)
            if not phase.ends or flow.machine.state != phase.name:
                return
        busy = any(flow.is_in_its_state(v, self._vehicles[v].state) for v in phase.run)
        if not (busy or flow.waiting):
            flow.machine.end("done")

    def _passes_turn(self, flow: RunningFlow) -> bool:
        """Pass the turn to the next vehicle if it is due; return whether it did.

        In that tick the next vehicle has not begun yet while the one before is in its place, so
        that `all swarm in hover` may hold too early: the phase is not left, and events are kept.
        The turn waits for a vehicle that the failsafe brings down.
        """
        turn = self._vehicles[flow.turn]
        if flow.is_in_its_state(flow.turn, turn.state) or turn.requests.comes_down:
            return False
        self._ask_next(flow)
        flow.keep_for_later(self._events.heard(""))
        return True

    def _ask_next(self, flow: RunningFlow) -> None:
        """Ask the next vehicle whose turn it is; one that the flow doesn't drive is skipped."""
        while flow.waiting:
            if self._ask(flow, flow.next_turn()):
                return

    def _pace(self, flow: RunningFlow) -> None:
        """Let the behaviors that begin in this tick arrive together: at the pace of the slowest."""
        flow.paced()
        requests = [self._vehicles[vehicle].requests for vehicle in flow.phase.run]
        paces = [(one, pace) for one in requests if (pace := one.pace) is not None]
        if paces:
            slowest = Pace.slowest(pace for _, pace in paces)
            for one, _ in paces:
                one.keep(slowest)

    def _enter(self, flow: RunningFlow) -> None:
        phase, name = flow.phase, flow.plan.name
        flow.arrived(self._events.now)
        self._events.emit(PhaseStarted(flow=name, phase=phase.name), at=phase.at)
        given = [to for vehicle, to in phase.give.items() if self._give(flow, vehicle, to)]
        for other in dict.fromkeys(given):
            if not self._flows[other].active:
                self._flows[other].machine.begin()
        for option in phase.options:
            try:
                self._options.set(option.option, option.value, f"flow {name}", phase.at)
            except OptionRefused:
                continue  # an event says so
        if phase.arrive == "in_turns":
            flow.waiting.extend(phase.run)
            self._ask_next(flow)
        else:
            for vehicle in phase.run:
                self._ask(flow, vehicle)

    def _ask(self, flow: RunningFlow, vehicle: str) -> bool:
        """Request what the phase runs on a vehicle; return whether the flow drives it."""
        phase, reason = flow.phase, self._not_mine(flow, vehicle)
        request = phase.run[vehicle]
        if reason is None:
            requests = self._vehicles[vehicle].requests
            requests.switch(request.state, Requester.FLOW, phase.at, values=request.values)
        else:
            refused = SwitchRefused(state=request.state, by="flow", reason=reason)
            self._events.emit(refused, vehicle, phase.at)
        return reason is None

    def _give(self, flow: RunningFlow, vehicle: str, to: str) -> bool:
        """Return whether another flow drives the vehicle now."""
        name, at = flow.plan.name, flow.phase.at
        reason = self._not_mine(flow, vehicle)
        if reason is not None:
            self._events.emit(GiveRefused(flow=name, to=to, reason=reason), vehicle, at)
            return False
        self._drivers[vehicle].append(to)
        self._events.emit(DriverChanged(flow=to), vehicle, at)
        return True

    def _not_mine(self, flow: RunningFlow, vehicle: str) -> str | None:
        """Return why a flow may request nothing of a vehicle now, None if it may."""
        driver = self.driver(vehicle)
        if driver == flow.plan.name:
            return None
        return "no flow drives it" if driver is None else f"`{driver}` drives it"

    def _leave(self, flow: RunningFlow, reason: Exit) -> None:
        name, phase = flow.plan.name, flow.phase.name
        flow.left(reason.how, self._events.now)
        self._events.emit(PhaseEnded(flow=name, phase=phase, how=reason.how), at=reason.at)
        if reason.transition is not None and reason.transition.emit is not None:
            self._events.emit(Custom(reason.transition.emit), at=reason.at)

    def _end(self, flow: RunningFlow) -> None:
        """End the flow; vehicles that it was given return to the flow that gave them."""
        name = flow.plan.name
        for vehicle, drivers in self._drivers.items():
            if vehicle in flow.plan.vehicles or name not in drivers:
                continue
            drivers.remove(name)
            self._events.emit(DriverChanged(flow=drivers[-1]), vehicle)
        self._events.emit(FlowEnded(flow=name, phase=flow.visits[-1].name))
        self._events.emit(Custom(f"{name}.finished"))
