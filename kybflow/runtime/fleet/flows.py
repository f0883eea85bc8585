"""Flows: phases over several vehicles, stepped once a tick after every vehicle has acted.

Each flow is a machine of phases. Entering one gives vehicles to other flows, asks for options, and
asks vehicles to enter states; they decide in the next tick. A vehicle is driven by one flow at a
time: what another asks of it is refused, and told. A flow that ends gives back what it was given.
Its time stands still while a vehicle that it drives is paused. When a person lands, every
flow ends.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from kybflow.core.errors import OptionRefused, described
from kybflow.core.signals import NS, Time
from kybflow.dsl.expressions import Expression
from kybflow.dsl.machine import FlowMachine
from kybflow.dsl.plan import END, Plan
from kybflow.parts.observables import is_in
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.flow import Running
from kybflow.runtime.fleet.operator import LAND
from kybflow.runtime.vehicle.requests import Requester, Requests

Conditions = Callable[[Expression], Callable[[], bool]]


class Driven(Protocol):
    """A vehicle, as a flow sees it."""

    name: str

    @property
    def state(self) -> str:
        """The name of the state that it is in."""

    @property
    def requests(self) -> Requests:
        """What the flow may ask of it."""


class Settings(Protocol):
    """The options, as a flow sees them."""

    def set(self, name: str, value: Any, by: str, at: str = "") -> None:
        """Ask for a change. Raises OptionRefused, which is told already."""


class Flows:
    """The flows of a plan. `ended` when none of them will ask anything by itself any more."""

    def __init__(
        self,
        plan: Plan,
        vehicles: Sequence[Driven],
        conditions: Conditions,
        events: Events,
        options: Settings,
    ) -> None:
        self._vehicles = {vehicle.name: vehicle for vehicle in vehicles}
        self._conditions, self._events, self._options = conditions, events, options
        self._flows = {flow.name: Running(flow) for flow in plan.flows}
        self._drivers: dict[str, list[str]] = {}
        for flow in plan.flows:
            for vehicle in flow.vehicles:
                self._drivers[vehicle] = [flow.name]
        self._begun = not plan.flows

    @property
    def ended(self) -> bool:
        return self._begun and all(flow.machine is None for flow in self._flows.values())

    def driver(self, vehicle: str) -> str | None:
        """The flow that drives a vehicle now."""
        drivers = self._drivers.get(vehicle)
        return drivers[-1] if drivers else None

    def begin(self, now: Time) -> None:
        """Begin every flow that does not wait for a vehicle."""
        self._begun = True
        for flow in self._flows.values():
            if not flow.plan.waits:
                self._begin(flow, now)

    def step(self, now: Time, dt: float) -> None:
        """One period of every flow."""
        if not self._flows:
            return
        if not self._begun:
            self.begin(now)
            return
        if LAND in self._events.heard(""):
            self._give_up(now)
        for flow in self._flows.values():
            if flow.machine is None or flow.entered == now:
                continue  # of what a phase asks, the vehicles know in the next tick
            if any(self._vehicles[v].requests.paused for v in self._driven(flow)):
                flow.wait(dt)
            else:
                self._guarded(flow, flow.machine, now, dt)

    def enter(self, flow: str, phase: str, by: str, at: str = "") -> None:
        """Enter a phase, whatever the flow does now: a callback's or a person's wish. Refused, and
        told, for a flow that has no vehicle, because it waits for one."""
        running = self._flows[flow]
        if running.machine is None and running.plan.waits:
            reason = f"no flow has given `{flow}` a vehicle"
            self._events.tell("phase_refused", at=at, flow=flow, phase=phase, by=by, reason=reason)
            return
        now = self._events.now
        if running.machine is None:
            running.machine = FlowMachine(running.plan, self._conditions)
        else:
            self._leave(running, "asked", at, now)
        running.machine.force(phase)
        self._enter(running, now)

    def close(self, now: Time) -> None:
        """The run is over: what still lasts ends here."""
        for flow in self._flows.values():
            if flow.machine is not None:
                flow.left("run_ended", now)

    def record(self) -> dict[str, Any]:
        """The flows as `summary.json` holds them."""
        return {
            name: {"phases": [visit._asdict() for visit in flow.visits]}
            for name, flow in self._flows.items()
        }

    def _give_up(self, now: Time) -> None:
        """A person lands every vehicle: no flow may start it again."""
        for flow in self._flows.values():
            if flow.machine is not None:
                self._leave(flow, "operator", "", now)
                self._end(flow)

    def _driven(self, flow: Running) -> list[str]:
        return [v for v, drivers in self._drivers.items() if drivers[-1] == flow.plan.name]

    def _begin(self, flow: Running, now: Time) -> None:
        flow.machine = FlowMachine(flow.plan, self._conditions)
        self._enter(flow, now)

    def _guarded(self, flow: Running, machine: FlowMachine, now: Time, dt: float) -> None:
        """One flow that fails ends, and no other with it; its vehicles do what they do."""
        try:
            self._step(flow, machine, now, dt)
        except Exception as error:  # a lab's own link may show anything
            self._events.tell("flow_failed", flow=flow.plan.name, reason=described(error))
            self._leave(flow, "failed", "", now)
            self._end(flow)

    def _step(self, flow: Running, machine: FlowMachine, now: Time, dt: float) -> None:
        phase = flow.phase
        if not phase.transitions:
            asked = {**phase.run, **phase.chains}.items()
            if not any(is_in(self._vehicles[v].state, state) for v, state in asked):
                self._leave(flow, "done", "", now)
                self._end(flow)
            return
        elapsed, heard = (now - flow.entered) / NS, self._events.heard("")
        transition = machine.due(elapsed, heard, "running", dt)
        if transition is None:
            return
        self._leave(flow, transition.cause, transition.at, now)
        machine.fire(transition)
        if machine.state == END:
            self._end(flow)
        else:
            self._enter(flow, now)

    def _enter(self, flow: Running, now: Time) -> None:
        phase, name = flow.phase, flow.plan.name
        flow.arrived(now)
        self._events.tell("phase_started", at=phase.at, flow=name, phase=phase.name)
        given = [to for vehicle, to in phase.give.items() if self._give(flow, vehicle, to)]
        for other in dict.fromkeys(given):
            if self._flows[other].machine is None:
                self._begin(self._flows[other], now)
        for option in phase.set:
            try:
                self._options.set(option.option, option.value, f"flow {name}", phase.at)
            except OptionRefused:
                continue  # it is told
        for vehicle, state in phase.run.items():
            reason = self._not_mine(flow, vehicle)
            if reason is None:
                self._vehicles[vehicle].requests.switch(state, Requester.FLOW, phase.at)
            else:
                self._events.tell(
                    "switch_refused", vehicle, phase.at, state=state, by="flow", reason=reason
                )

    def _give(self, flow: Running, vehicle: str, to: str) -> bool:
        """Whether another flow drives the vehicle now."""
        name, at = flow.plan.name, flow.phase.at
        reason = self._not_mine(flow, vehicle)
        if reason is not None:
            self._events.tell("give_refused", vehicle, at, flow=name, to=to, reason=reason)
            return False
        self._drivers[vehicle].append(to)
        self._events.tell("driver_changed", vehicle, at, flow=to)
        return True

    def _not_mine(self, flow: Running, vehicle: str) -> str | None:
        """Why a flow may ask nothing of a vehicle now; None when it may."""
        driver = self.driver(vehicle)
        if driver == flow.plan.name:
            return None
        return "no flow drives it" if driver is None else f"`{driver}` drives it"

    def _leave(self, flow: Running, how: str, at: str, now: Time) -> None:
        name, phase = flow.plan.name, flow.phase.name
        flow.left(how, now)
        self._events.tell("phase_ended", at=at, flow=name, phase=phase, how=how)

    def _end(self, flow: Running) -> None:
        """The flow is over; vehicles that it was given go back to who gave them."""
        name = flow.plan.name
        flow.machine = None
        for vehicle, drivers in self._drivers.items():
            if vehicle in flow.plan.vehicles or name not in drivers:
                continue
            drivers.remove(name)
            self._events.tell("driver_changed", vehicle, flow=drivers[-1])
        self._events.tell("flow_ended", flow=name, phase=flow.visits[-1].name)
        self._events.tell(f"{name}.finished")
