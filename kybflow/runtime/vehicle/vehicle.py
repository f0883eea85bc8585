"""One vehicle, composed of collaborators that each receive only what they may use.

measurements ─► `knowledge` ─► estimate ─► `decision` ─► `control` ─► command ─► `output` ─► link
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from kybflow.core.geometry import Vec3
from kybflow.core.params import named_in
from kybflow.core.signals import (
    NO_INPUTS,
    NO_OBSTACLES,
    NOBODY,
    NS,
    Alarm,
    Battery,
    Estimate,
    Heard,
    InputReadings,
    Reaction,
    SeenObstacles,
    Setpoint,
    Tick,
    Time,
    Truth,
    made,
)
from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import GROUND, Entry, Link
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.broadcasts import Broadcasts
from kybflow.runtime.making import make, parts_of
from kybflow.runtime.monitoring.bodies import Bodies
from kybflow.runtime.monitoring.estimate_history import EstimateHistory
from kybflow.runtime.monitoring.sensing import OpenSensor
from kybflow.runtime.monitoring.tracking_errors import TrackingErrors
from kybflow.runtime.observer import VehicleObserver
from kybflow.runtime.safety.failsafe import Failsafe, RaisedAlarm
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.activity import Activity
from kybflow.runtime.vehicle.arming_watch import ArmingWatch
from kybflow.runtime.vehicle.control import Commanded, Control, OptionSetter
from kybflow.runtime.vehicle.decision import Decision
from kybflow.runtime.vehicle.external_position import ExternalPosition
from kybflow.runtime.vehicle.knowledge import Knowledge
from kybflow.runtime.vehicle.link import LinkHealth, LinkIn, LinkOut
from kybflow.runtime.vehicle.output import HANDED_OVER, RESTING, CommandOutput
from kybflow.runtime.vehicle.override import ManualOverride
from kybflow.runtime.vehicle.reactions import Reactions
from kybflow.runtime.vehicle.requests import Requests
from kybflow.world.vehicle_context import VehicleContext

_ESCALATIONS = 5
"""Attempts to find a command: `go_home`, `land`, `land_blind`, `fault`, and a last one to steer."""
_SINKS = -0.05
"""The vertical speed (m/s) of a setpoint that comes down."""
_STALE = 10.0
"""Seconds without a message after which the reported arming no longer counts."""


class Vehicle:
    """In each tick the engine calls `sense` of every vehicle, then `act` of every vehicle.

    wanted: the setpoint that its behavior asked for in the last tick, before processors; None
    without one, and while the ground carries the vehicle. moving: the moving obstacles.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        context: VehicleContext,
        link: Link,
        events: Events,
        observer: VehicleObserver,
        score: VehicleScore,
        sensors: Sequence[OpenSensor] = (),
        bodies: Bodies | None = None,
        fleet: EstimateHistory | None = None,
        inputs: InputReadings = NO_INPUTS,
        broadcasts: Broadcasts | None = None,
    ) -> None:
        self.plan, self.name, self.context = plan, plan.name, context
        self.now: Time = 0
        self.moving: SeenObstacles = NO_OBSTACLES
        self.wanted: Setpoint | None = None
        self._observer, self._errors, self._inputs = observer, TrackingErrors(score), inputs
        self._broadcasts, self._neighbours = broadcasts, broadcasts or NOBODY
        self._fleet: dict[str, Estimate | None] = {}
        self._params = params = {part.label: part.params for part in parts_of(plan)}
        self._supervisors = {p.label: make(p, p.params, context) for p in plan.supervisors}
        lines = {part.label: part.at for part in parts_of(plan)}
        failsafe = Failsafe(plan.name, self._supervisors, lines, events)
        health = LinkHealth(plan.driver.label, failsafe.report)
        link_in, link_out = LinkIn(plan, link, health, events, score), LinkOut(plan, link, health)
        knowledge = Knowledge(
            plan, context, link_in, events, observer, score, failsafe.report,
            lambda: self.airborne, sensors, bodies, fleet,
        )  # fmt: skip
        activity = Activity(
            plan, params, events, score, self.entry, self._objection, failsafe.is_latched,
            lambda: link_out.override is not None and link_out.override.lands,
        )  # fmt: skip
        output = CommandOutput(
            plan, link_out, activity, knowledge.payload, knowledge.resting, events
        )
        reactions = Reactions(plan, activity, failsafe, link_out, output, events, score)
        control = Control(plan, context, params, activity, reactions, output, events)
        arming = ArmingWatch(plan, link_out, activity, reactions, output, events, score)
        override = ManualOverride(
            plan, link_out, activity, failsafe, reactions, control, arming, events, score
        )
        self.requests = Requests(plan, link_out, activity, failsafe, reactions, override, events)
        self._decision = Decision(
            activity, failsafe, reactions, self.requests, control, output, knowledge
        )
        self.knowledge, self.activity, self.failsafe = knowledge, activity, failsafe
        self.link_out = link_out
        self._control, self._output, self._reactions = control, output, reactions
        self._override, self._arming, self._health = override, arming, health
        self._external_position = ExternalPosition(plan, knowledge.estimation)

    @property
    def estimate(self) -> Estimate | None:
        """The estimate that the vehicle flies on, None without one."""
        return self.knowledge.estimate

    @property
    def battery(self) -> Battery | None:
        return self.knowledge.battery

    @property
    def truth(self) -> Truth | None:
        """The simulator's ground truth, None on hardware."""
        return self.knowledge.link_in.truth

    @property
    def followed(self) -> Setpoint | None:
        """The setpoint that the tracker followed last, None while there is none."""
        return self._control.followed

    def use_options(self, set_option: OptionSetter) -> None:
        """Let its processors retune its tracker through `set_option`, that of the options."""
        self._control.set_option = set_option

    @property
    def link_error(self) -> str | None:
        """The error with which the link failed, None while it works."""
        return self._health.error

    @property
    def link_age(self) -> float:
        """Seconds since the vehicle's last message."""
        return self._health.age

    @property
    def estimator(self) -> str | None:
        """The mission's name of the estimator in use."""
        return self.knowledge.estimation.source

    @property
    def state(self) -> str:
        """The name of the active state."""
        return self.activity.machine.state

    @property
    def airborne(self) -> bool:
        """Whether the rotors turn and the vehicle is not on the ground."""
        return self._reactions.airborne

    @property
    def may_touch_down(self) -> bool:
        """Whether the ground is where the vehicle should come to now: it is there by its own state,
        it comes down to land, or somebody else has it. Until it descends, and while it is held, a
        vehicle that lands flies like any other."""
        activity, link = self.activity, self.link_out
        if not activity.off_ground or activity.land_mode is not None or link.override is not None:
            return True
        wanted = self._control.followed
        sinks = wanted is None or wanted.velocity is None or wanted.velocity[2] < _SINKS
        return activity.leg.end is GROUND and sinks

    @property
    def rests(self) -> bool:
        """Whether nothing in this run will move the vehicle again: it is on the ground in a final
        state and doesn't report itself armed; or the run ends while a pilot has control of it."""
        if self._override.away and self.requests.retired is not None:
            return True
        if self.activity.flight is not GROUND or self.requests.waiting:
            return False
        if self.link_age < _STALE and self.link_out.armed and self.link_out.override is None:
            return self._arming.gave_up
        return not self._reactions.falls(self.now) and not self.activity.state.transitions

    def begin(self, conditions: Callable[[Expression], Callable[[], bool]]) -> None:
        """Enter the first state."""
        try:
            self.activity.begin(conditions)
        except Exception as error:  # a part may raise anything; it fails this vehicle alone
            self._reactions.react_to_failure(*self._control.blame(error), self._standing())

    def sense(self, now: Time) -> Estimate | None:
        """Read the link, and update and return the estimate."""
        self.now = now
        estimate = self.knowledge.update(now)
        if self.link_out.tells_position:
            position = self._external_position.of(estimate)
            if position is not None:
                self.link_out.tell_position(position, now)
        return estimate

    def act(self, now: Time, dt: float, fleet: dict[str, Estimate | None]) -> None:
        """Decide, steer, send and record."""
        self._fleet = fleet
        tick = self._tick(now, dt, fleet)
        override, armed = self._override, self.link_out.armed
        if armed is not None and self._arming.update(tick, armed):
            override.away = False
        elif override.away or self.link_out.override is not None:
            override.update(tick, self._decision.answer)
        if override.away:
            command, wanted = HANDED_OVER, None
            self._output.sent = command
        else:
            try:
                tick = self._decision.decide(tick)
                command, wanted = self._control.steer(tick) or self._resteered(tick)
            except Exception as error:  # a part may raise anything; it fails this vehicle alone
                command, wanted = self._commanded_after(error, tick)
            command = self._output.deliver(command, now)
        if self.activity.grip is not None:
            self._output.grip(self.activity.grip, now)
        knowledge, activity, control = self.knowledge, self.activity, self._control
        estimate, truth = knowledge.estimate, knowledge.link_in.truth
        self._observer.tick(
            now, estimate, wanted, control.followed, command, truth, knowledge.estimation
        )
        self.wanted = self._errors.update(
            now, wanted, truth or estimate, activity.flight, activity.leg
        )

    def _commanded_after(self, failure: Exception, tick: Tick) -> Commanded:
        """Return the command of a tick in which a part failed, whichever parts fail then."""
        for _ in range(_ESCALATIONS + len(self.plan.processors)):
            try:
                self._reactions.react_to_failure(*self._control.blame(failure), tick)
                return self._resteered(tick)
            except Exception as error:  # the next attempt does without the part that raised
                failure = error
        return RESTING, None

    def _resteered(self, tick: Tick) -> Commanded:
        """Steer after a change of state, and after every further one, until there is a command."""
        commanded = None
        while commanded is None:
            tick = self._decision.settle(tick)
            commanded = self._control.steer(tick)
        return commanded

    @property
    def publishes(self) -> bool:
        """Whether any vehicle listens to what others publish."""
        return self._broadcasts is not None

    def publish(self) -> None:
        """Publish what neighbours may hear from the next tick on, and record what the behavior
        says."""
        broadcasts, rig = self._broadcasts, self.knowledge.link_in.rig
        if broadcasts is None or (rig is not None and rig.silent):
            return
        said = self.activity.behavior.says if self.activity.begun else None
        if said is not None and said.time == self.now:
            self._observer.measurement(self.now, said)
        broadcasts.note(self.name, Heard(self.now, self.estimate, self.followed, said))

    def entry(self) -> Entry:
        """Return the conditions in which a behavior would be entered now."""
        thrust, flight = self._control.hover_thrust(), self.activity.flight
        lift = self.knowledge.resting.specific_force
        estimate, followed = self.estimate, self.followed
        return Entry(
            self.now, self.context, estimate, followed, thrust, flight, lift, self._inputs
        )  # fmt: skip

    def pushes(self) -> Iterator[tuple[str, Vec3 | None]]:
        """Yield each input that steers it now, with what the hand should feel, None
        while it is held."""
        part, hold = self.activity.state.behavior, self.activity.hold
        for name in named_in(part.params, "input").values():
            yield name, self.activity.behavior.push if hold is None else None

    def foreseen(self, fleet: dict[str, Estimate | None]) -> list[tuple[str, str, str]]:
        """Return each (supervisor, reason, mission line) that would end the mission at once if the
        vehicle flew now."""
        return self.failsafe.foresee(self._standing()._replace(fleet=fleet))

    def land(self, reason: str) -> None:
        """Land now, whatever the mission says, after an interrupt or at the time limit."""
        self.requests.retired = self.requests.retired or reason
        if not self.rests:
            alarm = Alarm("interrupted", Reaction.LAND, reason)
            self._reactions.react(RaisedAlarm(alarm, ""), self._standing())

    def parameters(self) -> dict[str, Any]:
        """Return each part's parameters, by label."""
        return self._params

    def change(self, label: str, name: str, value: Any) -> None:
        """Replace the value of one of a part's parameters, also where it is at work; the other
        values that a behavior was entered with stay."""
        self._params[label] = replace(self._params[label], **{name: value})
        living = {**self._control.parts(), **self._supervisors, **self.knowledge.parts()}
        living[self.activity.state.behavior.label] = self.activity.behavior
        if label in living:
            living[label].params = replace(living[label].params, **{name: value})

    def _objection(self) -> str | None:
        """Return why a supervisor would end the flight right after take-off, None if none would."""
        found = self.foreseen(self._fleet)
        return f"`{found[0][0]}` would not let it fly: {found[0][1]}" if found else None

    def _standing(self) -> Tick:
        """Return a tick of zero duration, without the other vehicles."""
        return self._tick(self.now, 0.0, {})

    def _tick(self, now: Time, dt: float, fleet: dict[str, Estimate | None]) -> Tick:
        knowledge = self.knowledge
        elapsed, followed = (now - self.activity.entered) / NS, self._control.followed
        estimate, battery, imu = knowledge.estimate, knowledge.battery, knowledge.imu
        health, payload = self._health, knowledge.payload.state
        return made(
            Tick,
            (
                now, dt, elapsed, estimate, battery, followed, fleet, imu, health.age, health.delay,
                payload, self._inputs, self._neighbours, self.moving,
            ),
        )  # fmt: skip
