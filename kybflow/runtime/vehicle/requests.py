"""Requests of people, flows and callbacks: switch, pause, resume, enable, perform, reset, retire.

A request waits for the vehicle's next `act`, which answers it after the supervisors and before the
mission's transitions. A refused request has no effect. The requester receives the answer, and an
event reports the reason of a refusal. While a reaction is latched, a vehicle accepts only severer
states; while it is braked, only states that land it or take it home.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from enum import IntEnum
from functools import partial
from typing import Any, NamedTuple, Protocol

from kybflow.core.errors import PartFailed, Refused, described
from kybflow.core.events import VehicleEvent
from kybflow.core.geometry import Vec3
from kybflow.core.signals import NS, PlannedPoint, Reaction, Time
from kybflow.dsl.names import AUTO_HOME, AUTO_LAND, FAULT, LAND_BLIND, LANDED
from kybflow.dsl.plan import StatePlan, Values, VehiclePlan
from kybflow.flight.motion import Coast, Pace
from kybflow.parts import GROUND
from kybflow.parts.events import (
    OptionRefusedEvent,
    Paused,
    PauseRefused,
    Performed,
    PerformRefused,
    ProcessorDisabled,
    ProcessorEnabled,
    Reset,
    ResetRefused,
    Resumed,
    SwitchRefused,
)
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.behavior_runner import BehaviorRunner, unfit
from kybflow.runtime.vehicle.failsafe import Failsafe, Reactions
from kybflow.runtime.vehicle.link import LinkOut
from kybflow.runtime.vehicle.override import ManualOverride

_SAFER = {
    AUTO_HOME: Reaction.GO_HOME,
    AUTO_LAND: Reaction.LAND,
    LAND_BLIND: Reaction.LAND_BLIND,
}
"""The built-in states that make any vehicle safer, and the reaction that leads to each."""
_TAKEN = "another pilot or program has control until `operator.resume`"
_STAYS = frozenset({AUTO_LAND, LANDED, FAULT})


Answered = Callable[[str | None], None]
"""Receives the answer to a request: why it was refused, None when it was granted."""
_Order = Callable[[Time], str | None]
"""Carries out a request at the given time; returns why it is refused, None if it is granted."""


def unheard(_: str | None) -> None:
    """Ignore the answer to a request; an event reports it anyway."""


class Requester(IntEnum):
    """The source of a request. Among several requests in one tick, the lowest value wins."""

    OPERATOR = 0
    FLOW = 1
    CALLBACK = 2


class EntryJudge(Protocol):
    """Checks the values with which a state is requested, with the compiler's checks and
    messages."""

    def read(self, vehicle: str, state: str, written: Values) -> Values:
        """Return the values (SI) of a person's command, given as text. Raises Refused."""

    def objection(
        self, vehicle: str, state: str, params: Any, points: Sequence[Vec3]
    ) -> str | None:
        """Return why the state must not be entered with these parameters at `points` (world, m),
        or None."""


class NoJudge:
    """The judge of a run that can't check values: it refuses every request with values."""

    def read(self, vehicle: str, state: str, written: Values) -> Values:
        raise Refused(_NOT_HERE)

    def objection(
        self, vehicle: str, state: str, params: Any, points: Sequence[Vec3]
    ) -> str | None:
        return _NOT_HERE


_NOT_HERE = "values can't be checked here"
_MOST_ACTIONS = 10
"""Largest number of actions that a vehicle performs within a second. More would only delay its
other messages."""


class SwitchRequest(NamedTuple):
    """A request to enter a state. at: the mission line that makes the request. values: parameters
    that replace those of the mission."""

    state: str
    by: Requester
    at: str = ""
    answered: Answered = unheard
    values: Values = ()

    @property
    def goal(self) -> tuple[str, Values]:
        return self.state, self.values


