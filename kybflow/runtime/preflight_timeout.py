"""How long the preflight waits for what is not green yet.

`PATIENCE` seconds in all, counted from when the vehicles themselves were ready to fly, which they
have their driver's `patience` for: an autopilot's filter settles, a receiver finds its satellites.
What only a person can mend is not waited for longer. What is waited for is told, once.
"""

from __future__ import annotations

from collections.abc import Sequence

from kybflow.dsl.plan import Plan
from kybflow.runtime.events import Events
from kybflow.runtime.preflight import Line

PATIENCE = 5.0


class Patience:
    """Of one preflight."""

    def __init__(self, plan: Plan, events: Events) -> None:
        longest: list[float] = [vehicle.driver.cls.patience for vehicle in plan.vehicles]
        self._longest = max(PATIENCE, *longest)
        self._events = events
        self._ready = 0.0
        self._told: set[tuple[str, str]] = set()

    def ends(self, lines: Sequence[Line], seconds: float) -> bool:
        """Whether it is over: all is green, or red for too long."""
        if all(line.green for line in lines):
            return True
        waiting = [line for line in lines if line.waits]
        if waiting:
            self._ready = seconds
        hopeless = any(line.waits is False and not line.green for line in lines)
        bound = PATIENCE if hopeless else self._ready + PATIENCE
        late: bool = seconds >= min(bound, self._longest)
        if seconds >= PATIENCE and not late:
            self._tell(waiting)
        return late

    def _tell(self, waiting: Sequence[Line]) -> None:
        for vehicle, check, _, reason, at, _ in waiting:
            if (vehicle, check) not in self._told:
                self._told.add((vehicle, check))
                tell = self._events.tell
                tell("preflight_waits", vehicle, at, check=check, reason=reason)
