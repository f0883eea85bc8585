"""Runs a vehicle's behaviors. Manages the state of its machine, the behavior of that state, whether
the vehicle flies, and the hold that freezes all of these."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from math import inf
from typing import Any

from kybflow.core.errors import PartError, PartFailed, Refused
from kybflow.core.events import Custom, Emitting
from kybflow.core.geometry import LEVEL, ZERO, Vec3, distance, heading_of
from kybflow.core.signals import (
    NS,
    Command,
    Done,
    Estimate,
    Failed,
    Grip,
    Setpoint,
    Tick,
    Time,
)
from kybflow.dsl.expressions import Expression
from kybflow.dsl.machine import Exit, Outcome, VehicleMachine
from kybflow.dsl.names import BRAKE, FAULT, LANDED
from kybflow.dsl.plan import StatePlan, Values, VehiclePlan
from kybflow.flight.motion import Motion
from kybflow.parts import AIR, GROUND, MOVING, Behavior, Entry, Flight, Leg
from kybflow.parts.events import (
    BehaviorEnded,
    BehaviorFailed,
    BehaviorStarted,
    BehaviorWaits,
    Landed,
    LandingRefused,
    LandModeStarted,
    SwitchRefused,
    TookOff,
)
from kybflow.runtime.events import Events
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.hold import Hold, Holder, SetpointBlend
from kybflow.runtime.vehicle.knowledge import TickBuilder
from kybflow.runtime.vehicle.link import LandMode, LinkOut
from kybflow.runtime.vehicle.touch_down import (
    TouchDown,
    allowed_distance,
    said_distance,
)

MAX_REFUSAL_NS: Time = 10 * NS
"""How long a behavior's claims to have landed may be refused before the behavior fails."""
FALL_DETECTION_NS: Time = NS // 2
"""How long after the rotors stopped the estimate may not show yet that the vehicle falls."""
REFUSAL_REPEAT_NS: Time = NS // 10
"""Refusals of transitions within this time of the previous one are not reported."""
DESCENT_THRUST, DESCENT_DEPTH = 0.5, 0.05
"""A fraction of the hover thrust, and a setpoint's depth below the vehicle (m), with which any
vehicle in the air descends."""
Foreseen = tuple[str, str, str]
"""An alarm that would end the mission at once: (supervisor, reason, mission line)."""
_SAFE = frozenset({BRAKE, LANDED})
"""The states that a vehicle enters when the behavior of no other state starts."""


