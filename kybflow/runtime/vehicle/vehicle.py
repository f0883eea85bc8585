"""One vehicle, composed of objects that each receive only the data they may use.

measurements ─► `knowledge` ─► estimate ─► `decision` ─► `control` ─► command ─► `link`
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from kybflow.core.geometry import Vec3
from kybflow.core.params import named_in
from kybflow.core.signals import (
    NO_INPUTS,
    NO_OBJECTS,
    NO_OBSTACLES,
    Alarm,
    Battery,
    Estimate,
    InputReadings,
    NeighbourState,
    Reaction,
    SeenObjects,
    SeenObstacles,
    Setpoint,
    Time,
    Truth,
)
from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import GROUND, Link, TeamMember
from kybflow.parts.link import Touch
from kybflow.runtime.events import Events, VehicleObserver
from kybflow.runtime.fleet.broadcasts import Broadcasts
from kybflow.runtime.making import make
from kybflow.runtime.monitoring.bodies import Bodies
from kybflow.runtime.monitoring.cameras import EstimateHistory
from kybflow.runtime.monitoring.sensing import OpenSensor
from kybflow.runtime.monitoring.tracking_errors import TrackingErrors
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.behavior_runner import BehaviorRunner
from kybflow.runtime.vehicle.control import Control, OptionSetter
from kybflow.runtime.vehicle.decision import Decision
from kybflow.runtime.vehicle.estimation import ExternalPosition
from kybflow.runtime.vehicle.failsafe import Failsafe, RaisedAlarm, Reactions
from kybflow.runtime.vehicle.knowledge import Knowledge, TickBuilder
from kybflow.runtime.vehicle.link import LinkGuard, LinkIn, LinkOut
from kybflow.runtime.vehicle.override import ArmingWatch, ManualOverride
from kybflow.runtime.vehicle.requests import EntryJudge, NoJudge, Requests
from kybflow.world.vehicle_context import VehicleContext

_SINK_SPEED = -0.05
"""The vertical velocity (m/s) below which a setpoint counts as descending."""
_REPORT_AGE_S = 10.0
"""Seconds without a measurement after which the vehicle's last report of being armed is ignored."""


