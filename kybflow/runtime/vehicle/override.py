"""Tracks who controls the vehicle: this program, a pilot, or the vehicle's own failsafe.

While a pilot has control, the runtime sends no commands and freezes the behavior. `operator.resume`
requests control back: either the behavior resumes from the vehicle's current position, or an event
reports why the request was refused. If the vehicle's own failsafe takes control, the runtime lands
the vehicle.
"""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.errors import Refused
from kybflow.core.events import VehicleEvent
from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Alarm, Estimate, Reaction, Tick, Time
from kybflow.dsl.names import AUTO_LAND, LAND_BLIND, LANDED
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import GROUND, Override
from kybflow.parts.events import (
    ControlLost,
    ControlRefused,
    ControlReturned,
    ControlTaken,
    StaysArmed,
)
from kybflow.runtime.events import Events
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.behavior_runner import FALL_DETECTION_NS, BehaviorRunner
from kybflow.runtime.vehicle.control import Control
from kybflow.runtime.vehicle.failsafe import Failsafe, RaisedAlarm, Reactions
from kybflow.runtime.vehicle.link import REQUEST_AGE_S, LinkOut
from kybflow.world.ground import FRESH_S, height_in_the_air

FALLING_SPEED = 1.2
"""Sink rate of a falling vehicle, m/s. No landing sinks as fast."""
REPORT_LAG_NS: Time = NS // 2
"""How late a vehicle may report that its rotors have stopped."""
WARNING_NS: Time = 5 * NS
FORCE_NS: Time = 10 * NS
GIVEN_UP_NS: Time = 30 * NS
STANDING_NS: Time = 3 * NS
STANDING_DISTANCE = 0.03
"""Metres by which the estimate may move while the vehicle stands still."""


class ArmingWatch:
    """Compares the vehicle's report of being armed with whether its rotors should turn.

    In the air, a vehicle that reports itself disarmed while it falls has disarmed in flight. It
    counts as falling if a fresh estimate places it above everything that could carry it and
    shows it sinking faster than any landing. Its rotors are then cut, and it doesn't count as
    landed. A vehicle that falls from a low height is on the ground before it reports itself
    disarmed, so a fall is remembered for `REPORT_LAG_NS` after its end.

    On the ground, the driver requests a vehicle that has landed to disarm. If the vehicle is still
    armed after `WARNING_NS`, `stays_armed` is emitted. After `FORCE_NS` the vehicle is disarmed by
    force, provided a fresh estimate near the ground has stood still for `STANDING_NS` and the
    vehicle doesn't report that it flies. After `GIVEN_UP_NS` the run no longer waits for the
    vehicle and has failed.

    gave_up: whether the vehicle stayed armed
    on the ground for so long that the run no longer waits for it.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        link: LinkOut,
        runner: BehaviorRunner,
        reactions: Reactions,
        events: Events,
        score: VehicleScore,
    ) -> None:
        self.gave_up = False
        self._name, self._at = plan.name, plan.driver.at
        self._link, self._runner, self._reactions = link, runner, reactions
        self._events, self._score = events, score
        self._since: Time | None = None
        self._fell: tuple[Time, float] | None = None
        self._stood: Time | None = None
        self._stands: Estimate | None = None
        self._reported = self._forced = False

    def update(self, tick: Tick, armed: bool) -> bool:
        """Compare the vehicle's report with the command in this tick; return whether the vehicle
        was found to have disarmed in the air. armed: whether it reports itself armed."""
        if armed is self._link.sent.armed:
            self._since = self._stands = None
            known = tick.estimate
            if armed and known is not None and known.velocity[2] < -FALLING_SPEED:
                self._note_fall(tick)
            return False
        if not armed:
            return self._runner.off_ground and self._has_fallen(tick)
        is_quiet = tick.link_age > REQUEST_AGE_S or self._link.override is not None
        if self._runner.flight is GROUND and self._link.arming is None and not is_quiet:
            self._watch_landed(tick)
        return False

    def may_fall(self, tick: Tick) -> bool:
        """Return whether a vehicle whose rotors stopped just now may still be in the air, although
        its estimate doesn't show a fall yet."""
        if self._since is None:
            self._since = tick.now
        return tick.now - self._since < FALL_DETECTION_NS and self._above(tick.estimate) > 0.0

    def _note_fall(self, tick: Tick) -> None:
        """Record the height of a vehicle that sinks faster than any landing."""
        above = self._above(tick.estimate)
        if above > 0.0:
            self._fell = tick.now, above

    def _has_fallen(self, tick: Tick) -> bool:
        """Return whether the vehicle, whose rotors rest, falls or fell within the last
        `REPORT_LAG_NS`, and whether the reaction to that changed anything."""
        known = tick.estimate
        if known is not None and known.velocity[2] < -FALLING_SPEED:
            self._note_fall(tick)
        if self._fell is None or tick.now - self._fell[0] > REPORT_LAG_NS:
            return False
        above, self._fell = self._fell[1], None
        reason = f"it disarmed in the air: its estimated height above the ground is {above:.2f} m"
        self._events.emit(ControlLost(reason=reason), self._name, self._at)
        lost = Alarm("control_lost", Reaction.CUT, reason, is_failure=True)
        return self._reactions.react(RaisedAlarm(lost, self._at), tick)

    def _watch_landed(self, tick: Tick) -> None:
        """Watch a vehicle that has landed and is still armed: report, disarm by force, give up."""
        if self._since is None:
            self._since, self._reported, self._forced = tick.now, False, False
        waited = tick.now - self._since
        stands = self._has_stood(tick.estimate, tick.now)
        if waited >= WARNING_NS and not self._reported:
            self._reported = True
            self._emit("it has landed, but does not disarm on request")
        if waited >= FORCE_NS and not self._forced and stands:
            self._forced = True
            try:
                self._link.disarm_by_force(tick.now)
                self._emit("it stands still on the ground: disarmed by force")
            except Refused as refusal:
                self._emit(f"it can't be disarmed by force: {refusal}")
        if waited >= GIVEN_UP_NS and not self.gave_up:
            self.gave_up = True
            reason = f"it has landed, and is still armed after {GIVEN_UP_NS // NS} s: disarm it"
            self._emit(reason)
            self._score.failure(reason)

    def _has_stood(self, known: Estimate | None, now: Time) -> bool:
        """Return whether the estimate has stood still on the ground for `STANDING_NS`."""
        if known is None or known.age > FRESH_S or self._above(known) > 0.0:
            self._stands = None
            return False
        before = self._stands
        if before is None or distance(known.position, before.position) > STANDING_DISTANCE:
            self._stands, self._stood = known, now
        return self._stood is not None and now - self._stood >= STANDING_NS

    def _above(self, known: Estimate | None) -> float:
        """Return the vehicle's least height above the ground (m), zero if it may stand on it."""
        if known is None:
            return 0.0
        return height_in_the_air(self._runner.entry().context, known, ())

    def _emit(self, reason: str) -> None:
        self._events.emit(StaysArmed(reason=reason), self._name, self._at)


