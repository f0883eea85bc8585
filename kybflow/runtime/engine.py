"""The engine: owns time, order and failure. One tick, two phases, every vehicle.

now ─► 1. every vehicle: measurements ─► estimate        then the fleet snapshot is frozen
       2. every vehicle: events ─► behavior ─► processors ─► tracker ─► command ─► link
       3. expectations, observers
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import Plan
from kybflow.parts import Session
from kybflow.runtime.clock import Clock
from kybflow.runtime.conditions import bind
from kybflow.runtime.events import Events
from kybflow.runtime.expectations import Judge
from kybflow.runtime.options import Options
from kybflow.runtime.preflight import Line, preflight
from kybflow.runtime.vehicle import Vehicle
from kybflow.runtime.views import Actual, Believed
from kybflow.signals import NS, Time

PREFLIGHT_PATIENCE = 5.0
"""Seconds in which every line of the preflight must have become green."""
_OBSERVED_EVERY = NS // 20

Observer = Callable[["Engine"], None]


class Engine:
    """Flies a plan. `run` returns the reason why the mission was not flown to its end, None when it
    was."""

    def __init__(
        self,
        plan: Plan,
        clock: Clock,
        sessions: Sequence[Session],
        vehicles: Sequence[Vehicle],
        events: Events,
        observers: Sequence[Observer] = (),
    ) -> None:
        self.plan, self.clock, self.events = plan, clock, events
        self.vehicles = tuple(vehicles)
        self.options = Options(self.vehicles, events)
        self.judge = Judge(plan.expectations, _views(Actual, vehicles), self.seconds)
        self.interrupts = 0
        self.flying = False
        self._believed = _views(Believed, vehicles)
        self._sessions, self._observers = tuple(sessions), tuple(observers)
        self._next_look: Time = 0
        self._landing = False

    def seconds(self) -> float:
        """Time since the run began."""
        return self.clock.now / NS

    def run(self) -> str | None:
        """Preflight, then tick until every vehicle rests or the mission's time limit has passed."""
        self.events.tell("run_started")
        red = self._preflight()
        if red:
            return "preflight: " + "; ".join(f"{x.vehicle}: {x.check}: {x.reason}" for x in red)
        self._begin()
        while not all(vehicle.rests for vehicle in self.vehicles):
            if self.seconds() >= self.plan.time_limit:
                return f"not finished within the time limit of {self.plan.time_limit:g} s"
            if self.interrupts and self._interrupted():
                return "interrupted twice: the stream was cut"
            self.tick()
        return "interrupted" if self.interrupts else None

    def tick(self) -> None:
        """One period of every vehicle, then the world goes on."""
        now, dt = self.clock.now, self.clock.period / NS
        self.events.turn(now)
        self.options.apply()
        for vehicle in self.vehicles:
            vehicle.sense(now)
        fleet = {vehicle.name: vehicle.estimate for vehicle in self.vehicles}
        for vehicle in self.vehicles:
            vehicle.act(now, dt, fleet)
        self.judge.sample()
        self._advance()

    def _advance(self) -> None:
        if self.clock.now >= self._next_look:
            self._next_look = self.clock.now + _OBSERVED_EVERY
            for observe in self._observers:
                observe(self)
        now = self.clock.step()
        for session in self._sessions:
            session.advance(now)

    def _preflight(self) -> list[Line]:
        """Wait until all is green; the lines that stayed red."""
        red: list[Line] = []
        while self.seconds() < PREFLIGHT_PATIENCE:
            self.events.turn(self.clock.now)
            for vehicle in self.vehicles:
                vehicle.sense(self.clock.now)
            lines = [line for vehicle in self.vehicles for line in preflight(vehicle)]
            red = [line for line in lines if not line.green]
            if not red:
                for line in lines:
                    self.events.tell(
                        "preflight_passed", line.vehicle, check=line.check, found=line.reason
                    )
                return []
            self._advance()
        for line in red:
            self.events.tell("preflight_failed", line.vehicle, check=line.check, reason=line.reason)
        return red

    def _begin(self) -> None:
        for vehicle in self.vehicles:
            vehicle.begin(self._condition(vehicle.name))
        self.flying = True

    def _condition(self, own: str) -> Callable[[Expression], Callable[[], bool]]:
        return lambda expression: bind(expression, self._believed, own, self.seconds)

    def _interrupted(self) -> bool:
        """The first interrupt lands every vehicle; true when a second one cuts the stream."""
        if not self._landing:
            self._landing = True
            for vehicle in self.vehicles:
                vehicle.land("interrupted")
        return self.interrupts > 1


def _views(kind: type[Believed], vehicles: Sequence[Vehicle]) -> Mapping[str, Believed]:
    return {vehicle.name: kind(vehicle) for vehicle in vehicles}