class Requests:
    """Receives and answers the requests to one vehicle.

    waiting: whether a request waits.
    off: the labels of the processors that are switched off.
    retired: why the run ends, so that the vehicle accepts only states that land it; None during
    the mission.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        link: LinkOut,
        runner: BehaviorRunner,
        failsafe: Failsafe,
        reactions: Reactions,
        override: ManualOverride,
        judge: EntryJudge,
        events: Events,
    ) -> None:
        self.waiting = False
        self.off: set[str] = set()
        self.retired: str | None = None
        self._judge = judge
        self._switches: list[SwitchRequest] = []
        self._orders: deque[tuple[_Order, Answered]] = deque()
        self._performed: deque[Time] = deque(maxlen=_MOST_ACTIONS)
        self._plan, self._link = plan, link
        self._runner, self._failsafe = runner, failsafe
        self._reactions, self._override, self._events = reactions, override, events

    def switch(
        self,
        state: str,
        by: Requester,
        at: str = "",
        answered: Answered = unheard,
        values: Values = (),
    ) -> None:
        """Request to enter one of the vehicle's states."""
        self._switches.append(SwitchRequest(state, by, at, answered, values))
        self.waiting = True

    def track(self, point: PlannedPoint) -> str | None:
        """Give the active behavior a point of a planner's trajectory. Return why the point is
        refused, or None."""
        runner = self._runner
        if runner.hold is not None:
            return "it is held"
        return runner.behavior.take(point, self._events.now)

    @property
    def comes_down(self) -> bool:
        """Whether the vehicle is in the air under a latched failsafe reaction, so that it may be
        in the way of others."""
        return self._failsafe.latched is not None and self._runner.off_ground

    @property
    def pace(self) -> Pace | None:
        """The pace of the behavior if it was entered in this tick and has one, else None."""
        runner = self._runner
        begins = runner.hold is None and runner.entered == self._events.now
        return runner.behavior.pace if begins else None

    def keep(self, pace: Pace) -> None:
        """Make the behavior fly at a slower pace. The behavior must have a `pace`."""
        self._runner.behavior.keep(pace)

    def read(self, state: str, written: Values) -> Values:
        """Return the values (SI) that a person gave as text for a state. Raises Refused."""
        return self._judge.read(self._plan.name, state, written) if written else ()

    def pause(self, by: str, at: str = "", answered: Answered = unheard) -> None:
        """Request to hold the vehicle, with its behavior and timers frozen, until `resume`."""
        self._order(partial(self._pause, by, at), answered)

    def resume(self, by: str, at: str = "", answered: Answered = unheard) -> None:
        """Request to resume the behavior that a pause or a pilot interrupted."""
        self._order(partial(self._resume, by, at), answered)

    def enable(
        self, label: str, on: bool, by: str, at: str = "", answered: Answered = unheard
    ) -> None:
        """Request to switch the processor `label` on or off."""
        self._order(partial(self._enable, label, on, by, at), answered)

    def perform(self, act: str, by: str, at: str = "", answered: Answered = unheard) -> None:
        """Request one of the actions of the vehicle's driver."""
        self._order(partial(self._perform, act, by, at), answered)

    def reset(self, by: str, at: str = "", answered: Answered = unheard) -> None:
        """Request to clear the fault and the recorded resting place of a vehicle on the ground,
        after a person has checked the vehicle."""
        self._order(partial(self._reset, by, at), answered)

    def note_end(self, reason: str) -> None:
        """Accept only states that land the vehicle from now on, because the run ends. reason: what
        refused requests are told. The first reason is kept."""
        self.retired = self.retired or reason

    def retire(self, reason: str) -> None:
        """Land and stay on the ground, because the run ends as planned or a person landed the
        vehicle. reason: what refused requests are told. A paused landing is continued."""
        self.retired = reason
        runner = self._runner
        stays = runner.machine.state in _STAYS and not self.paused
        if self._failsafe.latched is None and not stays:
            self._failsafe.clear_brake()
            runner.enter_built_in(AUTO_LAND if runner.off_ground else LANDED)

    @property
    def paused(self) -> bool:
        """Whether a pause holds the vehicle."""
        hold = self._runner.hold
        return hold is not None and "pause" in hold.holders

    def answer(self, now: Time) -> None:
        """Answer the waiting requests in order, and finally at most one request to switch the
        state."""
        for _ in range(len(self._orders)):
            order, answered = self._orders.popleft()
            _answer(partial(order, now), [answered])
        asked, self._switches, self.waiting = self._switches, [], bool(self._orders)
        if not asked:
            return
        first = min(asked, key=lambda request: request.by)
        for other in asked:
            if other.goal != first.goal:
                winner = f"the {first.by.name.lower()} requested `{first.state}`"
                other.answered(self._refuse(other, f"{winner} in the same tick"))
        same = [request.answered for request in asked if request.goal == first.goal]
        _answer(partial(self._switch, first), same)

    def objection(
        self, state: str, by: Requester = Requester.OPERATOR, values: Values = ()
    ) -> str | None:
        """Return why a request for `state` with these values would be refused now, or None if no
        reason is known. The behavior may still refuse to start."""
        plan, latched = self._plan.states.get(state), self._failsafe.latched
        if self._override.is_taken:
            return _TAKEN
        if plan is None or state == FAULT:
            return "it is not a state that can be requested"
        if self._runner.machine.state == FAULT:
            return "it is in `fault`, until a person resets it"
        if latched is not None and _SAFER.get(state, Reaction.WARN) <= latched:
            return f"failsafe active (`{latched.name.lower()}`)"
        entry = self._runner.entry()
        held = None if _comes_down(plan) else self._held(by)
        fit = held or unfit(plan, entry.flight, entry.estimate is not None)
        fit = fit or self._runner.misplaced(plan, entry.estimate)
        return fit or (self._misled if values else self._runner.entry_objection)(plan, values)

    def pause_objection(self) -> str | None:
        """Return why a pause would be refused now, because the failsafe controls the vehicle, or
        None if it would be granted."""
        latched = self._failsafe.latched
        if self._runner.machine.state == FAULT:
            return "it is in `fault`"
        return None if latched is None else f"failsafe active ({latched.name.lower()})"

    def resume_objection(self) -> str | None:
        """Return why there is nothing to resume now, or None if there is."""
        if self._override.is_taken or self.paused:
            return None
        braking = self._failsafe.braking
        return "it is not paused" if braking is None else f"the failsafe brakes it ({braking})"

    def land_objection(self) -> str | None:
        """Return why a person can't land the vehicle now, or None."""
        return _TAKEN if self._override.is_taken else None

    def reset_objection(self, now: Time) -> str | None:
        """Return why a reset would be refused now, or None."""
        in_the_air = self._runner.off_ground or self._reactions.falls(now)
        return "it is in the air" if in_the_air else None

    def perform_objection(self, act: str) -> str | None:
        """Return why the driver's action `act` would be refused now, or None if the decision is up
        to the vehicle."""
        driver = self._plan.driver
        known = driver.cls.acts.get(act)
        if known is None:
            return f"its driver performs no `{act}`"
        if known.needs is not None and not getattr(driver.params, known.needs):
            return f"its driver performs it with `{known.needs}: true` only"
        if not known.moves:
            return None
        if self._override.is_taken:
            return _TAKEN
        return self.pause_objection() or self._held(Requester.OPERATOR)

    def _order(self, order: _Order, answered: Answered) -> None:
        self._orders.append((order, answered))
        self.waiting = True

    def _switch(self, request: SwitchRequest) -> str | None:
        """Enter the requested state; return why that is refused, or None if it was entered."""
        reason = self.objection(request.state, request.by, request.values) or None
        if reason is None:
            try:
                self._runner.switch(request.state, request.at, request.values)
            except Refused as refusal:
                reason = str(refusal)
            except PartFailed as failure:
                if not request.values:
                    raise
                reason = str(failure)  # the values are not the mission's: it has not failed
        if reason is not None:
            return self._refuse(request, reason)
        self._failsafe.give_way(_SAFER.get(request.state))
        return None

    def _held(self, by: Requester) -> str | None:
        """Return why the vehicle may enter only states that land it or take it home, or None if it
        may enter any state."""
        if self.retired is not None:
            return self.retired
        if self._failsafe.braking is not None:
            return f"the failsafe brakes it ({self._failsafe.braking})"
        if self.paused and by is not Requester.OPERATOR:
            return "it is paused"
        return None

    def _misled(self, state: StatePlan, values: Values) -> str | None:
        """Return why a request with these values is refused, or None. The values are checked at the
        vehicle's position and at the position where it would come to rest."""
        motion = self._runner.entry().motion
        points = tuple(dict.fromkeys((motion.position, Coast.after(motion).end)))
        try:
            params = self._runner.params_of(state.name, values)
            reason = self._judge.objection(self._plan.name, state.name, params, points)
            return reason or self._runner.entry_objection(state, values)
        except Exception as error:  # a part may raise anything, and nothing has changed yet
            return described(error)

    def _refuse(self, request: SwitchRequest, reason: str) -> str:
        by = request.by.name.lower()
        self._emit(SwitchRefused(state=request.state, by=by, reason=reason), request.at)
        return reason

    def _pause(self, by: str, at: str, _: Time) -> str | None:
        reason = self.pause_objection()
        if reason is not None:
            self._emit(PauseRefused(by=by, reason=reason), at)
        elif not self.paused:
            self._runner.freeze("pause")
            self._emit(Paused(by=by), at)
        return reason

    def _resume(self, by: str, at: str, now: Time) -> str | None:
        reason = self.resume_objection()
        self._override.reclaim(now)
        hold = self._runner.hold
        if hold is not None and self.paused:
            hold.leave("pause", now)
            self._emit(Resumed(by=by), at)
        return reason

    def _enable(self, label: str, on: bool, by: str, at: str, _: Time) -> str | None:
        parts = {part.label: part.cls for part in self._plan.processors}
        reason = None
        if label not in parts:
            reason = "only processors can be switched on and off"
        elif parts[label].safety:
            reason = "a safety part can't be switched off"
        if reason is not None:
            option = f"{self._plan.name}.{label}"
            self._emit(OptionRefusedEvent(option=option, by=by, reason=reason), at)
        elif on is (label in self.off):
            self.off ^= {label}
            if on:
                self._emit(ProcessorEnabled(processor=label, by=by), at)
            else:
                self._emit(ProcessorDisabled(processor=label, by=by), at)
        return reason

    def _perform(self, act: str, by: str, at: str, now: Time) -> str | None:
        recent, reason = self._performed, self.perform_objection(act)
        if reason is None and len(recent) == _MOST_ACTIONS and now - recent[0] < NS:
            reason = f"it was already asked for {_MOST_ACTIONS} acts within a second"
        if reason is None:
            try:
                self._link.perform(act, now)
            except Refused as refusal:
                reason = str(refusal)
        if reason is None:
            recent.append(now)
            self._emit(Performed(act=act, by=by), at)
        else:
            self._emit(PerformRefused(act=act, by=by, reason=reason), at)
        return reason

    def _reset(self, by: str, at: str, now: Time) -> str | None:
        reason = self.reset_objection(now)
        if reason is not None:
            self._emit(ResetRefused(by=by, reason=reason), at)
            return reason
        self._failsafe.reset()
        self._runner.reset()
        self._emit(Reset(by=by), at)
        return None

    def _emit(self, event: VehicleEvent, at: str) -> None:
        self._events.emit(event, self._plan.name, at)


def _answer(order: Callable[[], str | None], asking: Sequence[Answered]) -> None:
    """Carry out a request and answer its requesters, even if a part raises."""
    try:
        reason = order()
    except Exception as error:
        failed = str(error) if isinstance(error, PartFailed) else described(error)
        for answered in asking:
            answered(failed)
        raise
    for answered in asking:
        answered(reason)


def _comes_down(state: StatePlan) -> bool:
    """Return whether `state` makes a flying vehicle safer: it flies home, or ends on the ground."""
    airborne = [leg for leg in state.legs if leg.start is not GROUND]
    lands = bool(airborne) and all(leg.end is GROUND for leg in airborne)
    return lands or state.name in _SAFER
