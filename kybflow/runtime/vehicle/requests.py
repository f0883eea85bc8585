"""Requests of people, flows and callbacks: switch, pause, resume, enable, reset, retire.

A request waits for the vehicle's next `act`, which answers it after the supervisors and before the
mission's transitions. A refusal is published as an event with its reason and changes nothing. With
a latched reaction, a vehicle accepts only severer states; while braked, only those that land it.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from functools import partial
from typing import NamedTuple

from kybflow.core.errors import Refused
from kybflow.core.signals import Reaction, Time
from kybflow.dsl.plan import StatePlan, VehiclePlan
from kybflow.parts import GROUND
from kybflow.runtime.events import Events
from kybflow.runtime.safety.failsafe import Failsafe
from kybflow.runtime.vehicle.activity import Activity, unfit
from kybflow.runtime.vehicle.override import ManualOverride
from kybflow.runtime.vehicle.reactions import Reactions

_SAFER = {
    "auto_home": Reaction.GO_HOME,
    "auto_land": Reaction.LAND,
    "land_blind": Reaction.LAND_BLIND,
}
"""The built-in states that make any vehicle safer, and the reaction that each one equals."""
_STAYS = frozenset({"auto_land", "landed", "fault"})


class Requester(IntEnum):
    """The source of a request; of several in one tick, the lowest value wins."""

    OPERATOR = 0
    FLOW = 1
    CALLBACK = 2


class SwitchRequest(NamedTuple):
    """A request to enter `state`; `at` is the mission line of its source."""

    state: str
    by: Requester
    at: str


class Requests:
    """What others ask of a vehicle, and the answers.

    waiting: whether a request waits. off: the labels of the processors that are switched off.
    retired: why the vehicle lands for the rest of the run, None while it flies its mission.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        activity: Activity,
        failsafe: Failsafe,
        reactions: Reactions,
        override: ManualOverride,
        events: Events,
    ) -> None:
        self.waiting = False
        self.off: set[str] = set()
        self.retired: str | None = None
        self._switches: list[SwitchRequest] = []
        self._orders: list[Callable[[Time], None]] = []
        self._plan, self._activity, self._failsafe = plan, activity, failsafe
        self._reactions, self._override, self._events = reactions, override, events

    def switch(self, state: str, by: Requester, at: str = "") -> None:
        """Request one of the vehicle's states."""
        self._switches.append(SwitchRequest(state, by, at))
        self.waiting = True

    def pause(self, by: str, at: str = "") -> None:
        """Request a hold, with the behavior and its timers frozen, until `resume`."""
        self._order(partial(self._pause, by, at))

    def resume(self, by: str, at: str = "") -> None:
        """Request that the behavior resumes that a pause or a pilot interrupted."""
        self._order(partial(self._resume, by, at))

    def enable(self, label: str, on: bool, by: str, at: str = "") -> None:
        """Request to switch the processor `label` on or off."""
        self._order(partial(self._enable, label, on, by, at))

    def reset(self, by: str, at: str = "") -> None:
        """Request to clear the fault and the resting place of a vehicle on the ground, after a
        person has checked it."""
        self._order(partial(self._reset, by, at))

    def retire(self, reason: str) -> None:
        """Land and stay on the ground, because the run ends as planned."""
        self.retired = reason
        activity = self._activity
        if self._failsafe.latched is None and activity.machine.state not in _STAYS:
            self._failsafe.clear_brake()
            activity.go("auto_land" if activity.off_ground else "landed")

    @property
    def paused(self) -> bool:
        """Whether somebody paused the vehicle."""
        hold = self._activity.hold
        return hold is not None and "pause" in hold.holders

    def answer(self, now: Time) -> None:
        """Answer the waiting requests: in order, then one switch of state."""
        orders, self._orders = self._orders, []
        for order in orders:
            order(now)
        asked, self._switches, self.waiting = self._switches, [], bool(self._orders)
        if not asked:
            return
        heard = min(asked, key=lambda request: request.by)
        for loser in asked:
            if loser.state != heard.state:
                winner = f"the {heard.by.name.lower()} asked for `{heard.state}`"
                self._refuse(loser, f"{winner} in the same tick")
        reason = self._against(heard) or self._granted(heard)
        if reason is not None:
            self._refuse(heard, reason)

    def _order(self, order: Callable[[Time], None]) -> None:
        self._orders.append(order)
        self.waiting = True

    def _against(self, request: SwitchRequest) -> str | None:
        """Return why the request can't be granted, None if it can."""
        state, latched = self._plan.states.get(request.state), self._failsafe.latched
        if self._override.is_somebodys:
            return "somebody else has control, until `operator.resume`"
        if state is None or request.state == "fault":
            return "it is not a state that can be requested"
        if self._activity.machine.state == "fault":
            return "it is in `fault`, until a person resets it"
        if latched is not None and _SAFER.get(request.state, Reaction.WARN) <= latched:
            return f"failsafe active (`{latched.name.lower()}`)"
        entry = self._activity.entry()
        held = None if _comes_down(state) else self._held(request)
        return held or unfit(state, entry.flight, entry.estimate is not None)

    def _held(self, request: SwitchRequest) -> str | None:
        """Return why the vehicle may only enter states that land it, None if it may enter any."""
        if self.retired is not None:
            return f"the run ends: {self.retired}"
        if self._failsafe.braking is not None:
            return f"the failsafe brakes it ({self._failsafe.braking})"
        if self.paused and request.by is not Requester.OPERATOR:
            return "it is paused"
        return None

    def _granted(self, request: SwitchRequest) -> str | None:
        """Enter the state; return why its behavior refused to start, None if it started."""
        try:
            self._activity.switch(request.state, request.at)
        except Refused as refusal:
            return str(refusal)
        self._failsafe.waive_brake()
        if self._failsafe.latched is not None:
            self._failsafe.latched = _SAFER.get(request.state)
        return None

    def _refuse(self, request: SwitchRequest, reason: str) -> None:
        by = request.by.name.lower()
        self._tell("switch_refused", request.at, state=request.state, by=by, reason=reason)

    def _pause(self, by: str, at: str, _: Time) -> None:
        latched = self._failsafe.latched
        if self._activity.machine.state == "fault" or latched is not None:
            has = "it is in `fault`" if latched is None else f"failsafe active ({latched.name})"
            self._tell("pause_refused", at, by=by, reason=has.lower())
        elif not self.paused:
            self._activity.freeze("pause")
            self._tell("paused", at, by=by)

    def _resume(self, by: str, at: str, now: Time) -> None:
        self._override.reclaim(now)
        hold = self._activity.hold
        if hold is not None and self.paused:
            hold.leave("pause", now)
            self._tell("resumed", at, by=by)

    def _enable(self, label: str, on: bool, by: str, at: str, _: Time) -> None:
        parts = {part.label: part.cls for part in self._plan.processors}
        reason = None
        if label not in parts:
            reason = "only processors are switched on and off"
        elif parts[label].safety:
            reason = "a safety part can't be switched off"
        if reason is not None:
            option = f"{self._plan.name}.{label}"
            self._tell("option_refused", at, option=option, by=by, reason=reason)
        elif on is (label in self.off):
            self.off ^= {label}
            if on:
                self._tell("processor_enabled", at, processor=label, by=by)
            else:
                self._tell("processor_disabled", at, processor=label, by=by)

    def _reset(self, by: str, at: str, now: Time) -> None:
        if self._activity.off_ground or self._reactions.falls(now):
            self._tell("reset_refused", at, by=by, reason="it is in the air")
            return
        self._failsafe.reset()
        self._activity.resting_place = None
        if self._activity.machine.state == "fault":
            self._activity.go("landed")
        self._tell("reset", at, by=by)

    def _tell(self, event: str, at: str, **fields: str) -> None:
        self._events.tell(event, self._plan.name, at, **fields)


def _comes_down(state: StatePlan) -> bool:
    """Return whether `state` makes a flying vehicle safer: it flies home, or ends on the ground."""
    airborne = [leg for leg in state.legs if leg.start is not GROUND]
    lands = bool(airborne) and all(leg.end is GROUND for leg in airborne)
    return lands or state.name in _SAFER
