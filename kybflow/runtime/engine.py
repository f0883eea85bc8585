"""The engine runs every vehicle tick by tick. It controls time and the order of execution, and
handles failures.

now ─► 0. the run: events, inputs, commands, options, faults, tracked bodies
       1. every vehicle: measurements ─► estimate        then the fleet snapshot is taken
       2. every vehicle: supervisors, transitions ─► behavior ─► processors ─► tracker ─► link
       3. the run: flows, callbacks, expectations, observers
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

from kybflow.core.errors import described, traceback_of
from kybflow.core.signals import NS, Time
from kybflow.core.text import detailed, details, headline
from kybflow.dsl.expressions import Expression
from kybflow.dsl.names import FAULT
from kybflow.dsl.plan import Plan
from kybflow.parts import Session
from kybflow.parts.events import (
    ObserverFailed,
    PreflightFailed,
    PreflightPassed,
    RunInterrupted,
    RunStarted,
    RunStopped,
    TicksMissed,
)
from kybflow.parts.true_objects import TrueObjects
from kybflow.runtime.clock import Clock, TickCount
from kybflow.runtime.commanding.command_queue import CommandQueue
from kybflow.runtime.commanding.commander import Commander
from kybflow.runtime.commanding.legal import RunView
from kybflow.runtime.conditions import reader_of
from kybflow.runtime.events import Events, WorldObserver
from kybflow.runtime.expectations import Judge
from kybflow.runtime.fleet.callbacks import Callbacks, RunControls
from kybflow.runtime.fleet.flows import Flows
from kybflow.runtime.fleet.ground_truth import (
    Clearances,
    Excursions,
    Impacts,
    ObjectContacts,
    PayloadDrops,
)
from kybflow.runtime.fleet.inferred_contacts import InferredContacts
from kybflow.runtime.fleet.injection import Injection
from kybflow.runtime.fleet.inputs import Inputs
from kybflow.runtime.fleet.moving_obstacles import MovingObstacles
from kybflow.runtime.fleet.tracked_objects import TrackedObjects
from kybflow.runtime.options import Options
from kybflow.runtime.preflight import (
    PreflightResult,
    PreflightTimeout,
    body_lines,
    clock_lines,
    input_lines,
    preflight,
)
from kybflow.runtime.vehicle.vehicle import Vehicle
from kybflow.runtime.views import BelievedView, KnownObjects, TrueView

LANDING_TIMEOUT, SLOWEST_DESCENT = 60.0, 0.2
"""Vehicles have `LANDING_TIMEOUT` seconds to land after the mission's time limit, or, if that is
longer, the time of a descent from the top of the fence at `SLOWEST_DESCENT` m/s."""
_OBSERVED_EVERY = NS // 20
MIN_TICK_SHARE = 0.9
"""The share of a second's ticks below which the computer is reported to be late."""
_REPORT_PERIOD_NS = 10 * NS

Observer = Callable[["Engine"], None]


