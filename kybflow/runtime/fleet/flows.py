"""Flows: phases over several vehicles, stepped once a tick after every vehicle has acted.

Each flow has a state machine, whose states are its phases. When a phase is entered, it gives
vehicles to other flows, sets options, and requests vehicles to enter states; the vehicles answer in
the next tick. Only one flow at a time drives a vehicle: requests of another are refused with an
event. A phase may let its vehicles arrive in turns or together. In turns, each vehicle is requested
once the previous one has left the requested state, and has landed if the failsafe lands it.
Together, their behaviors begin at a common pace.

A flow that ends returns the vehicles that it was given. The time of a flow stands still while a
vehicle that it drives is paused. When a person lands every vehicle, every flow ends.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from collections.abc import Set as AbstractSet
from math import isfinite
from typing import Any, NamedTuple

from kybflow.core.errors import OptionRefused, described
from kybflow.core.events import Custom
from kybflow.core.signals import NO_OBJECTS, NS, SeenObjects, Time
from kybflow.dsl.expressions import Expression
from kybflow.dsl.machine import Exit, FlowMachine
from kybflow.dsl.plan import END, FlowPlan, PartPlan, PhasePlan, Plan
from kybflow.flight.motion import Pace
from kybflow.parts import Coordinator, TeamTick
from kybflow.parts.events import (
    CoordinatorChanged,
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
from kybflow.runtime.options import Options
from kybflow.runtime.scores import rounded
from kybflow.runtime.vehicle.requests import Requester
from kybflow.runtime.vehicle.vehicle import Vehicle

Conditions = Callable[[Expression], Callable[[], bool]]
_NOTHING: frozenset[str] = frozenset()


class PhaseVisit(NamedTuple):
    """One visit to a phase. ended: how it ended: next, within, done, asked, operator, failed or
    run_ended; None while it lasts, as `end_s`."""

    name: str
    start_s: float
    end_s: float | None = None
    ended: str | None = None


class RunningFlow:
    """The state of one flow.

    entered: when the current phase was entered.
    visits: the visits to phases so far.
    unpaced: whether the vehicles of the phase arrive together and don't have their pace yet.
    turn: the vehicle whose turn it is.
    waiting: the vehicles that still wait for their turn.
    missed: the events of ticks in which the turn passed, to be handled later.
    coordinator: that of the current phase, from its first tick on. coordinated: what it does.
    """

    def __init__(self, plan: FlowPlan, machine: FlowMachine) -> None:
        self.plan, self.machine = plan, machine
        self.entered: Time = 0
        self.visits: list[PhaseVisit] = []
        self.unpaced = False
        self.turn = ""
        self.waiting: deque[str] = deque()
        self.missed: AbstractSet[str] = _NOTHING
        self.coordinator: Coordinator[Any] | None = None
        self.coordinated = ""

    @property
    def active(self) -> bool:
        """Whether the flow has begun and not ended, so that it is in a phase."""
        return self.machine.state != END

    @property
    def phase(self) -> PhasePlan:
        return self.plan.phases[self.machine.state]

    def arrived(self, now: Time) -> None:
        self.entered = now
        self.unpaced = self.phase.arrive == "together"
        self.visits.append(PhaseVisit(self.phase.name, rounded(now / NS)))

    def paced(self) -> None:
        """Record that the vehicles of the phase have their common pace."""
        self.unpaced = False

    def next_turn(self) -> str:
        """Pass the turn to the next waiting vehicle; return its name."""
        self.turn = self.waiting.popleft()
        return self.turn

    def keep_for_later(self, heard: AbstractSet[str]) -> None:
        """Keep the events of a tick in which the phase handles none."""
        self.missed |= heard

    def heard_with_missed(self, heard: AbstractSet[str]) -> AbstractSet[str]:
        """Return the events of this tick and those kept before, and clear the latter."""
        missed, self.missed = self.missed, _NOTHING
        return heard | missed

    def is_in_its_state(self, vehicle: str, state: str) -> bool:
        """Return whether `state` is the state, or is in the chain, that the phase requested of the
        vehicle."""
        request = self.phase.run[vehicle]
        return is_in(state, request.chain or request.state)

    def left(self, how: str, now: Time) -> None:
        self.visits[-1] = self.visits[-1]._replace(end_s=rounded(now / NS), ended=how)
        self.waiting.clear()
        self.missed = _NOTHING
        self.coordinator, self.coordinated = None, ""

    def wait(self, dt: float) -> None:
        """Stop the phase's time for a tick of `dt` seconds."""
        self.entered += round(dt * NS)


