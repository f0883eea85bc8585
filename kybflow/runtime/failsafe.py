"""The failsafe of one vehicle: what its supervisors and processors report becomes one reaction.

Severest first: `land_blind`, `land`, `brake`, `warn`. An alarm that persists is told once. From
`land` upwards the reaction latches: nothing but a severer one is heard until the vehicle rests in
`fault`, on the ground. A reaction that needs a position is replaced by `land_blind` where there is
none.
"""

from __future__ import annotations

from collections.abc import Sequence

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
        self, vehicle: str, supervisors: Sequence[Supervisor[object]], events: Events
    ) -> None:
        self.latched: Reaction | None = None
        self._vehicle = vehicle
        self._supervisors = supervisors
        self._events = events
        self._last: dict[str, Time] = {}

    def check(self, tick: Tick, airborne: bool) -> Alarm | None:
        """Ask every supervisor; the severest alarm of this tick, None when all is well."""
        worst: Alarm | None = None
        for supervisor in self._supervisors:
            alarm = supervisor.check(tick, airborne)
            if alarm is not None:
                self.tell(alarm, tick.now)
                if worst is None or alarm.reaction > worst.reaction:
                    worst = alarm
        return worst

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
