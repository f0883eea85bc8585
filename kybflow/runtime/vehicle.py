"""One vehicle, built from the plan.

measurements ─► estimation ─► estimate
supervisors ─► transition? ─► behavior ─► setpoint ─► processors ─► tracker ─► command ─► link
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import PartPlan, VehiclePlan
from kybflow.geometry import LEVEL, ZERO, Vec3, distance
from kybflow.parts import AIR, GROUND, Entry, Link
from kybflow.runtime.activity import Activity
from kybflow.runtime.chain import Chain
from kybflow.runtime.estimation import Estimation
from kybflow.runtime.events import Events
from kybflow.runtime.failsafe import Failsafe
from kybflow.runtime.outcome import VehicleScore
from kybflow.runtime.recorder import VehicleChannel
from kybflow.signals import (
    NS,
    Alarm,
    Battery,
    Command,
    Estimate,
    Measurement,
    Reaction,
    Setpoint,
    SetpointKind,
    Tick,
    Time,
    Truth,
)
from kybflow.site import Site

RESTING = Command(LEVEL, 0.0, ZERO, None, False)
"""What a vehicle on the ground is sent: rotors at rest."""
_MOST_FAILURES = 4
"""A failing part leads to `land`, then `land_blind`, then `fault`, all in one tick at worst."""


class Vehicle:
    """The engine calls `sense`, then `act`, once a tick.

    `followed` is the setpoint that the tracker followed last, None while there is none.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        site: Site,
        link: Link,
        events: Events,
        channel: VehicleChannel,
        score: VehicleScore,
    ) -> None:
        self.plan, self.name, self.site = plan, plan.name, site
        self.now: Time = 0
        self.estimate: Estimate | None = None
        self.battery: Battery | None = None
        self.truth: Truth | None = None
        self.followed: Setpoint | None = None
        self._link, self._events, self._channel, self._score = link, events, channel, score
        self._params = {part.label: part.params for part in _parts(plan)}
        self._estimation = Estimation(plan.estimators, site)
        self._source: str | None = None
        self._supervisors = {p.label: p.cls(p.params, site) for p in plan.supervisors}
        self._chain = Chain(plan, site, self._params)
        self.failsafe = Failsafe(plan.name, tuple(self._supervisors.values()), events)
        self.activity = Activity(plan, self._params, events, score)

    @property
    def rests(self) -> bool:
        """On the ground, in a state that nothing leaves any more."""
        return not self.activity.airborne and not self.activity.state.transitions

    def begin(self, conditions: Callable[[Expression], Callable[[], bool]]) -> None:
        """Enter the first state."""
        self.activity.begin(conditions, self.entry)

    def sense(self, now: Time) -> None:
        """Read the link and renew the estimate."""
        self.now = now
        measurements = self._link.read(now)
        for measurement in measurements:
            self._channel.measurement(now, measurement)
            if type(measurement) is Battery:
                self.battery = measurement
                self._score.battery(measurement.remaining)
        self.truth = self._link.truth()
        try:
            self._renew_estimate(measurements, now)
        except Exception as error:  # a part may raise anything; it fails this vehicle and no other
            self.estimate = None
            self._events.tell("part_failed", self.name, part="estimators", reason=_words(error))

    def act(self, now: Time, dt: float, fleet: dict[str, Estimate | None]) -> None:
        """Decide, steer, send and record."""
        elapsed = (now - self.activity.entered) / NS
        tick = Tick(now, dt, elapsed, self.estimate, self.battery, self.followed, fleet)
        command, wanted = RESTING, None
        for _ in range(_MOST_FAILURES):
            try:
                tick = self._decide(tick)
                command, wanted = self._steer(tick)
                break
            except Exception as error:  # a part may raise anything; see sense
                self._part_failed(error, tick)
        self._link.send(command, now)
        self._channel.tick(now, self.estimate, wanted, self.followed, command, self.truth)
        self._measure()

    def entry(self) -> Entry:
        """What a behavior is entered with now."""
        on_ground = not self.activity.airborne
        thrust = self.site.airframe.hover_thrust if on_ground else self._chain.tracker.hover_thrust
        flight = self.activity.flight
        return Entry(self.now, self.site, self.estimate, self.followed, thrust, flight)

    def react(self, alarm: Alarm, tick: Tick) -> bool:
        """Let the failsafe decide about an alarm; whether the vehicle now does something else."""
        activity = self.activity
        goal = self.failsafe.decide(alarm, tick, activity.airborne, activity.machine.state)
        if goal is not None:
            activity.go(goal, self.entry)
        return goal is not None

    def land(self, reason: str) -> None:
        """Land now, whatever the mission says: an operator's interrupt."""
        tick = Tick(self.now, 0.0, 0.0, self.estimate, self.battery, self.followed, {})
        self.react(Alarm("interrupted", Reaction.LAND, reason, 0.0, 0.0), tick)

    def parameters(self) -> dict[str, Any]:
        """Each part's parameters, by label."""
        return self._params

    def change(self, label: str, parameters: Any) -> None:
        """Give a part its parameters from now on."""
        self._params[label] = parameters
        living = {**self._chain.parts(), **self._supervisors}
        living[self.activity.state.behavior.label] = self.activity.behavior
        if label in living:
            living[label].params = parameters

    def _renew_estimate(self, measurements: Sequence[Measurement], now: Time) -> None:
        estimate = self._estimation.update(measurements, now)
        if estimate is not None and not _finite(estimate.position):
            raise ValueError("the estimate is not finite")
        self.estimate = estimate
        source = estimate.source if estimate is not None else None
        if source == self._source:
            return
        previous, self._source = self._source, source
        if source is None:
            self._events.tell("estimate_lost", self.name, previous=previous)
        else:
            self._events.tell("estimator_changed", self.name, estimator=source, previous=previous)
            self._score.estimator(source, now / NS)

    def _decide(self, tick: Tick) -> Tick:
        """Supervisors are heard first, then the mission's own arrows."""
        activity = self.activity
        self._chain.stage = "supervisors"
        alarm = self.failsafe.check(tick, activity.airborne)
        if alarm is not None:
            self.react(alarm, tick)
        activity.step(tick, self.failsafe.latched is not None, self.entry)
        return self._settled(tick) if activity.changed else tick

    def _settled(self, tick: Tick) -> Tick:
        """Make the chain fit the state that was entered; the tick as the new behavior sees it."""
        activity = self.activity
        activity.changed = False
        if activity.leg.start is GROUND and activity.leg.end is AIR:
            self._chain = Chain(self.plan, self.site, self._params)
        self._chain.select(activity.stays_in_air)
        return tick._replace(elapsed=0.0)

    def _steer(self, tick: Tick) -> tuple[Command, Setpoint | None]:
        """(the command of this tick, the setpoint before processing)."""
        activity = self.activity
        if tick.estimate is None and activity.behavior.needs_estimate:
            return self._without_estimate(), None
        self._chain.stage = activity.state.behavior.label
        output = activity.update(tick)
        if isinstance(output, Command):
            self.followed = None
            return _checked(output), None
        if output.kind is SetpointKind.IDLE:
            self.followed = None
            return RESTING, output
        if output.position is not None and not _finite(output.position):
            raise ValueError("the setpoint is not finite")
        result = self._chain.follow(output, tick, self._heed)
        if result is None:
            return self._steer(self._settled(tick))
        self.followed, command = result
        return _checked(command), output

    def _heed(self, alarm: Alarm, tick: Tick) -> bool:
        self.failsafe.tell(alarm, tick.now)
        return self.react(alarm, tick)

    def _without_estimate(self) -> Command:
        """Level at hover thrust until the supervisor has decided; at rest on the ground."""
        self.followed = None
        if not self.activity.airborne:
            return RESTING
        return Command(LEVEL, self._chain.tracker.hover_thrust, ZERO, None)

    def _part_failed(self, error: Exception, tick: Tick) -> None:
        """Event and failsafe in the tick in which the part raised: land; land blind when what a
        landing needs has failed; rotors at rest when even that has."""
        where, state, at = self._chain.stage, self.activity.machine.state, self.activity.state.at
        self._events.tell("part_failed", self.name, at, part=where, reason=_words(error))
        self.activity.fail(_words(error))
        if state == "land_blind" or not self.activity.airborne:
            self.activity.flight = GROUND
            self.activity.go("fault", self.entry)
            return
        own_behavior = where == self.activity.state.behavior.label and state != "auto_land"
        reaction = Reaction.LAND if own_behavior else Reaction.LAND_BLIND
        self.react(Alarm("part_failed", reaction, _words(error), 0.0, 0.0), tick)

    def _measure(self) -> None:
        """Errors between the setpoint before tracking and the truth (the estimate on hardware)."""
        setpoint, state = self.followed, self.truth or self.estimate
        if setpoint is None or state is None:
            return
        position, velocity = setpoint.position, setpoint.velocity
        self._score.sample(
            None if position is None else distance(position, state.position),
            None if velocity is None else distance(velocity, state.velocity),
        )


def _parts(plan: VehiclePlan) -> list[PartPlan]:
    return [
        *(estimator.part for estimator in plan.estimators),
        *plan.processors,
        plan.tracker,
        *plan.supervisors,
        *(state.behavior for state in plan.states.values()),
    ]


def _finite(v: Vec3) -> bool:
    total = v[0] + v[1] + v[2]
    return total - total == 0.0


def _checked(command: Command) -> Command:
    """The command; raises ValueError when a number in it is not finite."""
    q, r = command.attitude, command.rates
    total = q[0] + q[1] + q[2] + q[3] + command.thrust + r[0] + r[1] + r[2]
    if total - total != 0.0:
        raise ValueError(f"the command is not finite: {command}")
    return command


def _words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