class Flows:
    """The flows of a plan. ended: whether all flows have ended, or the plan has none."""

    def __init__(
        self,
        plan: Plan,
        vehicles: Sequence[Vehicle],
        conditions: Conditions,
        events: Events,
        options: Options,
        objects: SeenObjects = NO_OBJECTS,
    ) -> None:
        self._objects = objects
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
        """Return the name of the flow that drives a vehicle now, or None."""
        drivers = self._drivers.get(vehicle)
        return drivers[-1] if drivers else None

    def step(self, now: Time, dt: float) -> None:
        """Step every active flow for one tick, or begin the flows in the first one."""
        if not self._begun:
            self._begun = True
            for flow in self._flows.values():
                if not (flow.plan.waits or flow.active):
                    flow.machine.begin()
            return
        for flow in self._flows.values():
            if not flow.active or flow.entered == now:
                continue  # vehicles learn what a phase asks of them in the next tick
            try:
                self._step(flow, now, dt)
            except Exception as error:  # a lab's own link may show anything; only this flow ends
                self._events.emit(FlowFailed(flow=flow.plan.name, reason=described(error)))
                flow.machine.end("failed")

    def enter(self, flow: str, phase: str, by: str, at: str = "") -> str | None:
        """Enter a phase at the request of a callback or a person. Return why it is refused, which
        an event reports too, or None. A flow that waits for vehicles and has none refuses."""
        reason = self.objection(flow)
        if reason is None:
            self._flows[flow].machine.switch(phase, at)
        else:
            self._events.emit(PhaseRefused(flow=flow, phase=phase, by=by, reason=reason), at=at)
        return reason

    def objection(self, flow: str) -> str | None:
        """Return why no phase of a flow can be entered now, or None if any can."""
        running = self._flows[flow]
        if running.active or not running.plan.waits:
            return None
        return f"no flow has given `{flow}` a vehicle"

    def running(self, flow: str) -> RunningFlow:
        """Return the flow with this name, active or not."""
        return self._flows[flow]

    def driven(self, flow: str) -> list[str]:
        """Return the names of the vehicles that a flow drives now."""
        return [v for v, drivers in self._drivers.items() if drivers[-1] == flow]

    def give_up(self) -> None:
        """End every flow for good, because a person lands every vehicle."""
        self._begun = True
        for flow in self._flows.values():
            if flow.active:
                flow.machine.end("operator")

    def close(self, now: Time) -> None:
        """End the current visits, because the run is over."""
        for flow in self._flows.values():
            if flow.active:
                flow.left("run_ended", now)

    def record(self) -> dict[str, Any]:
        """Return the flows' entries in `summary.json`, by name."""
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

    def _step(self, flow: RunningFlow, now: Time, dt: float) -> None:
        phase = flow.phase
        if flow.unpaced:
            self._pace(flow)
        if phase.coordinator is not None:
            self._coordinate(flow, phase.coordinator, now, dt)
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
        """Pass the turn to the next vehicle if the current one has left the requested state; return
        whether the turn was passed. The turn waits for a vehicle that the failsafe brings down.

        In the tick in which the turn passes, the next vehicle has not begun yet although the
        previous one has already arrived, so that `all swarm in hover` may hold too early. In that
        tick the phase is therefore not left, and the events are kept for later.
        """
        turn = self._vehicles[flow.turn]
        if flow.is_in_its_state(flow.turn, turn.state) or turn.requests.comes_down:
            return False
        self._ask_next(flow)
        flow.keep_for_later(self._events.heard(""))
        return True

    def _ask_next(self, flow: RunningFlow) -> None:
        """Pass the turn and make the request to the next vehicle; skip vehicles that the flow
        doesn't drive."""
        while flow.waiting:
            if self._ask(flow, flow.next_turn()):
                return

    def _pace(self, flow: RunningFlow) -> None:
        """Make the behaviors that begin in this tick arrive together, at the pace of the slowest
        one."""
        flow.paced()
        requests = [self._vehicles[vehicle].requests for vehicle in flow.phase.run]
        paces = [(one, pace) for one in requests if (pace := one.pace) is not None]
        if paces:
            slowest = Pace.slowest(pace for _, pace in paces)
            for one, _ in paces:
                one.keep(slowest)

    def _coordinate(self, flow: RunningFlow, part: PartPlan, now: Time, dt: float) -> None:
        """Give each vehicle of the phase what its coordinator says, and report what that does."""
        members = {name: self._vehicles[name] for name in flow.phase.run}
        if flow.coordinator is None:
            team = {name: vehicle.context for name, vehicle in members.items()}
            flow.coordinator = part.cls(part.params, team)
        shares = flow.coordinator.update(
            TeamTick(now, dt, self._objects, {n: v.as_member() for n, v in members.items()})
        )
        for name, vehicle in members.items():
            share = shares.values.get(name)
            if share is not None and not isfinite(share):
                raise ValueError(f"its coordinator gives `{name}` {share}")
            vehicle.take_share(share)
        if shares.state != flow.coordinated:
            flow.coordinated = shares.state
            self._events.emit(
                CoordinatorChanged(flow=flow.plan.name, state=shares.state, reason=shares.reason),
                at=flow.phase.at,
            )

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
        """Request the state that the phase runs on a vehicle; return whether the flow drives that
        vehicle, else emit a refusal."""
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
        """Give the vehicle to the flow `to`; return whether it was given. A refusal is emitted."""
        name, at = flow.plan.name, flow.phase.at
        reason = self._not_mine(flow, vehicle)
        if reason is not None:
            self._events.emit(GiveRefused(flow=name, to=to, reason=reason), vehicle, at)
            return False
        self._drivers[vehicle].append(to)
        self._events.emit(DriverChanged(flow=to), vehicle, at)
        return True

    def _not_mine(self, flow: RunningFlow, vehicle: str) -> str | None:
        """Return why a flow may not make requests to a vehicle now, or None if it may."""
        driver = self.driver(vehicle)
        if driver == flow.plan.name:
            return None
        return "no flow drives it" if driver is None else f"`{driver}` drives it"

    def _leave(self, flow: RunningFlow, reason: Exit) -> None:
        name, phase = flow.plan.name, flow.phase.name
        for vehicle in flow.phase.run if flow.coordinator is not None else ():
            self._vehicles[vehicle].take_share(None)
        flow.left(reason.how, self._events.now)
        self._events.emit(PhaseEnded(flow=name, phase=phase, how=reason.how), at=reason.at)
        if reason.transition is not None and reason.transition.emit is not None:
            self._events.emit(Custom(reason.transition.emit), at=reason.at)

    def _end(self, flow: RunningFlow) -> None:
        """End the flow, and return the vehicles that it was given to the flows that gave them."""
        name = flow.plan.name
        for vehicle, drivers in self._drivers.items():
            if vehicle in flow.plan.vehicles or name not in drivers:
                continue
            drivers.remove(name)
            self._events.emit(DriverChanged(flow=drivers[-1]), vehicle)
        self._events.emit(FlowEnded(flow=name, phase=flow.visits[-1].name))
        self._events.emit(Custom(f"{name}.finished"))
