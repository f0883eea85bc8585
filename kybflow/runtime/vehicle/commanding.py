"""What can be asked of a vehicle from outside: switch, pause, resume, enable, reset, retire.

Each is decided in the vehicle's next `act`, after its supervisors and before its mission's own
arrows. What is refused is told as an event with the reason, and changes nothing. A latched vehicle
accepts only what is severer than what it does; one that brakes only what brings it down.
"""

from __future__ import annotations

from functools import partial

from kybflow.core.errors import Refused
from kybflow.core.signals import NS, Reaction, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import Entry
from kybflow.runtime.events import Events
from kybflow.runtime.safety.failsafe import Failsafe
from kybflow.runtime.safety.hold import Hold
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.activity import Activity
from kybflow.runtime.vehicle.requests import Asker, Wish, Wishes, comes_down, severity, unfit

_STAYS = frozenset({"auto_land", "landed", "fault"})


class Commanding:
    """The part of a vehicle that listens."""

    name: str
    now: Time
    plan: VehiclePlan
    activity: Activity
    failsafe: Failsafe
    _events: Events
    _score: VehicleScore

    def __init__(self) -> None:
        self._wishes = Wishes()
        self._off: set[str] = set()
        self._retired: str | None = None

    def entry(self) -> Entry:
        raise NotImplementedError

    def _select(self) -> None:
        raise NotImplementedError

    @property
    def state(self) -> str:
        """The name of the state that it is in."""
        return self.activity.machine.state

    @property
    def falls(self) -> bool:
        """Whether its rotors were cut just now."""
        raise NotImplementedError

    @property
    def paused(self) -> bool:
        hold = self.activity.hold
        return hold is not None and "pause" in hold.holders

    def ask(self, state: str, by: Asker, at: str = "") -> None:
        """Ask it to enter one of its states."""
        self._wishes.switch(Wish(state, by, at))

    def pause(self, by: str, at: str = "") -> None:
        """Ask it to come to rest and hold, its behavior and timers frozen, until `resume`."""
        self._wishes.order(partial(self._pause, by, at))

    def resume(self, by: str, at: str = "") -> None:
        """Ask it to go on with what it did when it was paused."""
        self._wishes.order(partial(self._resume, by, at))

    def enable(self, label: str, on: bool, by: str, at: str = "") -> None:
        """Ask it to use the processor `label` again, or no more."""
        self._wishes.order(partial(self._enable, label, on, by, at))

    def reset(self, by: str, at: str = "") -> None:
        """Ask it to forget its fault and where it stood, on the ground: a person was there."""
        self._wishes.order(partial(self._reset, by, at))

    def retire(self, reason: str) -> None:
        """Come down and stay there: the run ends as it should."""
        self._retired = reason
        activity = self.activity
        if self.failsafe.latched is None and activity.machine.state not in _STAYS:
            self.failsafe.unbrake()
            activity.go("auto_land" if activity.airborne else "landed", self.entry)

    def _answer(self) -> None:
        self._wishes.obey()
        wish, losers = self._wishes.taken()
        if wish is None:
            return
        for loser in losers:
            winner = f"the {wish.by.name.lower()} asked for `{wish.state}`"
            self._refuse(loser, f"{winner} in the same tick")
        reason = self._against(wish)
        if reason is None:
            reason = self._granted(wish)
        if reason is not None:
            self._refuse(wish, reason)

    def _against(self, wish: Wish) -> str | None:
        """Why the wish can't be granted, None when it can."""
        state, latched = self.plan.states.get(wish.state), self.failsafe.latched
        if state is None or wish.state == "fault":
            return "it is not one of its states that can be asked for"
        if self.activity.machine.state == "fault":
            return "it is in `fault`, until a person resets it"
        if latched is not None and (severity(wish.state) or Reaction.WARN) <= latched:
            return f"the failsafe has it (`{latched.name.lower()}`)"
        if self._retired is not None and not comes_down(state):
            return f"the run ends: {self._retired}"
        if self.failsafe.braking is not None and not comes_down(state):
            return f"the failsafe brakes it ({self.failsafe.braking})"
        if self.paused and wish.by is not Asker.OPERATOR and not comes_down(state):
            return "it is paused"
        entry = self.entry()
        return unfit(state, entry.flight, entry.estimate is not None)

    def _granted(self, wish: Wish) -> str | None:
        """Switch; why its behavior refused to, None when it did not."""
        try:
            self.activity.switch(wish.state, wish.at, self.entry)
        except Refused as refusal:
            return str(refusal)
        self.failsafe.unbrake()
        if self.failsafe.latched is not None:
            self.failsafe.latched = severity(wish.state)
        return None

    def _refuse(self, wish: Wish, reason: str) -> None:
        by = wish.by.name.lower()
        self._tell("switch_refused", wish.at, state=wish.state, by=by, reason=reason)

    def _pause(self, by: str, at: str) -> None:
        latched = self.failsafe.latched
        if self.activity.machine.state == "fault" or latched is not None:
            has = "it is in `fault`" if latched is None else f"the failsafe has it ({latched.name})"
            self._tell("pause_refused", at, by=by, reason=has.lower())
            return
        hold = self.activity.hold
        if hold is None or "pause" not in hold.holders:
            self.activity.freeze("pause", self.entry)
            self._tell("paused", at, by=by)

    def _resume(self, by: str, at: str) -> None:
        hold = self.activity.hold
        if hold is not None and "pause" in hold.holders:
            hold.leave("pause", self.now)
            self._tell("resumed", at, by=by)

    def _go_on_holding(self, hold: Hold, now: Time) -> None:
        """Let go when the brake's alarms are silent; land when it has lasted too long."""
        if "brake" in hold.holders and self.failsafe.release(now):
            hold.leave("brake", now)
        limit = self.plan.hover_limit
        if hold.lasts and self.activity.airborne and now - hold.since >= limit * NS:
            self._score.failure(f"held for {limit:g} s")
            self.failsafe.unbrake()
            self.activity.go("auto_land", self.entry)

    def _enable(self, label: str, on: bool, by: str, at: str) -> None:
        parts = {part.label: part.cls for part in self.plan.processors}
        reason = None
        if label not in parts:
            reason = "only processors are switched on and off"
        elif parts[label].safety:
            reason = "a safety part can't be switched off"
        if reason is not None:
            option = f"{self.name}.{label}"
            self._tell("option_refused", at, option=option, by=by, reason=reason)
            return
        if on is (label in self._off):
            self._off ^= {label}
            self._select()
            if on:
                self._tell("processor_enabled", at, processor=label, by=by)
            else:
                self._tell("processor_disabled", at, processor=label, by=by)

    def _reset(self, by: str, at: str) -> None:
        if self.activity.airborne or self.falls:
            self._tell("reset_refused", at, by=by, reason="it is in the air")
            return
        self.failsafe.reset()
        self.activity.stands = None
        if self.activity.machine.state == "fault":
            self.activity.go("landed", self.entry)
        self._tell("reset", at, by=by)

    def _tell(self, event: str, at: str, **fields: str) -> None:
        self._events.tell(event, self.name, at, **fields)
