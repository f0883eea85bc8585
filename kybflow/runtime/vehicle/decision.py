"""Decides what a vehicle does in a tick. The supervisors come first, then requests, then the
mission's transitions; then the behavior of the resulting state gives the command, which is sent.

A vehicle can be landed, in order of priority, by its supervisors (`Failsafe.decide` chooses the
reaction to an alarm, `Reactions.react` carries it out), by a part that failed
(`Reactions.react_to_failure`), by a person, flow or callback (`Requests`), and by the mission
(`BehaviorRunner.step`).
"""

from __future__ import annotations

from kybflow.core.errors import Refused
from kybflow.core.signals import Alarm, Command, Reaction, Tick, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import AIR, GROUND
from kybflow.parts.events import ArmingRefused, LandModeRefused
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.behavior_runner import BehaviorRunner
from kybflow.runtime.vehicle.control import Commanded, Control
from kybflow.runtime.vehicle.failsafe import Failsafe, RaisedAlarm, Reactions
from kybflow.runtime.vehicle.knowledge import Knowledge
from kybflow.runtime.vehicle.link import HANDED_OVER, RESTING, LinkOut
from kybflow.runtime.vehicle.requests import Requests

_ESCALATIONS = 5
"""Attempts to compute a command: in `go_home`, `land`, `land_blind` and `fault`, and one more."""


