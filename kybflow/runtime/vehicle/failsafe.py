"""The failsafe of one vehicle: decides which reaction follows an alarm (`Failsafe`), and carries it
out (`Reactions`).

In every tick, `Decision` calls `Failsafe.check` and passes the severest alarm to `Reactions.react`.
`RESPONSES` lists what each reaction does; the behavior of each built-in state that it names is in
`kybflow.dsl.names.BUILT_IN`. These rules depend on what happened before:

- An alarm that persists is reported once.
- A latched reaction is replaced only by a severer one, until the vehicle is reset in `fault`, on
  the ground. A `brake` on the way home becomes `land`.
- A brake ends when every alarm that braked the vehicle has been silent for 1 s. An alarm that
  returns within 5 s of that holds the vehicle for good, until `hover_limit` or what is left of the
  state's `within` is over; then it lands. But if the cause passes while a vehicle stands still, as
  when wind has pushed it from its setpoint, the second brake ends after 5 s of silence if the
  vehicle is where it is held; only a third one is for good.
- A vehicle that lands blind changes to a landing by its estimate (`land`) once there has been an
  estimate, and no alarm with the reaction `land_blind`, for 0.5 s: the IMU, by which it lands
  blind, may be wrong too. It continues to land blind if a landing by the estimate has failed or a
  person requested `land_blind`.
- A part that raises lands its vehicle. A supervisor that raises is not called again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from kybflow.core.errors import PartFailed, described
from kybflow.core.events import AlarmRaised
from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Alarm, Reaction, Tick, Time
from kybflow.dsl.names import AUTO_HOME, AUTO_LAND, BRAKE, FAULT, HOVER, LAND_BLIND
from kybflow.dsl.plan import VehiclePlan
from kybflow.flight.landing_place import what_is_below
from kybflow.parts import GROUND, Supervisor
from kybflow.parts.events import FailsafeEnded, FailsafeStarted, PartFailedEvent
from kybflow.runtime.events import Events
from kybflow.runtime.finite import checked_alarm
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.behavior_runner import BehaviorRunner
from kybflow.runtime.vehicle.link import LinkOut
from kybflow.world.ground import FRESH_S, height_in_the_air

HOLD = "hold"
"""Given in place of a state: the vehicle comes to rest and holds, with its state frozen."""


class Response(NamedTuple):
    """The effects of a reaction.

    on_ground, in_air: the built-in state that a vehicle enters if it is not airborne, and if it is
    (`Reactions.airborne`); empty if the state doesn't change.
    without_estimate: the reaction that replaces this one in the air without an estimate.
    latches: whether only a severer reaction can take effect afterwards.
    """

    on_ground: str
    in_air: str
    without_estimate: Reaction
    latches: bool


RESPONSES = {  # severest last
    #                             on the ground  in the air    without an estimate  latches
    Reaction.WARN:       Response("",            "",           Reaction.WARN,       False),
    Reaction.BRAKE:      Response("",            HOLD,         Reaction.LAND_BLIND, False),
    Reaction.GO_HOME:    Response(FAULT,       AUTO_HOME,  Reaction.LAND_BLIND, True),
    Reaction.LAND:       Response(FAULT,       AUTO_LAND,  Reaction.LAND_BLIND, True),
    Reaction.LAND_BLIND: Response(FAULT,       LAND_BLIND, Reaction.LAND_BLIND, True),
    Reaction.CUT:        Response(FAULT,       FAULT,      Reaction.CUT,        True),
}  # fmt: skip
"""The response to each reaction. For `LAND` and `LAND_BLIND`, the vehicle's own land mode replaces
the state if it can be used (`LinkOut.prefers_land_mode`). `CUT` stops the rotors first, so that the
vehicle counts as on the ground."""
RELEASED_AFTER_S = 1.0
"""Seconds for which every braking alarm must be silent before a brake ends."""
RETURN_WINDOW_S = 5.0
"""Seconds after a release within which an alarm counts as returning."""
STANDING_TIME_S = 5.0
"""Seconds for which the alarms must be silent before the second brake ends."""
_STILL_DISTANCE = 0.1
"""How far a vehicle that stands is from where it is held, m; its speed shakes in wind."""
SIGHT_TIME_NS: Time = NS // 2
"""How long there must be an estimate and no alarm before a vehicle stops landing blind."""
_UNHURRIED_PERIOD_NS = NS // 50
"""Period at which unhurried supervisors are called."""
_ALARM_REPEAT_NS = NS // 2
"""An alarm that was silent for longer than this is reported again."""
_NOT_BRAKED = frozenset({BRAKE, HOVER, AUTO_LAND, LAND_BLIND, FAULT})
"""Built-in states that `brake` doesn't interrupt, because the vehicle already holds or must come
down."""


_Check = tuple[str, Callable[[Tick, bool], Alarm | None]]
"""A supervisor's label and its `check`."""


