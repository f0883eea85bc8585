"""One vehicle, built from the plan.

measurements ─► `senses.py` ─► estimate ─► `acting.py` ─► command; `commanding.py` hears who asks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from kybflow.core.geometry import distance
from kybflow.core.signals import (
    NS,
    Alarm,
    Battery,
    Estimate,
    Reaction,
    Setpoint,
    Tick,
    Time,
    Truth,
)
from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import GROUND, Entry, Link
from kybflow.runtime.events import Events
from kybflow.runtime.making import make, parts_of
from kybflow.runtime.monitoring.body_health import Bodies
from kybflow.runtime.monitoring.estimate_history import Whereabouts
from kybflow.runtime.monitoring.sensing import Opened
from kybflow.runtime.observer import VehicleObserver
from kybflow.runtime.safety.failsafe import Failsafe, Heard
from kybflow.runtime.safety.land_mode import HANDED_OVER
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.activity import Activity
from kybflow.runtime.vehicle.chain import Chain
from kybflow.runtime.vehicle.obeying import Obeying
from kybflow.runtime.vehicle.senses import Senses
from kybflow.world.vehicle_context import VehicleContext

_FALL = 2 * NS
"""For how long a vehicle whose rotors were cut is watched falling."""

_GONE = 10.0
"""Seconds without a word after which nobody knows any more whether its rotors turn."""


class Vehicle(Obeying):
    """The engine calls `sense`, then `act`, once a tick."""

    def __init__(
        self,
        plan: VehiclePlan,
        context: VehicleContext,
        link: Link,
        events: Events,
        observer: VehicleObserver,
        score: VehicleScore,
        sensors: Sequence[Opened] = (),
        bodies: Bodies | None = None,
        fleet: Whereabouts | None = None,
    ) -> None:
        self.plan, self.name, self.context = plan, plan.name, context
        self.now: Time = 0
        self._events, self._observer, self._score = events, observer, score
        self._fleet: dict[str, Estimate | None] = {}
        self._params = {part.label: part.params for part in parts_of(plan)}
        self._supervisors = {p.label: make(p, p.params, context) for p in plan.supervisors}
        self._chain = Chain(plan, context, self._params)
        lines = {part.label: part.at for part in parts_of(plan)}
        self.failsafe = Failsafe(plan.name, self._supervisors, lines, events)
        report = self.failsafe.report
        self.senses = Senses(
            plan, context, link, events, observer, score, report, sensors, bodies, fleet
        )
        self.activity = Activity(plan, self._params, events, score, self._objection)
        super().__init__()

    @property
    def estimate(self) -> Estimate | None:
        return self.senses.estimate

    @property
    def battery(self) -> Battery | None:
        return self.senses.battery

    @property
    def truth(self) -> Truth | None:
        return self.senses.truth

    @property
    def link_error(self) -> str | None:
        """What the link said when it failed, None while it works."""
        return self.senses.link_error

    @property
    def estimator(self) -> str | None:
        """The name of the estimator in use, as the mission calls it."""
        return self.senses.estimation.source

    @property
    def state(self) -> str:
        """The name of the state that it is in."""
        return self.activity.machine.state

    @property
    def rests(self) -> bool:
        """On the ground, in a state that nothing leaves any more, where it is not waited for longer
        to be disarmed than it is heard; or in the hands of somebody else when its run ends, or who
        armed it there."""
        if self.away and self._retired is not None:
            return True
        if self.activity.flight is not GROUND or self._wishes.waiting:
            return False
        is_heard = self.senses.link_age < _GONE
        if is_heard and self.senses.asking.armed and self.senses.asking.taken is None:
            return False
        return not self.falls and not self.activity.state.transitions

    @property
    def falls(self) -> bool:
        """Its rotors were cut just now."""
        return self._cut is not None and self.now - self._cut < _FALL

    def foreseen(self, fleet: dict[str, Estimate | None]) -> list[tuple[str, str, str]]:
        """What would make it leave its mission at once if it flew now: (supervisor, reason, mission
        line)."""
        return self.failsafe.foresee(self._standing()._replace(fleet=fleet))

    def _objection(self) -> str | None:
        """What a supervisor would land it for at once if it took off now, None for nothing."""
        found = self.foreseen(self._fleet)
        return f"`{found[0][0]}` would not let it fly: {found[0][1]}" if found else None

    def begin(self, conditions: Callable[[Expression], Callable[[], bool]]) -> None:
        """Enter the first state."""
        try:
            self.activity.begin(conditions, self.entry)
        except Exception as error:  # see _decided
            self._escalate(error, self._standing())

    def sense(self, now: Time) -> None:
        """Read the link and renew the estimate."""
        self.now = now
        self.senses.update(now, self.airborne)

    def act(self, now: Time, dt: float, fleet: dict[str, Estimate | None]) -> None:
        """Decide, steer, send and record."""
        self._fleet, senses = fleet, self.senses
        tick = self._tick(now, dt, fleet)
        wanted: Setpoint | None = None
        if senses.asking.taken is not None or self.away:
            self._mind_taken(tick)
        if self.away:
            command = HANDED_OVER
        else:
            if self.activity.hold is not None:
                self.activity.wait(dt)
            command, wanted = self._decided(tick)
            command = self._handed(command, now)
        self._sent = command
        if self.activity.grip is not None:
            self._grip(self.activity.grip, now)
        self._observer.tick(now, senses.estimate, wanted, self.followed, command, senses.truth)
        self._observer.estimators(now, senses.estimation)
        self._measure()

    def entry(self) -> Entry:
        """What a behavior is entered with now."""
        thrust, flight, rest = self._hover_thrust(), self.activity.flight, self.senses.rest.lift
        return Entry(self.now, self.context, self.estimate, self.followed, thrust, flight, rest)

    def land(self, reason: str) -> None:
        """Land now, whatever the mission says: an operator's interrupt, or its time is over."""
        self._retired = self._retired or reason
        if not self.rests:
            alarm = Alarm("interrupted", Reaction.LAND, reason)
            self.react(Heard(alarm, ""), self._standing())

    def parameters(self) -> dict[str, Any]:
        """Each part's parameters, by label."""
        return self._params

    def change(self, label: str, parameters: Any) -> None:
        """Give a part its parameters from now on."""
        self._params[label] = parameters
        living = {**self._chain.parts(), **self._supervisors, **self.senses.parts()}
        living[self.activity.state.behavior.label] = self.activity.behavior
        if label in living:
            living[label].params = parameters

    def _standing(self) -> Tick:
        """The tick between two ticks: no time passes, nobody else is seen."""
        return self._tick(self.now, 0.0, {})

    def _tick(self, now: Time, dt: float, fleet: dict[str, Estimate | None]) -> Tick:
        senses = self.senses
        return Tick(
            now,
            dt,
            (now - self.activity.entered) / NS,
            senses.estimate,
            senses.battery,
            self.followed,
            fleet,
            senses.imu,
            senses.link_age,
            senses.cargo.state,
        )

    def _measure(self) -> None:
        """Errors between the setpoint before tracking and the truth (the estimate on hardware)."""
        setpoint, state = self.followed, self.senses.truth or self.senses.estimate
        if setpoint is None or state is None:
            return
        position, velocity = setpoint.position, setpoint.velocity
        self._score.sample(
            None if position is None else distance(position, state.position),
            None if velocity is None else distance(velocity, state.velocity),
        )
