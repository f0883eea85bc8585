"""The failsafe of one vehicle: what its supervisors and processors report becomes one reaction.

Severest first: `land_blind`, `land`, `brake`, `warn`. An alarm that persists is told once. From
`land` upwards the reaction latches: nothing but a severer one is heard until the vehicle rests in
`fault`, on the ground. A reaction that needs a position is replaced by `land_blind` where there is
none. A part that raises lands its vehicle; a supervisor that does is not asked again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kybflow.errors import PartFailed, described
from kybflow.parts import Supervisor
from kybflow.runtime.events import Events
from kybflow.signals import NS, Alarm, Reaction, Tick, Time

STATES = {
    Reaction.BRAKE: "brake",
    Reaction.LAND: "auto_land",
    Reaction.LAND_BLIND: "land_blind",
}
"""The built-in state that each reaction puts the vehicle in."""
_QUIET = NS // 2
"""An alarm that was silent for so long is told again."""


class Failsafe:
    """`latched` is the reaction that can't be undone in the air any more, or None."""

    def __init__(
        self, vehicle: str, supervisors: Mapping[str, Supervisor[Any]], events: Events
    ) -> None:
        self.latched: Reaction | None = None
        self._vehicle = vehicle
        self._supervisors = tuple(supervisors.items())
        self._failed: Alarm | None = None
        self._events = events
        self._last: dict[str, Time] = {}

    def check(self, tick: Tick, airborne: bool) -> Alarm | None:
        """Ask every supervisor; the severest alarm of this tick, None when all is well."""
        worst: Alarm | None = None
        for label, supervisor in self._supervisors:
            try:
                alarm = supervisor.check(tick, airborne)
            except Exception as error:  # a part may raise anything
                self._supervisors = tuple(s for s in self._supervisors if s[0] != label)
                self.report(PartFailed(label, error))
                continue
            if alarm is not None:
                self.tell(alarm, tick.now)
                if worst is None or alarm.reaction > worst.reaction:
                    worst = alarm
        failed, self._failed = self._failed, None
        return failed if failed and (not worst or failed.reaction > worst.reaction) else worst

    def foresee(self, tick: Tick) -> list[tuple[str, str]]:
        """What would make it land at once if it flew as it stands: (supervisor, reason)."""
        found = []
        for label, supervisor in self._supervisors:
            try:
                alarm = supervisor.check(tick, True)
            except Exception as error:  # a part may raise anything
                found.append((label, f"it failed: {described(error)}"))
                continue
            if alarm is not None and alarm.reaction >= Reaction.LAND:
                found.append((label, alarm.reason))
        return found

    def report(self, failure: PartFailed) -> None:
        """A part failed that a landing may do without; `check` asks for the landing."""
        self._failed = self.failure(failure, Reaction.LAND)

    def failure(self, failure: PartFailed, reaction: Reaction, at: str = "") -> Alarm:
        """Tell that a part failed; the alarm for it."""
        reason = str(failure)
        self._events.tell("part_failed", self._vehicle, at, part=failure.part, reason=reason)
        return Alarm("part_failed", reaction, f"`{failure.part}` failed: {reason}", 0.0, 0.0)

    def tell(self, alarm: Alarm, now: Time) -> None:
        """Make an alarm an event, once as long as it goes on."""
        last = self._last.get(alarm.event)
        self._last[alarm.event] = now
        if last is None or now - last > _QUIET:
            self._tell(alarm.event, alarm, alarm.reaction)

    def _tell(self, event: str, alarm: Alarm, reaction: Reaction) -> None:
        self._events.tell(
            event,
            self._vehicle,
            reaction=reaction.name.lower(),
            reason=alarm.reason,
            value=alarm.value,
            bound=alarm.bound,
        )

    def decide(self, alarm: Alarm, tick: Tick, airborne: bool, state: str) -> str | None:
        """The built-in state to go to for `alarm`, None when the vehicle may stay where it is."""
        reaction = alarm.reaction
        if reaction is Reaction.WARN:
            return None
        if not airborne:
            return "fault" if reaction >= Reaction.LAND and state != "fault" else None
        if tick.estimate is None:
            reaction = Reaction.LAND_BLIND
        if self.latched is not None and reaction <= self.latched:
            return None
        if reaction is Reaction.BRAKE and state in ("brake", "hover"):
            return None
        if reaction >= Reaction.LAND:
            self.latched = reaction
        self._tell("failsafe_started", alarm, reaction)
        return STATES[reaction]