class RaisedAlarm(NamedTuple):
    """An alarm, and the mission line of the part that raised it."""

    alarm: Alarm
    at: str


class _Brake(NamedTuple):
    """A braking alarm. last: when it was last raised. reason: its reason at that time. passes:
    whether its cause passes."""

    last: Time
    reason: str
    passes: bool


class Failsafe:
    """Calls a vehicle's supervisors and decides on the reactions to their alarms.

    latched: the reaction that only a severer one can replace in the air, or None.
    due: when a supervisor must be called next.
    lines: the mission lines of the parts, by label.
    """

    def __init__(
        self,
        vehicle: str,
        supervisors: Mapping[str, Supervisor[Any]],
        lines: Mapping[str, str],
        events: Events,
    ) -> None:
        self.latched: Reaction | None = None
        self.due: Time = 0
        self._vehicle, self._events, self._lines = vehicle, events, lines
        self._checks: tuple[_Check, ...] = tuple((n, s.check) for n, s in supervisors.items())
        self._hurried = tuple(c for c in self._checks if not supervisors[c[0]].unhurried)
        self._all_due: Time = 0
        self._failed: RaisedAlarm | None = None
        self._last: dict[str, Time] = {}
        self._braking: dict[str, _Brake] = {}
        self._released: dict[str, Time] = {}
        self._waived: dict[str, Time] = {}
        self._may_see = False
        self._blind: Time = 0
        self._returns = 0

    def check(self, tick: Tick, off_ground: bool) -> RaisedAlarm | None:
        """Call every supervisor that is due; return the alarm with the severest reaction, or None.
        It is given the lateness that another alarm of this tick reports."""
        worst, self._failed = self._failed, None
        late = 0.0
        asked = self._hurried
        if tick.now >= self._all_due:
            asked, self._all_due = self._checks, tick.now + _UNHURRIED_PERIOD_NS
        self.due = tick.now if self._hurried else self._all_due
        for label, check in asked:
            try:
                alarm = check(tick, off_ground)
                if alarm is None:
                    continue
                raised = self.emit(label, checked_alarm(alarm), tick.now)
            except (Exception, SystemExit) as error:  # a part may raise anything
                self._checks = tuple(c for c in self._checks if c[0] != label)
                self._hurried = tuple(c for c in self._hurried if c[0] != label)
                raised = self.failure(PartFailed(label, error), Reaction.LAND)
            late = max(late, raised.alarm.late)
            if worst is None or raised.alarm.reaction > worst.alarm.reaction:
                worst = raised
        if worst is not None and late > worst.alarm.late:
            worst = worst._replace(alarm=worst.alarm._replace(late=late))
        return worst

    def foresee(self, tick: Tick) -> list[tuple[str, str, str]]:
        """Return (supervisor, reason, mission line) of each alarm that would end the mission at
        once if the vehicle flew now."""
        found = []
        for label, check in self._checks:
            at = self._lines.get(label, "")
            try:
                alarm = check(tick, True)
            except (Exception, SystemExit) as error:  # a part may raise anything
                found.append((label, f"it failed: {described(error)}", at))
                continue
            if alarm is not None and alarm.reaction > Reaction.WARN:
                found.append((label, alarm.reason, at))
        return found

    def report(self, failure: PartFailed) -> None:
        """Publish the failure of a part without which the vehicle can still land. The next `check`
        takes its alarm into account."""
        self._failed = self.failure(failure, Reaction.LAND)
        self.due = 0

    def failure(self, failure: PartFailed, reaction: Reaction, at: str = "") -> RaisedAlarm:
        """Publish that a part failed; return the alarm for it."""
        reason, at = str(failure), at or self._lines.get(failure.part, "")
        event = PartFailedEvent(part=failure.part, reason=reason, traceback=failure.traceback)
        self._events.emit(event, self._vehicle, at)
        alarm = Alarm("part_failed", reaction, f"`{failure.part}` failed: {reason}")
        return RaisedAlarm(alarm, at)

    def emit(self, label: str, alarm: Alarm, now: Time) -> RaisedAlarm:
        """Publish an alarm of the part `label` as an event, but only once while it persists. Return
        the alarm with the part's mission line."""
        raised = RaisedAlarm(alarm, self._lines.get(label, ""))
        last = self._last.get(alarm.event)
        self._last[alarm.event] = now
        if alarm.reaction is Reaction.BRAKE and alarm.event in self._braking:
            self._braking[alarm.event] = _Brake(now, alarm.reason, alarm.passes)
        waived = self._waived.pop(alarm.event, None)
        if waived is not None and now - waived < RELEASED_AFTER_S * NS:
            self._waived[alarm.event] = now
        if last is None or now - last > _ALARM_REPEAT_NS:
            self._events.emit(AlarmRaised(alarm), self._vehicle, raised.at)
        return raised

    def _emit_start(self, raised: RaisedAlarm, reaction: Reaction) -> None:
        alarm, at = raised
        started = FailsafeStarted(
            reaction=reaction.name.lower(),
            reason=alarm.reason,
            value=alarm.value,
            bound=alarm.bound,
        )
        self._events.emit(started, self._vehicle, at)

    def decide(
        self, raised: RaisedAlarm, tick: Tick, airborne: bool, state: str
    ) -> Reaction | None:
        """Return the reaction to an alarm, or None if the alarm changes nothing. state: the active
        state of the vehicle."""
        alarm, reaction = raised.alarm, raised.alarm.reaction
        response = RESPONSES[reaction]
        if not airborne:
            return reaction if response.on_ground not in ("", state) else None
        if not response.in_air:
            return None
        if tick.estimate is None:
            reaction = response.without_estimate
        if reaction is Reaction.LAND_BLIND:
            self._blind = tick.now
        if self.latched is Reaction.GO_HOME and reaction is Reaction.BRAKE:
            reaction = Reaction.LAND  # a brake would end the way home
        if self.latched is not None and reaction <= self.latched:
            return None
        if RESPONSES[reaction].latches:
            self.latched = reaction
            self._may_see = reaction is Reaction.LAND_BLIND and alarm.event != "part_failed"
            self.clear_brake()
        elif state in _NOT_BRAKED or alarm.event in self._waived or self._brakes(alarm, tick.now):
            return None
        self._emit_start(raised, reaction)
        return reaction

    def sees_again(self, tick: Tick) -> bool:
        """Return whether a vehicle that lands blind can land by its estimate again. If so, the
        latched reaction becomes `land`."""
        if self.latched is not Reaction.LAND_BLIND or not self._may_see:
            return False
        if tick.estimate is None:
            self._blind = tick.now
        if tick.now - self._blind < SIGHT_TIME_NS:
            return False
        self.latched, self._may_see = Reaction.LAND, False
        reason = f"there is an estimate, and no alarm, for {SIGHT_TIME_NS / NS:g} s"
        back = Alarm("estimate_lost", Reaction.LAND, reason)
        self._emit_start(RaisedAlarm(back, ""), Reaction.LAND)
        return True

    def _brakes(self, alarm: Alarm, now: Time) -> bool:
        """Record a braking alarm; return whether the vehicle was already braked."""
        event = alarm.event
        braked, released = bool(self._braking), self._released.get(event)
        returns = released is not None and now - released <= RETURN_WINDOW_S * NS
        if returns and event not in self._braking:
            self._returns += 1
        elif not braked:
            self._returns = 0
        self._braking[event] = _Brake(now, alarm.reason, alarm.passes)
        return braked

    @property
    def braking(self) -> str | None:
        """The names of the braking alarms, or None without any."""
        return " and ".join(self._braking) or None

    @property
    def brakes_because(self) -> str:
        """The latest reasons of the braking alarms."""
        return " and ".join(brake.reason for brake in self._braking.values())

    @property
    def has_returned(self) -> bool:
        """Whether a braking alarm has returned soon after its release, and brakes again."""
        return bool(self._braking) and self._returns > 0

    def release(self, tick: Tick) -> bool:
        """End the brake if its alarms have been silent for long enough; return whether it ended."""
        now = tick.now
        brakes = self._braking.values()
        if not brakes or self._returns > 1:
            return False
        silence = STANDING_TIME_S if self._returns else RELEASED_AFTER_S
        if any(now - brake.last < silence * NS for brake in brakes):
            return False
        if self._returns and not (all(brake.passes for brake in brakes) and _stands(tick)):
            return False
        self._released.update(dict.fromkeys(self._braking, now))
        self._events.emit(FailsafeEnded(reaction="brake", alarm=self.braking), self._vehicle)
        self._braking.clear()
        return True

    def clear_brake(self) -> None:
        """End the brake without an event, because the vehicle does something else now."""
        self._braking.clear()
        self._returns = 0

    def give_way(self, safer: Reaction | None) -> None:
        """End the brake, because a request brings the vehicle down. The current braking alarms
        can brake it again only after they have been silent. A latched reaction is replaced by
        `safer`, the reaction that corresponds to the requested state."""
        self._waived = {event: brake.last for event, brake in self._braking.items()}
        self.clear_brake()
        if self.latched is not None:
            self.latched = safer

    def is_latched(self) -> bool:
        """Return whether a reaction is in effect that only a severer one can replace."""
        return self.latched is not None

    def reset(self) -> None:
        """Clear every reaction, because a person has checked the vehicle on the ground."""
        self.latched = None
        self.clear_brake()


