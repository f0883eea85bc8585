"""Carries out the failsafe's reactions: as a state, a hold or the vehicle's own land mode."""

from __future__ import annotations

from kybflow.core.errors import PartFailed
from kybflow.core.signals import NS, Alarm, Estimate, Reaction, Setpoint, Tick, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.flight.landing_place import vehicle_below
from kybflow.parts import GROUND
from kybflow.parts.events import LandModeStarted
from kybflow.runtime.events import Events
from kybflow.runtime.safety.failsafe import STATES, Failsafe, RaisedAlarm
from kybflow.runtime.safety.land_mode import LandMode
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.activity import Activity
from kybflow.runtime.vehicle.link import LinkOut
from kybflow.runtime.vehicle.output import CommandOutput

_FALL = 2 * NS
"""How long a vehicle counts as falling after its rotors were cut."""


class Reactions:
    """Turns alarms and failures into states, holds and landings, as the failsafe decides."""

    def __init__(
        self,
        plan: VehiclePlan,
        activity: Activity,
        failsafe: Failsafe,
        link: LinkOut,
        output: CommandOutput,
        events: Events,
        score: VehicleScore,
    ) -> None:
        self._plan, self._activity, self._failsafe = plan, activity, failsafe
        self._link, self._output = link, output
        self._events, self._score = events, score
        self._cut: Time | None = None

    @property
    def airborne(self) -> bool:
        """Whether the vehicle is off the ground and its rotors turn."""
        return self._activity.off_ground and self._output.sent.armed

    def falls(self, now: Time) -> bool:
        """Return whether the rotors were cut so recently that the vehicle may still fall."""
        return self._cut is not None and now - self._cut < _FALL

    def react(self, heard: RaisedAlarm, tick: Tick) -> bool:
        """Carry out the failsafe's decision on an alarm; return whether it changed anything."""
        activity, airborne = self._activity, self.airborne
        if _brakes_for_sight(heard.alarm) and activity.leg.end is GROUND and _sinks(tick.setpoint):
            return False
        reaction = self._failsafe.decide(heard, tick, airborne, activity.machine.state)
        if reaction is None:
            return False
        if heard.alarm.is_failure:
            self._score.failure(heard.alarm.reason)
        if reaction is Reaction.BRAKE:
            activity.freeze("brake")
            return True
        if not airborne:
            activity.flight = GROUND  # rotors at rest: it has not left the ground
        elif reaction is Reaction.CUT:
            activity.flight, self._cut = GROUND, tick.now
            self._link.cut(tick.now)
        activity.go(STATES[reaction] if airborne else "fault")
        if airborne and self._link.prefers_land_mode(reaction) and self._is_clear(tick):
            self.start_land_mode(tick.now)
        return True

    def _is_clear(self, tick: Tick) -> bool:
        """Whether no other vehicle is known to be below; an own land mode knows nothing of them."""
        own, context = tick.estimate, self._activity.entry().context
        return own is None or vehicle_below(context, own.position, tick.fleet) is None

    def alarm(self, label: str, alarm: Alarm, tick: Tick) -> bool:
        """React to an alarm of the part `label`; return whether that changed anything."""
        return self.react(self._failsafe.emit(label, alarm, tick.now), tick)

    def lost_estimate(self, tick: Tick) -> bool:
        """React to the loss of the estimate that the behavior needs."""
        lost = Alarm("estimate_lost", Reaction.LAND_BLIND, "no estimate to fly by")
        return self.react(RaisedAlarm(lost, self._activity.state.at), tick)

    def regain_sight(self, tick: Tick) -> None:
        """Land by the estimate again, where the vehicle lands blind and nothing speaks against the
        estimate. Its own land mode finds that out by itself."""
        activity = self._activity
        blind = activity.machine.state == "land_blind" and activity.land_mode is None
        if blind and activity.off_ground and self._failsafe.sees_again(tick):
            activity.go("auto_land")

    def react_to_failure(self, failure: PartFailed, is_needed: bool, tick: Tick) -> None:
        """React to a part that raised: the vehicle lands, blind if a part that is needed to land
        failed. The rotors rest if even that failed, or if they rested before. is_needed: the
        vehicle can't fly without the part."""
        activity, reaction = self._activity, Reaction.LAND
        if is_needed:
            activity.fail(str(failure))
            if self._failsafe.latched is Reaction.LAND_BLIND:
                activity.flight = GROUND
            elif self._failsafe.latched is Reaction.LAND:
                reaction = Reaction.LAND_BLIND
        self.react(self._failsafe.failure(failure, reaction, activity.state.at), tick)

    def start_land_mode(self, now: Time) -> None:
        """Land by the vehicle's own land mode instead of the behavior that was entered."""
        entry = self._activity.entry()
        height = _height(entry.estimate, entry.context.start[2])
        self._activity.land_mode = LandMode(self._link.land, now, height)
        self._events.emit(LandModeStarted(), self._plan.name, self._plan.driver.at)

    def update_hold(self, now: Time) -> None:
        """Release a hold once its braking alarms are silent; land if it has lasted too long."""
        hold, failsafe = self._activity.hold, self._failsafe
        assert hold is not None
        if "brake" in hold.holders and failsafe.release(now):
            hold.leave("brake", now)
        limit = self._plan.hover_limit
        if hold.lasts and self._activity.off_ground and now - hold.since >= limit * NS:
            why = failsafe.brakes_because
            self._score.failure(f"held for {limit:g} s{': ' if why else ''}{why}")
            failsafe.clear_brake()
            self._activity.go("auto_land")


def _brakes_for_sight(alarm: Alarm) -> bool:
    return alarm.reaction is Reaction.BRAKE and alarm.event == "estimate_lost"


def _sinks(setpoint: Setpoint | None) -> bool:
    """Whether a setpoint comes down."""
    return setpoint is not None and setpoint.velocity is not None and setpoint.velocity[2] < 0.0


def _height(estimate: Estimate | None, ground: float) -> float:
    return 0.0 if estimate is None else estimate.position[2] - ground