class Engine:
    """Flies a plan.

    `kybflow.api` constructs the engine: vehicles, sessions, options, inputs, moving obstacles and
    objects must use the same devices.
    """

    def __init__(
        self,
        plan: Plan,
        clock: Clock,
        sessions: Sequence[Session],
        vehicles: Sequence[Vehicle],
        events: Events,
        options: Options,
        inputs: Inputs,
        moving: MovingObstacles,
        objects: TrackedObjects,
        observers: Sequence[Observer] = (),
        seed: int = 0,
        commands: CommandQueue | None = None,
        interrupts: int = 0,
        world_observer: WorldObserver | None = None,
    ) -> None:
        self.plan, self.clock, self.events = plan, clock, events
        self.vehicles = tuple(vehicles)
        self.options, self.inputs = options, inputs
        self.moving, self.objects = moving, objects
        self._tracked = tuple(one for one in (moving, objects) if one.has_bodies)
        self.true_objects = TrueObjects(plan.objects, sessions)
        self.contacts = ObjectContacts(sessions if plan.objects else (), events)
        self.inferred = InferredContacts(self.vehicles, plan.objects, objects.seen)
        known = KnownObjects(
            plan.objects, objects.seen, self.true_objects, self.inferred, self.contacts
        )
        self._believed = {vehicle.name: BelievedView(vehicle, known) for vehicle in vehicles}
        true, period = {v.name: TrueView(v, known) for v in vehicles}, clock.period / NS
        self.judge = Judge(plan.expectations, true, self.mission_seconds, period)
        self.flows = Flows(
            plan, self.vehicles, self._condition(None), events, self.options, objects.seen
        )
        requests = {vehicle.name: vehicle.requests for vehicle in self.vehicles}
        controls = RunControls(requests, options, events, self.flows.enter, self.stop)
        self.commander = Commander(
            RunView(plan, self.vehicles, self.flows),
            controls,
            self.flows.give_up,
            commands or CommandQueue(),
        )
        self.callbacks = Callbacks(plan.callbacks, controls, self._condition(None))
        self.interrupts = interrupts
        self.interrupted_by = "a signal"
        self._interrupts_noted = interrupts
        self.flying = False
        self._sessions, self._observers = tuple(sessions), tuple(observers)
        self._publishing = tuple(vehicle for vehicle in self.vehicles if vehicle.publishes)
        links = {name: link for session in sessions for name, link in session.links.items()}
        active = {name: link.faults for name, link in links.items() if link.faults is not None}
        active |= self.true_objects.faults
        self.injection = Injection(plan.faults, active, self._condition, events, seed)
        self.impacts = Impacts(self.vehicles, links, events, plan.touchable, plan.objects)
        self._has_objects = bool(plan.objects)
        self._world_observer = world_observer or WorldObserver()
        self.excursions = Excursions(self.vehicles, plan.fence, events)
        self.clearances = Clearances(self.vehicles, true, plan.kept_clear)
        self.drops = PayloadDrops(self.vehicles, events)
        self._ticks = TickCount(clock)
        self._next_look: Time = 0
        self._reported_late: Time | None = None
        self._ticked: Time | None = None
        self._begun: Time = 0
        self._landing: str | None = None
        self._stopped: str | None = None
        self._limit: Time = sys.maxsize

    def seconds(self) -> float:
        """Return the seconds since the run began."""
        return self.clock.now / NS

    def mission_seconds(self) -> float:
        """Return the seconds since the preflight was over, which may take long with a cold
        autopilot; zero before."""
        return (self.clock.now - self._begun) / NS if self.flying else 0.0

    def run(self) -> str | None:
        """Run the preflight, then tick until every vehicle rests; land all at the time limit.
        Return why the mission was not completed, or None if it was."""
        self.events.emit(RunStarted())
        red = self._preflight()
        if self.interrupts:
            return f"by {self.interrupted_by}, in the preflight"
        if self._stopped is not None:
            return f"{self._stopped}, before the preflight was over"
        if red:
            first, *others = (f"{x.vehicle}: {x.check}: {x.reason}" for x in red)
            count = f", and {len(others)} more red line{'s' * (len(others) > 1)}" if others else ""
            below = [*details(first), *(row for text in others for row in text.splitlines())]
            return detailed(f"preflight: {headline(first)}{count}", below)
        for vehicle in self.vehicles:
            vehicle.begin(self._condition(vehicle.name))
        self.flying, self._begun = True, self.clock.now
        height = 0.0 if self.plan.fence is None else self.plan.fence.high[2]
        self._limit = self._begun + round(self.plan.time_limit * NS)
        landed_by = self._limit + round(max(LANDING_TIMEOUT, height / SLOWEST_DESCENT) * NS)
        while not self._over():
            if self._landing is not None:
                if self.interrupts > 1:
                    self._note_interrupts()
                    return f"twice, then by {self.interrupted_by}: commands were stopped"
                if self.clock.now >= landed_by:
                    break
            self.tick()
        return (
            self._landing or self.injection.failure or self.impacts.first or self.excursions.first
        )

    def _over(self) -> bool:
        """Return whether every vehicle rests and no flow or callback will move it again."""
        for vehicle in self.vehicles:
            if not vehicle.rests:
                return False
        if self._landing is not None or self._stopped is not None:
            return True
        lost = all(vehicle.state == FAULT for vehicle in self.vehicles)
        return not self.callbacks.pending and (self.flows.ended or lost)

    def tick(self) -> None:
        """Run every vehicle for one tick, then advance the clock and the sessions."""
        now = self.clock.now
        dt = (self.clock.period if self._ticked is None else now - self._ticked) / NS
        self._ticked = now
        self.events.turn(now)
        if self.plan.inputs:
            self.inputs.step(now, self.vehicles)
        self.commander.step(now)
        self.options.apply()
        if self.plan.faults:
            self.injection.step(now)
        for bodies in self._tracked:
            bodies.step(now)
        fleet = {vehicle.name: vehicle.sense(now) for vehicle in self.vehicles}
        if self.interrupts or now >= self._limit:
            self._land_at_the_end()
        for vehicle in self.vehicles:
            vehicle.act(now, dt, fleet)
        for vehicle in self._publishing:
            vehicle.publish()
        if self.plan.flows:
            self.flows.step(now, dt)
        if self.events.unanswered:
            self.callbacks.step()
        if self.callbacks.watching:
            self.callbacks.watch()
        self.judge.sample()
        self._advance(now)

    def _advance(self, now: Time) -> None:
        if self._has_objects:
            self.contacts.step(now, self.clock.period / NS)
            if self.true_objects.is_known:
                self._world_observer.objects(now, self.true_objects.states, self.contacts.felt)
            self.inferred.step(now, self.clock.period / NS)
        if now >= self._next_look:
            self._next_look = now + _OBSERVED_EVERY
            self.excursions.step()
            self.clearances.step()
            self.drops.step()
            if self._ticks.update() and self._ticks.share < MIN_TICK_SHARE:
                self._report_late(now)
            for observe in self._observers:
                self._observed(observe)
        now = self.clock.step()
        for session in self._sessions:
            session.advance(now)

    def _report_late(self, now: Time) -> None:
        """Report that the computer is late, every 10 s at most."""
        last = self._reported_late
        if last is None or now - last >= _REPORT_PERIOD_NS:
            self._reported_late = now
            ticks = self._ticks
            self.events.emit(
                TicksMissed(reason=str(ticks), value=ticks.share, bound=MIN_TICK_SHARE)
            )

    def _observed(self, observe: Observer) -> None:
        try:
            observe(self)
        except Exception as error:  # an observer must not stop the flight
            self._observers = tuple(other for other in self._observers if other is not observe)
            self.events.emit(ObserverFailed(reason=described(error), traceback=traceback_of(error)))

    def inspect(self) -> list[PreflightResult]:
        """Run the preflight's checks until all are green or it times out; return their lines, or
        none after an interrupt or a stop. No vehicle arms."""
        timeout = PreflightTimeout(self.plan, self.events)
        while not self.interrupts and self._stopped is None:
            self.events.turn(self.clock.now)
            self.commander.stand_by(self.clock.now)
            for vehicle in self.vehicles:
                vehicle.sense(self.clock.now)
            self.inputs.step(self.clock.now, flying=False)
            for bodies in self._tracked:
                bodies.step(self.clock.now)
            for vehicle in self.vehicles:
                vehicle.link_out.prepare_preflight(self.clock.now)
            lines = [line for v in self.vehicles for line in preflight(v, self.vehicles)]
            lines += input_lines(self.plan, self.inputs.objections())
            lines += clock_lines(self.plan, self._ticks)
            lines += body_lines(self.plan, "obstacle", self.moving.objections(self.clock.now))
            lines += body_lines(self.plan, "object", self.objects.objections(self.clock.now))
            if timeout.ends(lines, self.seconds()):
                return lines
            self._advance(self.clock.now)
        return []

    def watch(self, is_over: Callable[[], bool]) -> None:
        """Read the measurements of every vehicle, with the mission's faults, until `is_over`. No
        vehicle arms."""
        while not is_over():
            self.events.turn(self.clock.now)
            if self.plan.faults:
                self.injection.step(self.clock.now)
            for vehicle in self.vehicles:
                vehicle.sense(self.clock.now)
            self._advance(self.clock.now)

    def stop(self, reason: str, at: str = "") -> None:
        """Land every vehicle and end the run. The run counts as completed, unless it is still in
        the preflight."""
        if self._stopped is None:
            self._stopped = reason
            self.events.emit(RunStopped(reason=reason), at=at)
            for vehicle in self.vehicles if self.flying else ():
                vehicle.requests.retire(f"the run ends: {reason}")

    def _preflight(self) -> list[PreflightResult]:
        """Run the preflight and emit its results; return the lines that stayed red."""
        lines = self.inspect()
        red = [line for line in lines if not line.green]
        for vehicle, check, _, reason, at, _ in () if red else lines:
            self.events.emit(PreflightPassed(check=check, found=reason), vehicle, at)
        for vehicle, check, _, reason, at, _ in red:
            self.events.emit(PreflightFailed(check=check, reason=reason), vehicle, at)
        return red

    def _condition(self, own: str | None) -> Callable[[Expression], Callable[[], bool]]:
        return lambda expression: reader_of(
            expression, self._believed, own, self.seconds, self.inputs.readings
        )

    def _land_at_the_end(self) -> None:
        """Land every vehicle, because of an interrupt or at the time limit."""
        if self.interrupts:
            self._note_interrupts()
            self._land(f"by {self.interrupted_by}", TWICE)
        else:
            self._land(f"not finished within the time limit of {self.plan.time_limit:g} s")

    def _note_interrupts(self) -> None:
        while self._interrupts_noted < self.interrupts:
            self._interrupts_noted += 1
            self.events.emit(RunInterrupted(by=self.interrupted_by))

    def _land(self, reason: str, hint: str = "") -> None:
        """Land every vehicle, regardless of the mission. Calls after the first have no effect.
        hint: what a person can do now, for the vehicles' events."""
        if self._landing is None:
            self._landing = reason
            for vehicle in self.vehicles:
                vehicle.land(f"{reason}; {hint}" if hint else reason)


TWICE = "a second interrupt stops the commands at once"