class Decision:
    """Changes the state of the behavior runner, and adapts the processors, measurements and
    estimators to each state that is entered."""

    def __init__(
        self,
        plan: VehiclePlan,
        runner: BehaviorRunner,
        failsafe: Failsafe,
        reactions: Reactions,
        requests: Requests,
        control: Control,
        link: LinkOut,
        knowledge: Knowledge,
        events: Events,
    ) -> None:
        self._plan, self._runner, self._failsafe = plan, runner, failsafe
        self._reactions, self._requests, self._control = reactions, requests, control
        self._link, self._knowledge, self._events = link, knowledge, events
        self._resting = knowledge.resting
        self._settled = 0

    def act(self, tick: Tick) -> Commanded:
        """Decide, and send the command of this tick, even if a part raises. Return the command that
        was sent, and the behavior's setpoint."""
        try:
            tick = self._decide(tick)
            command, wanted = self._steer(tick) or self._resteered(tick)
        except (Exception, SystemExit) as error:  # it fails this vehicle alone
            command, wanted = self._without(error, tick)
        runner = self._runner
        if runner.behavior.lets_go:
            command = HANDED_OVER
        try:
            command = self._link.deliver(command, tick.now)
        except Refused as refusal:
            command = self._unarmed(str(refusal), tick)
        turns = command.armed or self._link.armed is True
        if turns is not self._resting.rotors_turn and command is not HANDED_OVER:
            self._resting.turn(turns)
            self._knowledge.late = 0.0
        if runner.grip is not None:
            self._grip(tick.now)
        return command, wanted

    def _without(self, failure: BaseException, tick: Tick) -> Commanded:
        """Return the command of this tick without the part that raised `failure`."""
        for _ in range(_ESCALATIONS + len(self._plan.processors)):
            try:
                self.fail(failure, tick)
                return self._resteered(tick)
            except (Exception, SystemExit) as error:  # the next attempt is without the part
                failure = error
        return (RESTING if self._runner.land_mode is None else HANDED_OVER), None

    def _unarmed(self, reason: str, tick: Tick) -> Command:
        """Return the command of this tick for a vehicle whose arming failed. On the ground, the
        behavior is refused. A vehicle that has lifted off meanwhile lands. If its own failsafe or a
        pilot took it while its rotors turned, `ManualOverride` handles it in the next tick."""
        runner, link = self._runner, self._link
        is_taken = link.arming is not None and link.override is not None
        if self._reactions.airborne and not is_taken:
            lost = Alarm("control_lost", Reaction.LAND, reason, is_failure=True)
            self._reactions.react(RaisedAlarm(lost, runner.state.at), tick)
        elif not (is_taken and link.armed):
            self._events.emit(ArmingRefused(reason=reason), self._plan.name, runner.state.at)
            runner.refuse(reason)
            return RESTING
        return link.hand_over()

    def _grip(self, now: Time) -> None:
        """Open or close the payload's servo if the behavior requests it and it is necessary. If
        the vehicle refuses, the behavior fails."""
        runner = self._runner
        asked = runner.take_grip()
        try:
            payload = self._knowledge.payload
            if asked is not None and payload.wants(asked.is_open, now, runner.state.at):
                self._link.grip(asked.is_open, now)
        except Refused as refusal:
            runner.fail(str(refusal))

    def answer(self, now: Time) -> None:
        """Answer the waiting requests."""
        if self._requests.waiting:
            self._requests.answer(now)
            self._select()

    def _decide(self, tick: Tick) -> Tick:
        """Decide on the state; return the tick for its behavior."""
        runner, failsafe = self._runner, self._failsafe
        if runner.hold is not None:
            runner.wait(tick.dt)
        if tick.now >= failsafe.due:
            is_lifted = tick.wrong_frame is not None and self._reactions.airborne
            raised = failsafe.check(tick, is_lifted or runner.off_ground)
            if raised is not None:
                self._knowledge.late = raised.alarm.late or self._knowledge.late
                self._reactions.react(raised, tick)
        if failsafe.latched is Reaction.LAND_BLIND:
            self._reactions.regain_sight(tick)
        if runner.entries != self._settled:
            tick = self._settle(tick)
        if self._requests.waiting:
            self.answer(tick.now)
        if runner.hold is not None:
            self._reactions.update_hold(tick)
        elif runner.entries == self._settled:
            runner.step(tick)
        return tick if runner.entries == self._settled else self._settle(tick)

    def _settle(self, tick: Tick) -> Tick:
        """Adapt processors, measurements and estimators to the state that was entered; return the
        tick for its behavior."""
        runner = self._runner
        self._settled = runner.entries
        self._link.cancel_arming()
        if runner.leg.start is GROUND and runner.leg.end is AIR:
            self._control.renew()
        self._select()
        self._knowledge.link_in.subscribe(runner.state.behavior.cls.needs)
        self._knowledge.estimation.prefer(runner.state.estimators)
        return tick._replace(elapsed=0.0)

    def _select(self) -> None:
        self._control.select(self._requests.off, in_air=self._runner.stays_in_air)

    def _steer(self, tick: Tick) -> Commanded | None:
        """Return the command of this tick, or None if the state changed and `_steer` must be called
        again. Raises any exception of a part."""
        runner, control = self._runner, self._control
        if control.clamps.active:
            control.clamps.settle(tick.now)
        if self._link.arming is not None:
            runner.wait(tick.dt)
            return control.again(self._link.arming, tick), None
        if runner.land_mode is not None:
            control.rest()
            try:
                landed = runner.has_landed(tick.now, tick.sound_estimate)
            except Refused as refusal:  # the current state lands it
                refused = LandModeRefused(reason=str(refusal))
                self._events.emit(refused, self._plan.name, self._plan.driver.at)
                runner.enter_built_in(runner.machine.state)
                return None
            return (RESTING if landed else HANDED_OVER), None
        if tick.estimate is None and runner.behavior.needs_estimate:
            if runner.off_ground and self._reactions.lost_estimate(tick):
                return None  # `followed` stays: the next behavior begins at its speed
            control.rest()
            if not runner.off_ground:
                return RESTING, None
        asked = runner.update(tick)
        return control.follow(asked, tick, self._reactions, runner.off_ground)

    def _resteered(self, tick: Tick) -> Commanded:
        """Return the command of this tick after one or more changes of state."""
        commanded = None
        while commanded is None:
            if self._runner.entries != self._settled:
                tick = self._settle(tick)
            commanded = self._steer(tick)
        return commanded

    def fail(self, error: BaseException, tick: Tick) -> None:
        """React to an exception that a part raised."""
        behavior = self._runner.state.behavior.label
        failure, is_needed = self._control.attribute_failure(error, behavior)
        self._reactions.react_to_failure(failure, is_needed, tick)
