"""The on-board state of every vehicle between physics steps, as plain numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

Numbers = tuple[float, ...]
LONGEST = 50
"""The longest dead time of the on-board loop, in physics steps."""


class Rows(Protocol):
    """Rows of numbers, one for each vehicle, by the vehicle's index in the world."""

    def __getitem__(self, vehicle: int) -> Numbers: ...
    def __setitem__(self, vehicle: int, numbers: Numbers) -> None: ...


class OnboardState:
    """The on-board state of `count` vehicles. steps: number of physics steps made. is_slow: whether
    any on-board loop filters its gyroscope or has a dead time.

    setpoints, filters, loops, gains, gyros: setpoints, estimates, control states, gains and
    gyroscope filters of `onboard`. asked: controls delayed by the dead time, `LONGEST` rows per
    vehicle. delays: index of the next of these rows, and their number. controls, rotors, thrusts,
    winds, pushes, constants: the arguments of `rotors.push`.
    """

    def __init__(self, count: int, rows: Callable[[int, int], Any]) -> None:
        self.count, self.steps, self.is_slow = count, 0, False
        widths = (10, 8, 7, 14, 7, 2, 4, 4, 4, 3, 6, 5)
        self.tables = [*(rows(count, width) for width in widths), rows(count * LONGEST, 4)]
        self.setpoints: Rows
        self.setpoints, self.filters, self.loops, self.gains, self.gyros, *rest = self.tables
        self.delays: Rows
        self.asked: Rows
        self.delays, self.controls, self.rotors, self.thrusts, *rest = rest
        self.winds, self.pushes, self.constants, self.asked = rest

    def delayed(self, vehicle: int, wanted: Numbers) -> Numbers:
        """Return the controls that reach a vehicle's rotors now, and queue `wanted` for the dead
        time."""
        place, count = self.delays[vehicle]
        if count == 0.0:
            return wanted
        here = vehicle * LONGEST + int(place)
        arrived, self.asked[here] = self.asked[here], wanted
        self.delays[vehicle] = ((place + 1.0) % count, count)
        return arrived
