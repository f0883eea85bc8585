"""Carries out the failsafe's reactions: enters a state, holds the vehicle, or starts its own land
mode."""

from __future__ import annotations

from kybflow.core.errors import PartFailed
from kybflow.core.signals import NS, Alarm, Reaction, Tick, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.flight.landing_place import vehicle_below
from kybflow.parts import GROUND
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.behavior_runner import BehaviorRunner
from kybflow.runtime.vehicle.failsafe import HOLD, RESPONSES, Failsafe, RaisedAlarm
from kybflow.runtime.vehicle.link import LinkOut
from kybflow.runtime.vehicle.output import CommandOutput

_FALL = 2 * NS
"""How long a vehicle counts as falling after its rotors were cut."""


class Reactions:
    """Turns alarms and failures into states, holds and landings, as the failsafe decides. It
    implements `control.ProcessorReports`."""

    def __init__(
        self,
        plan: VehiclePlan,
        runner: BehaviorRunner,
        failsafe: Failsafe,
        link: LinkOut,
        output: CommandOutput,
        score: VehicleScore,
    ) -> None:
        self._plan, self._runner, self._failsafe = plan, runner, failsafe
        self._link, self._output = link, output
        self._score = score
        self._cut: Time | None = None

    @property
    def airborne(self) -> bool:
        """Whether the vehicle is off the ground and its rotors turn."""
        return self._runner.flight is not GROUND and self._output.sent.armed

    def falls(self, now: Time) -> bool:
        """Return whether the rotors were cut so recently that the vehicle may still fall."""
        return self._cut is not None and now - self._cut < _FALL

    def react(self, raised: RaisedAlarm, tick: Tick, *, grounded: bool = False) -> bool:
        """Carry out the failsafe's decision on an alarm; return whether it changed anything.
        grounded: the vehicle counts as on the ground, because nothing can fly it any more."""
        runner, airborne = self._runner, self.airborne and not grounded
        if _keeps_landing(raised.alarm, runner, tick):
            return False
        reaction = self._failsafe.decide(raised, tick, airborne, runner.machine.state)
        if reaction is None:
            return False
        if raised.alarm.is_failure:
            self._score.failure(raised.alarm.reason)
        response = RESPONSES[reaction]
        if not airborne:  # its rotors rest
            runner.go(response.on_ground, grounded=True)
        elif response.in_air == HOLD:
            runner.freeze("brake")
        else:
            cuts = reaction is Reaction.CUT
            if cuts:
                self._cut = tick.now
                self._link.cut(tick.now)
            runner.go(response.in_air, grounded=cuts)
            if self._link.prefers_land_mode(reaction) and not self._is_above_another(tick):
                runner.start_land_mode(tick.now)
        return True

    def _is_above_another(self, tick: Tick) -> bool:
        """Return whether another vehicle is below, which the vehicle's own land mode wouldn't
        notice."""
        own, context = tick.estimate, self._runner.entry().context
        return own is not None and vehicle_below(context, own.position, tick.fleet) is not None

    def alarm(self, label: str, alarm: Alarm, tick: Tick) -> bool:
        """React to an alarm of the part `label`; return whether that changed anything."""
        return self.react(self._failsafe.emit(label, alarm, tick.now), tick)

    def clamped(self, reason: str) -> None:
        """Note that the vehicle doesn't follow its behavior's setpoint in this tick."""
        self._runner.keep_from(reason)

    def lost_estimate(self, tick: Tick) -> bool:
        """React to the loss of the estimate that the behavior needs; return whether the reaction
        changed anything."""
        lost = Alarm("estimate_lost", Reaction.LAND_BLIND, "no estimate to fly by")
        return self.react(RaisedAlarm(lost, self._runner.state.at), tick)

    def regain_sight(self, tick: Tick) -> None:
        """Return a vehicle that lands blind to a landing by its estimate once the failsafe allows
        it. A vehicle in its own land mode is left alone: the mode adapts by itself."""
        runner = self._runner
        blind = runner.machine.state == "land_blind" and runner.land_mode is None
        if blind and runner.off_ground and self._failsafe.sees_again(tick):
            runner.go("auto_land")

    def react_to_failure(self, failure: PartFailed, is_needed: bool, tick: Tick) -> None:
        """React to a part that raised: the vehicle lands. It lands blind if a needed part fails
        during that landing, and the rotors stop if a needed part fails during the blind landing.
        is_needed: whether the vehicle can't fly without the part."""
        runner, latched = self._runner, self._failsafe.latched
        reaction = Reaction.LAND
        if is_needed:
            runner.fail(str(failure))
            if latched is Reaction.LAND:
                reaction = Reaction.LAND_BLIND
        raised = self._failsafe.failure(failure, reaction, runner.state.at)
        self.react(raised, tick, grounded=is_needed and latched is Reaction.LAND_BLIND)

    def update_hold(self, now: Time) -> None:
        """Release a brake once its alarms have been silent for long enough; land if the hold has
        lasted longer than the mission's hover limit."""
        hold, failsafe = self._runner.hold, self._failsafe
        assert hold is not None
        if "brake" in hold.holders and failsafe.release(now):
            hold.leave("brake", now)
        limit = self._plan.hover_limit
        if hold.lasts and self._runner.off_ground and now - hold.since >= limit * NS:
            why = failsafe.brakes_because
            self._score.failure(f"held for {limit:g} s{': ' if why else ''}{why}")
            failsafe.clear_brake()
            self._runner.go("auto_land")


def _keeps_landing(alarm: Alarm, runner: BehaviorRunner, tick: Tick) -> bool:
    """Return whether the alarm is to be ignored: it would brake a descent because of a bad
    estimate, which doesn't improve while the vehicle waits in the air."""
    if alarm.reaction is not Reaction.BRAKE or alarm.event != "estimate_lost":
        return False
    velocity = None if tick.setpoint is None else tick.setpoint.velocity
    return runner.leg.end is GROUND and velocity is not None and velocity[2] < 0.0