class Vehicle:
    """A vehicle. In each tick the engine first calls `sense` of every vehicle, then `act` of every
    vehicle.

    wanted: the behavior's setpoint in the last tick, before the processors; None without one, and
    while the vehicle stands on the ground.
    set_option: requests a change of an option.
    judge: checks the values with which people and flows request states.
    moving, objects: the moving obstacles and the objects that have been seen.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        context: VehicleContext,
        link: Link,
        events: Events,
        observer: VehicleObserver,
        score: VehicleScore,
        set_option: OptionSetter,
        judge: EntryJudge | None = None,
        sensors: Sequence[OpenSensor] = (),
        bodies: Bodies | None = None,
        fleet: EstimateHistory | None = None,
        inputs: InputReadings = NO_INPUTS,
        broadcasts: Broadcasts | None = None,
        moving: SeenObstacles = NO_OBSTACLES,
        objects: SeenObjects = NO_OBJECTS,
    ) -> None:
        self.plan, self.name, self.context = plan, plan.name, context
        self.moving, self.objects = moving, objects
        self.score = score
        self.wanted: Setpoint | None = None
        self._observer, self._errors = observer, TrackingErrors(score)
        self._broadcasts = broadcasts
        self._params = params = {part.label: part.params for part in plan.parts}
        self._supervisors = {p.label: make(p, p.params, context) for p in plan.supervisors}
        lines = {part.label: part.at for part in plan.parts}
        failsafe = Failsafe(plan.name, self._supervisors, lines, events)
        guard = LinkGuard(plan.driver.label, failsafe.report, observer)
        link_in = LinkIn(plan, link, guard, events, score)
        link_out = LinkOut(plan, link, guard, link_in)
        knowledge = Knowledge(
            plan, context, link_in, events, observer, score, failsafe.report, sensors, bodies, fleet
        )
        control = Control(plan, context, params, set_option, events)
        ticks = TickBuilder(
            context, knowledge, control, link_out, inputs, broadcasts, moving, objects
        )
        runner = BehaviorRunner(
            plan, params, ticks, failsafe.foresee, failsafe.is_latched, link_out, events, score
        )
        reactions = Reactions(plan, runner, failsafe, link_out, score)
        arming = ArmingWatch(plan, link_out, runner, reactions, events, score)
        override = ManualOverride(
            plan, link_out, runner, failsafe, reactions, control, arming, events, score
        )
        self.requests = requests = Requests(
            plan, link_out, runner, failsafe, reactions, override, judge or NoJudge(), events
        )
        self._decision = Decision(
            plan, runner, failsafe, reactions, requests, control, link_out, knowledge, events
        )
        self.knowledge, self.runner, self.failsafe = knowledge, runner, failsafe
        self.link_out = link_out
        self._ticks, self._control, self._reactions = ticks, control, reactions
        self._override, self._arming, self._guard = override, arming, guard
        self._external_position = ExternalPosition(plan, knowledge.estimation)

    @property
    def now(self) -> Time:
        """The time of the newest measurements."""
        return self.knowledge.now

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
        """The setpoint that the tracker follows, or None."""
        return self._control.followed

    @property
    def link_error(self) -> str | None:
        """The error with which the link failed, None while it works."""
        return self._guard.error

    @property
    def link_age(self) -> float:
        """Seconds since the vehicle's last measurement."""
        return self.knowledge.link_in.age

    @property
    def estimator(self) -> str | None:
        """The mission's name of the estimator in use."""
        return self.knowledge.estimation.source

    @property
    def state(self) -> str:
        """The name of the active state."""
        return self.runner.machine.state

    @property
    def airborne(self) -> bool:
        """Whether the vehicle is off the ground and its rotors turn (`Reactions.airborne`)."""
        return self._reactions.airborne

    @property
    def touches(self) -> str:
        """The object that its behavior means to touch, empty for none."""
        return self.runner.touches

    @property
    def may_touch_down(self) -> bool:
        """Whether the vehicle may touch the ground now: it is on the ground, it descends in order
        to land, it is in its own land mode, or a pilot or another program has control. A landing
        vehicle may not touch the ground before its descent begins or while it is held."""
        runner, link = self.runner, self.link_out
        if not runner.off_ground or runner.land_mode is not None or link.override is not None:
            return True
        wanted = self._control.followed
        sinks = wanted is None or wanted.velocity is None or wanted.velocity[2] < _SINK_SPEED
        return runner.leg.end is GROUND and sinks

    @property
    def rests(self) -> bool:
        """Whether this run will not move the vehicle again: the vehicle is on the ground in a final
        state and doesn't report itself armed, or the run ends while a pilot has control."""
        if self._override.away and self.requests.retired is not None:
            return True
        if self.runner.off_ground or self.requests.waiting:
            return False
        if self.link_age < _REPORT_AGE_S and self.link_out.armed and self.link_out.override is None:
            return self._arming.gave_up
        return not self._reactions.falls(self.now) and not self.runner.state.transitions

    def begin(self, conditions: Callable[[Expression], Callable[[], bool]]) -> None:
        """Enter the first state."""
        try:
            self.runner.begin(conditions)
        except Exception as error:  # a part may raise anything; it fails this vehicle alone
            self._decision.fail(error, self._ticks.standing(self.runner.entered, {}))

    def sense(self, now: Time) -> Estimate | None:
        """Read the link, and update and return the estimate."""
        in_land_mode = self.runner.land_mode is not None
        estimate = self.knowledge.update(now, self._reactions.airborne, in_land_mode)
        if self.link_out.tells_position and not self._is_misled:
            position = self._external_position.of(estimate)
            if position is not None:
                self.link_out.tell_position(position, now)
        return estimate

    @property
    def _is_misled(self) -> bool:
        """Whether the vehicle lands blind because its positions are wrong."""
        is_wrong = self.knowledge.frame.wrong is not None
        return is_wrong and self.failsafe.latched is Reaction.LAND_BLIND

    def act(self, now: Time, dt: float, fleet: dict[str, Estimate | None]) -> None:
        """Decide what to do in this tick, compute and send the command, and record the tick."""
        runner = self.runner
        tick = self._ticks.tick(now, dt, runner.entered, fleet, runner.touches)
        if self._override.update(tick, self._decision.answer):
            command, wanted = self.link_out.hand_over(), None
        else:
            command, wanted = self._decision.act(tick)
        knowledge, followed = self.knowledge, self._control.followed
        estimate, truth = knowledge.estimate, knowledge.link_in.truth
        self._observer.tick(now, estimate, wanted, followed, command, truth, knowledge.estimation)
        self.wanted = self._errors.update(now, wanted, truth or estimate, runner.flight, runner.leg)

    def note_touch(self, touch: Touch) -> None:
        """Record a contact that the vehicle's simulator reports."""
        self._observer.answer(self.now, "touch", touch)

    @property
    def publishes(self) -> bool:
        """Whether the vehicle publishes its state, because some vehicle uses it."""
        return self._broadcasts is not None

    def publish(self) -> None:
        """Publish the estimate, the setpoint and the behavior's message to the neighbours, who
        receive them from the next tick on. Record the message."""
        broadcasts, faults = self._broadcasts, self.knowledge.link_in.faults
        if broadcasts is None or (faults is not None and faults.silent):
            return
        said = self.runner.behavior.says if self.runner.begun else None
        if said is not None and said.time == self.now:
            self._observer.measurement(self.now, said)
        broadcasts.note(self.name, NeighbourState(self.now, self.estimate, self.followed, said))

    def pushes(self) -> Iterator[tuple[str, Vec3 | None]]:
        """Yield each input device that steers the vehicle now, with the force that the device
        should exert on the hand; None while the vehicle is held."""
        part, hold = self.runner.state.behavior, self.runner.hold
        for name in named_in(part.params, "input").values():
            yield name, self.runner.behavior.push if hold is None else None

    def take_share(self, share: float | None) -> None:
        """Take what the flow's coordinator gives this vehicle for the next tick."""
        self._ticks.share = share

    def as_member(self) -> TeamMember:
        """Return the vehicle as its flow's coordinator sees it."""
        behavior, runner = self.runner.behavior, self.runner
        pushes = None
        if runner.hold is None and runner.land_mode is None:
            pushes, _ = behavior.pushes(behavior.params) or (None, None)
        return TeamMember(self.estimate, pushes)

    def foreseen(self, fleet: dict[str, Estimate | None]) -> list[tuple[str, str, str]]:
        """Return (supervisor, reason, mission line) of each alarm that would end the mission at
        once if the vehicle flew now. fleet: the estimates of all vehicles."""
        return self.runner.foreseen(fleet)

    def land(self, reason: str) -> None:
        """Land now, regardless of the mission: after an interrupt or at the time limit."""
        self.requests.note_end(f"the run ends: {reason}")
        if not self.rests:
            alarm = Alarm("interrupted", Reaction.LAND, reason)
            standing = self._ticks.standing(self.runner.entered, {})
            self._reactions.react(RaisedAlarm(alarm, ""), standing)

    def parameters(self) -> dict[str, Any]:
        """Return each part's parameters, by label."""
        return self._params

    def change(self, label: str, name: str, value: Any) -> None:
        """Replace the value of a part's parameter, also in the running part. An active behavior
        keeps its other values, even those given only for this visit."""
        self._params[label] = replace(self._params[label], **{name: value})
        living = {**self._control.parts(), **self._supervisors, **self.knowledge.parts()}
        living[self.runner.state.behavior.label] = self.runner.behavior
        if label in living:
            living[label].params = replace(living[label].params, **{name: value})