class BehaviorRunner:
    """Constructs a behavior when the machine enters a state, and discards it on exit. Only this
    class changes the machine, the behavior, `flight`, the hold and the land mode.

    flight: GROUND, AIR, or MOVING while a take-off or a landing is under way or was interrupted.
    entries: the number of states entered so far.
    begun: whether the preflight has passed and the vehicle may enter its first state.
    hold: the hold that freezes the state, its behavior and its timers, or None.
    land_mode: the landing by the vehicle's own land mode, which replaces the behavior, or None.
    grip: the behavior's request to the payload's servo in this tick, or None.
    touches: the object that the behavior means to touch, empty for none.
    foresee: returns the alarms that a tick would raise if the vehicle flew.
    latched: returns whether the failsafe has a latched reaction.
    resting_place: where the vehicle must be to take off (world, m): its start, later where it
    landed; None if unknown.
    """

    machine: VehicleMachine
    behavior: Behavior[Any]
    leg: Leg

    def __init__(
        self,
        plan: VehiclePlan,
        params: dict[str, Any],
        ticks: TickBuilder,
        foresee: Callable[[Tick], list[Foreseen]],
        latched: Callable[[], bool],
        link: LinkOut,
        events: Events,
        score: VehicleScore,
    ) -> None:
        self.plan, self.flight = plan, GROUND
        self.entries, self.entered = 0, 0
        self.begun = False
        self.hold: Hold | None = None
        self.land_mode: LandMode | None = None
        self.grip: Grip | None = None
        self.touches = ""
        self.resting_place: Vec3 | None = plan.start
        self._params, self._ticks = params, ticks
        self._foresee, self._latched = foresee, latched
        self._link, self._events, self._score, self._name = link, events, score, plan.name
        self._outcome: Outcome = "running"
        self._reason = ""
        self._wanted: Setpoint | None = None
        self._started: Behavior[Any] | None = None
        self._values: Values = ()
        self._refused: frozenset[str] = frozenset()
        self._blend: SetpointBlend | None = None
        self._resumes = False
        self._given: Command | None = None
        self._off = 0.0
        self._touch_down: TouchDown | None = None
        self._waits_for: str | None = None
        self._objected: Time = -NS

    def begin(self, conditions: Callable[[Expression], Callable[[], bool]]) -> None:
        """Enter the first state."""
        self.machine = VehicleMachine(
            self.plan,
            conditions,
            on_enter=self._enter,
            on_exit=self._exit,
            starts=self._starts,
            off_ground=lambda: self.off_ground,
            latched=self._latched,
            welcome=self._is_welcome,
        )
        self.begun = True
        self.machine.begin()

    def entry(self) -> Entry:
        """Return the conditions in which a behavior would be entered now."""
        return self._ticks.entry(self.flight)

    @property
    def state(self) -> StatePlan:
        return self.plan.states[self.machine.state]

    @property
    def off_ground(self) -> bool:
        """Whether the vehicle is between the start of a take-off and touch-down, even if its rotors
        don't turn."""
        return self.flight is not GROUND

    @property
    def stays_in_air(self) -> bool:
        return self.leg.start is AIR and self.leg.end is AIR

    def step(self, tick: Tick) -> None:
        """Take the transition that is due in this tick, if one is."""
        self.machine.step(tick.elapsed, self._events.heard(self._name), self._outcome, tick.dt)

    def enter_built_in(self, goal: str, *, grounded: bool = False) -> None:
        """Enter the built-in state `goal` at once, regardless of the mission's transitions.
        grounded: whether the rotors rest, so that the vehicle counts as on the ground. Raises
        Refused if neither `goal` nor `brake` or `landed` can start."""
        if grounded:
            self.flight = GROUND
        self.machine.enter_built_in(goal)

    def reset(self) -> None:
        """Leave the state `fault`, and forget the place of landing: a person has checked the
        vehicle."""
        self.resting_place = None
        if self.machine.state == FAULT:
            self.enter_built_in(LANDED)

    def start_land_mode(self, now: Time) -> None:
        """Start a landing by the vehicle's own land mode. The active state stays, with a behavior
        that is not updated: its leg, touch-down and transitions are those of this landing too, and
        it is entered anew if the vehicle refuses or leaves the mode."""
        entry = self.entry()
        height = 0.0
        if entry.estimate is not None:
            height = entry.estimate.position[2] - entry.context.start[2]
        self.land_mode = LandMode(self._link.land, now, height)
        self._events.emit(LandModeStarted(), self._name, self.plan.driver.at)

    def params_of(self, state: str, values: Values = ()) -> Any:
        """Return the parameters of a state's behavior, overridden by `values`."""
        params = self._params[self.plan.states[state].behavior.label]
        return dataclasses.replace(params, **dict(values)) if values else params

    def switch(self, goal: str, at: str, values: Values = ()) -> None:
        """Enter the requested state `goal`, with its parameters overridden by `values`. at: the
        mission line of the request, empty for a request by a person. Raises Refused if the behavior
        refuses to start, and PartFailed if it raises anything else; the state is then unchanged."""
        self._values = values
        try:
            self.machine.switch(goal, at)
        finally:
            self._started, self._values = None, ()

    def freeze(self, holder: Holder) -> None:
        """Bring the vehicle to rest and hold it until this holder and all others release it."""
        if self.hold is not None and self.hold.lasts:
            self.hold.join(holder)
        else:
            self.hold = Hold({holder}, self.entry(), self._wanted, not self.off_ground)

    def wait(self, dt: float) -> None:
        """Stop the state's timers for a tick of `dt` seconds."""
        self.entered += round(dt * NS)

    def remaining(self, now: Time) -> float:
        """Return the seconds that were left of the state's `within` when its timers stopped;
        infinity without one."""
        machine, elapsed = self.machine, (now - self.entered) / NS
        return min(
            (
                transition.after - machine.chains.get(transition.since, 0.0) - elapsed
                for transition in self.state.transitions
                if transition.cause == "within" and transition.after is not None
            ),
            default=inf,
        )

    def update(self, tick: Tick) -> Setpoint | Command:
        """Return the output of the hold or of the behavior. The behavior's end takes effect in the
        next tick."""
        if self.hold is not None:
            held = self.hold.update(tick.now)
            if held is not None:
                return held
            self.hold, self._resumes = None, self.off_ground
        output = self.behavior.update(tick)
        if self.behavior.waits_for != self._waits_for:
            self._emit_waiting()
        if not isinstance(output, Setpoint):
            if isinstance(output, Emitting):
                output = self._emitted(output)
            if isinstance(output, Command):
                self._given = output
                return output
            if isinstance(output, Done) and self._is_refused(tick):
                return self._going_on(tick.estimate)
            output = self._noted(output, tick)
        self._wanted = output
        if self._resumes:
            self._resumes = False
            self._blend = SetpointBlend(tick.now, tick.setpoint, output)
        return output if self._blend is None else self._blended(self._blend, output, tick.now)

    def _emitted(self, emitting: Emitting) -> Setpoint | Done:
        """Emit one of the behavior's `own_events`. Raises PartError for any other."""
        event = emitting.event
        if type(event) not in self.behavior.own_events:
            raise PartError(f"`{event.name}` is none of its `own_events`")
        own = event.replaced(behavior=self.machine.state)
        self._events.emit(own, self._name, self.state.at)
        return emitting.output

    def _noted(self, output: Setpoint | Failed | Done | Grip, tick: Tick) -> Setpoint:
        """Process the outcome or the payload request in a behavior's output; return its
        setpoint."""
        if isinstance(output, Setpoint):
            return output
        if isinstance(output, Failed):
            self.fail(output.reason)
        elif isinstance(output, Done):
            self._end(tick.estimate)
        else:
            self.grip = output
        return output.setpoint

    def _emit_waiting(self) -> None:
        self._waits_for = self.behavior.waits_for
        if self._waits_for is not None:
            waits = BehaviorWaits(behavior=self.machine.state, reason=self._waits_for)
            self._events.emit(waits, self._name, self.state.at)

    def _blended(self, blend: SetpointBlend, asked: Setpoint, now: Time) -> Setpoint:
        blended = blend.added(asked, now)
        if blended is None:
            self._blend = None
        return blended or asked

    def take_grip(self) -> Grip | None:
        """Return the behavior's request to the payload's servo, or None, and clear it."""
        grip, self.grip = self.grip, None
        return grip

    def fail(self, reason: str) -> None:
        """Mark the active behavior as failed: it failed, refused to start, or a part raised."""
        self._outcome, self._reason = "failed", reason

    def keep_from(self, reason: str) -> None:
        """Note that a processor keeps the vehicle from the behavior's setpoint in this tick. If
        the behavior is done, it has failed instead, because the vehicle is not at its goal."""
        if self._outcome == "done":
            self.fail(reason)

    def has_landed(self, now: Time, estimate: Estimate | None) -> bool:
        """Continue the landing by the vehicle's own land mode; return whether the vehicle has
        landed, which ends the behavior. Raises Refused if the vehicle refuses or leaves the mode,
        or takes too long."""
        assert self.land_mode is not None
        landed = self.land_mode.has_landed(now)
        if landed:
            reason = self._refusal(estimate, now, is_pushed=False)
            if reason:
                assert self._touch_down is not None
                if self._touch_down.refused_for(now) < FALL_DETECTION_NS:
                    return False  # if it is in the air it falls, which `ArmingWatch` detects
                self._score.failure(f"its rotors are off, and {reason}")
            self.land_mode = None
            self._end(estimate)
        return landed

    def _is_refused(self, tick: Tick) -> bool:
        """Return whether the behavior's claim to be done is refused: the estimate contradicts its
        landing, or there is no estimate and the vehicle's own failsafe is still landing it."""
        if self._touch_down is not None and tick.estimate is None:
            override = self._link.override
            if override is not None and override.lands:
                return True
        return bool(self._refusal(tick.sound_estimate, tick.now, is_pushed=self._is_pushed(tick)))

    def _is_pushed(self, tick: Tick) -> bool:
        """Return whether the last command or setpoint would make the vehicle descend if it were in
        the air."""
        if self._given is not None:
            return self._given.thrust < DESCENT_THRUST * self.entry().context.airframe.hover_thrust
        followed, known = tick.setpoint, tick.estimate
        if followed is None or followed.position is None or known is None:
            return False
        return followed.position[2] < known.position[2] - DESCENT_DEPTH

    def _refusal(self, estimate: Estimate | None, now: Time, *, is_pushed: bool) -> str:
        """Return why a claim that the vehicle has landed is refused, empty if it is accepted. The
        first refusal is reported."""
        claims = self._touch_down
        reason = "" if claims is None else claims.refusal(estimate, now, is_pushed=is_pushed)
        if claims is None or not reason:
            return ""
        refused_for = claims.refused_for(now)
        if refused_for == 0:
            refused = LandingRefused(behavior=self.machine.state, reason=reason)
            self._events.emit(refused, self._name, self.state.at)
        elif refused_for > MAX_REFUSAL_NS and self.behavior.needs_estimate:
            self.fail(f"it reports a landing, but {reason}")
        return reason

    def _going_on(self, estimate: Estimate | None) -> Setpoint | Command:
        """Return the last output of a behavior whose landing was refused. Without one, return a
        setpoint that holds the position, or a command without thrust if there is no estimate."""
        before = self._given or self._wanted
        if before is not None:
            return before
        if estimate is None:
            return Command(LEVEL, 0.0, ZERO, None)
        return Motion(estimate.position, ZERO).setpoint(heading_of(estimate.attitude))

    def refuse(self, reason: str) -> None:
        """Note that the vehicle refused to arm. It stays on the ground, and its behavior counts as
        refused."""
        self.flight = GROUND
        self.fail(reason)
        self._refused = frozenset()
        self.machine.refuse({self.state.name})

    def thaw(self, holder: Holder) -> None:
        """Release a holder that moved the vehicle, such as a pilot. The frozen behavior resumes
        from the vehicle's current position once no other holder is left."""
        before = self.hold
        if before is not None:
            entry = self.entry()
            holders = {holder, *before.holders}
            self.hold = Hold(holders, entry, before.wanted, not self.off_ground)
            self.hold.leave(holder, entry.now)

    def close(self, now: Time) -> None:
        """Record in the score that the run ended during the active behavior."""
        self._score.left("run_ended", now / NS)

    def _end(self, estimate: Estimate | None) -> None:
        """Mark the behavior as done: the vehicle has reached the end of its leg."""
        self._outcome = "done"
        start, end = self.leg
        if start is not end:
            self.flight = end
            self.resting_place = None if estimate is None else estimate.position
            if end is GROUND or start is GROUND:
                self._events.emit(Landed() if end is GROUND else TookOff(), self._name)

    def _enter(self, name: str) -> None:
        """Construct the behavior of the state that the machine has entered. If the behavior refuses
        to start, it has failed, and the machine leaves the state again."""
        state, entry = self.plan.states[name], self.entry()
        self.entered, self.entries = entry.now, self.entries + 1
        self._score.entered(name, state.behavior.name, self._events.now / NS)
        values = ", ".join(f"{field} {value}" for field, value in self._values)
        began = BehaviorStarted(behavior=name, part=state.behavior.name, values=values)
        self._events.emit(began, self._name, state.at)
        try:
            started = self._started
            behavior = self._built(state, entry) if started is None else started
        except Refused as refusal:
            if name in _SAFE & self._refused:
                raise
            self._refused |= {name}
            self.fail(str(refusal))
            self.machine.refuse(self._refused)
            return
        self.behavior = behavior
        if entry.context.objects:
            self.touches = state.behavior.cls.touches(behavior.params)
        self.leg = next(leg for leg in state.legs if leg.start is self.flight)
        if self.leg.start is not self.leg.end:
            if self.flight is GROUND and entry.estimate is not None:
                self._off = entry.estimate.position[2] - entry.context.start[2]
            if self.leg.end is GROUND:
                planned = state.behavior.cls.footprint(self.behavior.params, None)
                expected = () if planned is None or planned.exit is None else (planned.exit[2],)
                self._touch_down = TouchDown(entry.context, expected, self._off)
            self.flight = MOVING

    def _exit(self, reason: Exit) -> None:
        """Emit how the machine leaves the state, and clear the data kept for the state."""
        name = self.machine.state
        if self._outcome == "failed":
            failed = BehaviorFailed(behavior=name, reason=self._reason)
            self._events.emit(failed, self._name, reason.at)
        self._score.left(reason.how, self._events.now / NS)
        self._events.emit(BehaviorEnded(behavior=name, how=reason.how), self._name, reason.at)
        if reason.transition is not None and reason.transition.emit is not None:
            self._events.emit(Custom(reason.transition.emit), at=reason.at)
        if reason.how in ("failed", "refused", "within"):
            handled = (t for t in self.state.transitions if t.cause == "failed")
            if all(transition.implied for transition in handled):  # the mission doesn't handle it
                after = None if reason.transition is None else reason.transition.after
                self._score.failure(self._reason or f"not done within {after:g} s")
        if reason.how != "refused":
            self._refused = frozenset()
        self._outcome, self._reason = "running", ""
        self.hold = self.land_mode = self._blend = self._wanted = None
        self._given = self._touch_down = None
        self._resumes, self.grip, self._waits_for = False, None, None

    def _starts(self, name: str) -> bool:
        """Construct the behavior of a requested state before the current state is left. Raises
        Refused or PartFailed if it can't start."""
        state = self.plan.states[name]
        try:
            self._started = self._built(state, self.entry(), self._values)
        except Refused:
            raise
        except Exception as error:
            raise PartFailed(state.behavior.label, error) from error
        return True

    def _built(self, state: StatePlan, entry: Entry, values: Values = ()) -> Behavior[Any]:
        """Return the behavior of `state`. Raises Refused if it can't start."""
        reason = unfit(state, self.flight, entry.estimate is not None or self.off_ground)
        reason = reason or self.misplaced(state, entry.estimate) or self._doubted(state, entry)
        if reason is not None:
            raise Refused(reason)
        behavior: Behavior[Any] = state.behavior.cls(self.params_of(state.name, values), entry)
        return behavior

    def entry_objection(self, state: StatePlan, values: Values = ()) -> str | None:
        """Return why `state` should not be entered now with its parameters overridden by `values`,
        or None."""
        params = self.params_of(state.name, values)
        reason: str | None = state.behavior.cls.objection(params, self.entry())
        return reason

    def _is_welcome(self, name: str) -> bool:
        """Return whether a transition of the mission may enter the state `name` now. Only the first
        of several consecutive refusals is reported."""
        state, now = self.plan.states[name], self._events.now
        reason = self.entry_objection(state)
        if reason is not None:
            if now - self._objected > REFUSAL_REPEAT_NS:
                refused = SwitchRefused(state=name, by="mission", reason=reason)
                self._events.emit(refused, self._name, self.state.at)
            self._objected = now
        return reason is None

    def misplaced(self, state: StatePlan, estimate: Estimate | None) -> str | None:
        """Return why a take-off can't start at the vehicle's position, or None if it can."""
        if estimate is None or self.resting_place is None or not self._leaves_ground(state):
            return None
        away = distance(estimate.position, self.resting_place)
        if away <= allowed_distance(estimate):
            return None
        allowed = said_distance(estimate)
        return f"the estimate is {away:.2f} m from where the vehicle stood ({allowed})"

    def _doubted(self, state: StatePlan, entry: Entry) -> str | None:
        """Return why a supervisor would end the flight right after a take-off, or None."""
        if entry.estimate is None or not self._leaves_ground(state):
            return None
        found = self.foreseen(self._ticks.fleet)
        return f"`{found[0][0]}` prevents the take-off: {found[0][1]}" if found else None

    def foreseen(self, fleet: dict[str, Estimate | None]) -> list[Foreseen]:
        """Return (supervisor, reason, mission line) of each alarm that would end the mission at
        once if the vehicle flew now."""
        return self._foresee(self._ticks.standing(self.entered, fleet))

    def _leaves_ground(self, state: StatePlan) -> bool:
        """Return whether entering `state` now is a take-off."""
        return self.flight is GROUND and any(leg == (GROUND, AIR) for leg in state.legs)


def unfit(state: StatePlan, flight: Flight, estimated: bool) -> str | None:
    """Return why the behavior of `state` can't start in this flight phase, or with or without an
    estimate; None if it can."""
    name, cls = state.behavior.name, state.behavior.cls
    if all(leg.start is not flight for leg in state.legs):
        where = {GROUND: "on the ground", AIR: "in the air", MOVING: "between ground and air"}
        return f"`{name}` can't start while the vehicle is {where[flight]}"
    if cls.needs_estimate and not estimated:
        return f"`{name}` can't start without an estimate"
    return None
