"""The engine: owns time, order and failure. One tick, two phases, every vehicle.

now ─► 1. every vehicle: measurements ─► estimate        then the fleet snapshot is frozen
       2. every vehicle: events ─► behavior ─► processors ─► tracker ─► command ─► link
       3. expectations, observers
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import Plan
from kybflow.errors import described
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
LANDING_PATIENCE = 60.0
"""Seconds in which vehicles that are still in the air at the time limit must have landed."""
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
        self._ticked: Time | None = None
        self._landing: str | None = None

    def seconds(self) -> float:
        """Time since the run began."""
        return self.clock.now / NS

    def run(self) -> str | None:
        """Preflight, then tick until every vehicle rests; land when the mission's time is over."""
        self.events.tell("run_started")
        red = self._preflight()
        if self.interrupts:
            return "interrupted"
        if red:
            return "preflight: " + "; ".join(f"{x.vehicle}: {x.check}: {x.reason}" for x in red)
        self._begin()
        while not all(vehicle.rests for vehicle in self.vehicles):
            if self.interrupts > 1:
                return "interrupted twice: the stream was cut"
            if self.interrupts:
                self._land("interrupted")
            elif self.seconds() >= self.plan.time_limit:
                self._land(f"not finished within the time limit of {self.plan.time_limit:g} s")
            if self.seconds() >= self.plan.time_limit + LANDING_PATIENCE:
                break
            self.tick()
        return self._landing

    def tick(self) -> None:
        """One period of every vehicle, then the world goes on."""
        now = self.clock.now
        dt = (self.clock.period if self._ticked is None else now - self._ticked) / NS
        self._ticked = now
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
                self._observed(observe)
        now = self.clock.step()
        for session in self._sessions:
            session.advance(now)

    def _observed(self, observe: Observer) -> None:
        try:
            observe(self)
        except Exception as error:  # who looks on must not stop who flies
            self._observers = tuple(other for other in self._observers if other is not observe)
            self.events.tell("observer_failed", reason=described(error))

    def _preflight(self) -> list[Line]:
        """Wait until all is green; the lines that stayed red."""
        red: list[Line] = []
        while self.seconds() < PREFLIGHT_PATIENCE and not self.interrupts:
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

    def _land(self, reason: str) -> None:
        """Land every vehicle, once, whatever the mission says."""
        if self._landing is None:
            self._landing = reason
            for vehicle in self.vehicles:
                vehicle.land(reason)


def _views(kind: type[Believed], vehicles: Sequence[Vehicle]) -> Mapping[str, Believed]:
    return {vehicle.name: kind(vehicle) for vehicle in vehicles}