_FALL_TIME_NS = 2 * NS
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
        score: VehicleScore,
    ) -> None:
        self._plan, self._runner, self._failsafe = plan, runner, failsafe
        self._link, self._score = link, score
        self._cut: Time | None = None

    @property
    def airborne(self) -> bool:
        """Whether the vehicle is off the ground and its rotors turn. A vehicle that is being armed
        may lift off by itself, for example while this process hangs: once it reports itself armed,
        it is on the ground only if a fresh estimate, whose frame is not wrong, shows it there."""
        runner, link = self._runner, self._link
        if not runner.off_ground or link.sent.armed:
            return runner.off_ground
        if link.arming is None or not link.armed:
            return False
        entry = runner.entry()
        known = entry.estimate
        if known is None or known.age > FRESH_S or entry.imu_motion is not None:
            return True
        return height_in_the_air(entry.context, known, ()) > 0.0

    def falls(self, now: Time) -> bool:
        """Return whether the rotors were cut so recently that the vehicle may still fall."""
        return self._cut is not None and now - self._cut < _FALL_TIME_NS

    def react(self, raised: RaisedAlarm, tick: Tick, *, grounded: bool = False) -> bool:
        """Carry out the failsafe's decision on an alarm; return whether it changed anything.
        grounded: the vehicle counts as on the ground, because nothing can fly it any more."""
        runner, airborne = self._runner, self.airborne and not grounded
        if _keeps_landing(raised.alarm, runner, tick):
            return False
        reaction = self._failsafe.decide(raised, tick, airborne, runner.machine.state)
        if reaction is None:
            return self._takes_over(raised.alarm, tick)
        if raised.alarm.is_failure:
            self._score.failure(raised.alarm.reason)
        response = RESPONSES[reaction]
        if not airborne:  # its rotors rest
            runner.enter_built_in(response.on_ground, grounded=True)
        elif response.in_air == HOLD:
            runner.freeze("brake")
        else:
            cuts = reaction is Reaction.CUT
            if not self._link.sent.armed:
                self._link.hand_over()  # it has lifted off while it was being armed
            if cuts:
                self._cut = tick.now
                self._link.cut(tick.now)
            runner.enter_built_in(response.in_air, grounded=cuts)
            misled = tick.wrong_frame is not None
            if self._link.prefers_land_mode(reaction, misled=misled):
                own, context = tick.estimate, runner.entry().context
                # the vehicle's own land mode wouldn't notice another vehicle or an edge below
                if (
                    own is None
                    or what_is_below(context, own.position, tick.fleet, tick.objects) is None
                ):
                    runner.start_land_mode(tick.now)
        return True

    def _takes_over(self, alarm: Alarm, tick: Tick) -> bool:
        """Land a vehicle blind whose own land mode, started by an earlier alarm, turns out to
        follow wrong positions; return whether that changed anything."""
        runner, is_misled = self._runner, tick.wrong_frame is not None and self._link.tells_position
        in_mode = runner.land_mode is not None and self._failsafe.latched is Reaction.LAND_BLIND
        if not (is_misled and in_mode):
            return False
        self._score.failure(alarm.reason)
        runner.enter_built_in(LAND_BLIND)
        return True

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
        blind = runner.machine.state == LAND_BLIND and runner.land_mode is None
        if blind and runner.off_ground and self._failsafe.sees_again(tick):
            runner.enter_built_in(AUTO_LAND)

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

    def update_hold(self, tick: Tick) -> None:
        """Release a brake once its alarms have been silent for long enough; land if the hold has
        lasted longer than the mission's hover limit, or, if a braking alarm has returned, longer
        than what is left of the state's `within`."""
        hold, failsafe, now = self._runner.hold, self._failsafe, tick.now
        assert hold is not None
        if "brake" in hold.holders and failsafe.release(tick):
            hold.leave("brake", now)
        limit = self._plan.hover_limit
        if failsafe.has_returned:
            limit = min(limit, self._runner.remaining(now))
        if hold.lasts and self._runner.off_ground and now - hold.since >= limit * NS:
            why = failsafe.brakes_because
            self._score.failure(f"held for {limit:.3g} s{': ' if why else ''}{why}")
            failsafe.clear_brake()
            self._runner.enter_built_in(AUTO_LAND)


def _stands(tick: Tick) -> bool:
    """Return whether a vehicle that is held stands where it should."""
    held = None if tick.setpoint is None else tick.setpoint.position
    if held is None or tick.estimate is None:
        return False
    return distance(held, tick.estimate.position) <= _STILL_DISTANCE


def _keeps_landing(alarm: Alarm, runner: BehaviorRunner, tick: Tick) -> bool:
    """Return whether the alarm is to be ignored: it would brake a descent because of a bad
    estimate, which doesn't improve while the vehicle waits in the air."""
    if alarm.reaction is not Reaction.BRAKE or alarm.event != "estimate_lost":
        return False
    velocity = None if tick.setpoint is None else tick.setpoint.velocity
    return runner.leg.end is GROUND and velocity is not None and velocity[2] < 0.0
