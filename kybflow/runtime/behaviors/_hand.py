"""The sticks of the person who steers a behavior. They take effect once they have been centred."""

from __future__ import annotations

from kybflow.core.signals import NS, Tick, Time
from kybflow.parts import AXES, Entry

_HELD_TICKS = 1.5
"""Ticks between two updates from which on the vehicle counts as having been held in between."""


def was_held(last: Time, tick: Tick) -> bool:
    """Return whether the vehicle was held between its update at `last` and this one."""
    return (tick.now - last) / NS > _HELD_TICKS * tick.dt


class Hand:
    """The sticks of an input device. After the input was lost or the vehicle was held, the sticks
    steer again once they have been at their centres.

    lost: seconds for which the input has been lost.
    waits_for: what the vehicle waits for, as a text, empty while the sticks steer it.
    """

    def __init__(self, name: str, entry: Entry) -> None:
        reading = entry.inputs.get(name)
        self.lost, self.waits_for = 0.0, ""
        self._name, self._last = name, entry.now
        self._obeys = reading is not None and reading.is_centred(AXES)

    def axes(self, tick: Tick) -> tuple[float, ...] | None:
        """Return the four axes, or None while the vehicle must brake. Must be called once a
        tick."""
        reading = tick.inputs.get(self._name)
        if reading is None or was_held(self._last, tick):
            self._obeys = False
        self._last = tick.now
        self.lost = 0.0 if reading is not None else self.lost + tick.dt
        if reading is None:
            return None
        self._obeys = self._obeys or reading.is_centred(AXES)
        centred = f"the sticks of `{self._name}` to be at their centres"
        self.waits_for = "" if self._obeys else centred
        if not (self._obeys and reading.engaged):
            return None
        return tuple(reading.axes[axis] for axis in AXES)
