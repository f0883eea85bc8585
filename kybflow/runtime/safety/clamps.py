"""Detects clamps: processors that keep a vehicle's setpoint from its behavior's goal.

A processor that `clamps`, like the fence, cuts off the setpoint at its bound, so that the vehicle
never reaches a goal beyond it. (With `limit_speed`, `limit_acceleration` and `smooth` the vehicle
only arrives later, and with an avoidance by a different path; that shows only in the errors.) A
deviation counts as a clamp from 2 cm on, or from 5 cm/s for velocity setpoints. `clamp_started` is
emitted when a clamp begins, and `clamp_ended`, with its largest deviation and its duration, once
the clamp has changed nothing for half a second.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.geometry import ZERO, distance
from kybflow.core.signals import NS, Setpoint, Time
from kybflow.core.units import format_measured
from kybflow.parts.events import ClampEnded, ClampStarted
from kybflow.runtime.events import Events

_LEAST, _LEAST_SPEED = 0.02, 0.05
"""Least deviations that count as a clamp, m and m/s."""
_QUIET = NS // 2


class _Clamp:
    """An active clamp. since: when it began. last: when it last changed a setpoint. most: its
    largest deviation, in `unit`."""

    def __init__(self, now: Time) -> None:
        self.since = self.last = now
        self.most, self.unit = 0.0, "m"


class Clamps:
    """The clamps of one vehicle. names, lines: the names and mission lines of its processors, by
    label. active: the active clamps, by the label of the processor."""

    def __init__(
        self, vehicle: str, names: Mapping[str, str], lines: Mapping[str, str], events: Events
    ) -> None:
        self.active: dict[str, _Clamp] = {}
        self._vehicle, self._names, self._lines, self._events = vehicle, names, lines, events

    def note(self, label: str, asked: Setpoint, given: Setpoint, now: Time) -> str | None:
        """Compare the setpoints before and after a clamping processor. Return a description of how
        it keeps the vehicle from its goal, or None if it doesn't."""
        off, least, unit = _off(asked, given)
        if off < least:
            return None
        name = self._names[label]
        words = f"`{name}` keeps the setpoint {format_measured(off, unit)} off what is wanted"
        clamp = self.active.get(label)
        if clamp is None:
            clamp = self.active[label] = _Clamp(now)
            at = self._lines[label]
            self._events.emit(ClampStarted(processor=name, reason=words), self._vehicle, at)
        clamp.last, clamp.unit, clamp.most = now, unit, max(clamp.most, off)
        return words if unit == "m" else None

    def settle(self, now: Time) -> None:
        """End the clamps that have changed nothing for long enough."""
        over = [label for label, clamp in self.active.items() if now - clamp.last > _QUIET]
        for label in over:
            clamp = self.active.pop(label)
            ended = ClampEnded(
                processor=self._names[label],
                most=format_measured(clamp.most, clamp.unit),
                seconds=(clamp.last - clamp.since) / NS,
            )
            self._events.emit(ended, self._vehicle, self._lines[label])


def _off(asked: Setpoint, given: Setpoint) -> tuple[float, float, str]:
    """Return the deviation of `given` from `asked`, the least deviation that counts, and the unit
    of both."""
    if asked.position is not None and given.position is not None:
        return distance(asked.position, given.position), _LEAST, "m"
    return distance(asked.velocity or ZERO, given.velocity or ZERO), _LEAST_SPEED, "m/s"