class ManualOverride:
    """Tracks who has control of a vehicle. away: whether a pilot has control."""

    def __init__(
        self,
        plan: VehiclePlan,
        link: LinkOut,
        runner: BehaviorRunner,
        failsafe: Failsafe,
        reactions: Reactions,
        control: Control,
        arming: ArmingWatch,
        events: Events,
        score: VehicleScore,
    ) -> None:
        self.away = False
        self._plan, self._link, self._runner, self._failsafe = plan, link, runner, failsafe
        self._reactions, self._control = reactions, control
        self._arming, self._events, self._score = arming, events, score
        self._landed_for: Override | None = None
        self._lost: Override | None = None
        self._refused = ""

    @property
    def is_taken(self) -> bool:
        """Whether a person has control, or had it when the vehicle landed."""
        override = self._link.override
        return self.away or (override is not None and not override.lands)

    def reclaim(self, now: Time) -> None:
        """Request control back from a person."""
        if self.is_taken:
            self._refused = ""
            self._link.reclaim(now)

    def update(self, tick: Tick, answer: Callable[[Time], None]) -> bool:
        """Determine who has control in this tick and whether the vehicle falls. Return whether a
        pilot has control. answer: handles the waiting requests while a pilot has control."""
        armed = self._link.armed
        if armed is not None and self._arming.update(tick, armed):
            self.away = False
        elif self.away or self._link.override is not None:
            self._follow(tick, answer)
        return self.away

    def _follow(self, tick: Tick, answer: Callable[[Time], None]) -> None:
        override, runner = self._link.override, self._runner
        if override is None or not runner.off_ground:
            self._lost = None
            if self.away:
                self._emit(ControlReturned())
                self._take_back()
        elif override.lands:
            self._take_back()
            if override != self._lost:
                self._lost = override
                self._emit(ControlLost(reason=override.reason))
            lost = Alarm("control_lost", Reaction.LAND, override.reason)
            self._reactions.react(RaisedAlarm(lost, self._plan.driver.at), tick)
            comes_down = runner.machine.state in (AUTO_LAND, LAND_BLIND) and self._link.can_land
            if comes_down and override is not self._landed_for:  # once per override
                self._landed_for = override
                if runner.land_mode is None:
                    runner.start_land_mode(tick.now)
        else:
            self._stand_by(override, tick, answer)

    def _stand_by(self, override: Override, tick: Tick, answer: Callable[[Time], None]) -> None:
        """Freeze the behavior once, handle requests, and detect that the pilot landed."""
        runner = self._runner
        if not self.away:
            self.away = True
            self._control.rest()
            self._emit(ControlTaken(reason=override.reason))
            runner.freeze("pilot")
            if runner.hold is not None:  # the failsafe doesn't brake a vehicle that a pilot flies
                self._failsafe.clear_brake()
                runner.hold.leave("brake", tick.now)
        if override.refused and override.refused != self._refused:
            self._emit(ControlRefused(reason=override.refused))
        self._refused = override.refused
        runner.wait(tick.dt)
        self._failsafe.check(tick, off_ground=False)  # supervisors keep their state; no reaction
        answer(tick.now)
        if self._link.armed is False and not self._arming.may_fall(tick):
            self.away = False
            self._score.failure(override.reason)
            runner.enter_built_in(LANDED, grounded=True)

    def _take_back(self) -> None:
        """Resume the frozen behavior from the vehicle's current position."""
        if self.away:
            self.away = False
            self._runner.thaw("pilot")

    def _emit(self, event: VehicleEvent) -> None:
        self._events.emit(event, self._plan.name, self._plan.driver.at)
