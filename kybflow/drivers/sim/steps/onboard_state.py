"""What the simulator keeps of every vehicle from one physics step to the next: plain numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

Numbers = tuple[float, ...]
LONGEST = 50
"""The longest dead time of the on-board loop, in physics steps."""


class Rows(Protocol):
    """A row of numbers for each vehicle, by its place in the world."""

    def __getitem__(self, vehicle: int) -> Numbers: ...
    def __setitem__(self, vehicle: int, numbers: Numbers) -> None: ...


class OnboardState:
    """The rows of `count` vehicles. steps: how many physics steps have been made. is_slow: one of
    their on-board loops filters its gyroscope or has a dead time.

    setpoints, filters, loops, gains: what `onboard` follows, has estimated, remembers and is tuned
    by. gyros: what their gyroscopes' filters remember. asked: the controls that are on their way to
    the rotors, `LONGEST` rows a vehicle, and in `delays` where the next stands and how many there
    are. controls, rotors, thrusts, winds, pushes, constants: what `rotors.push` takes.
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
        """The controls that reach a vehicle's rotors in the step in which `wanted` is asked for."""
        place, count = self.delays[vehicle]
        if count == 0.0:
            return wanted
        here = vehicle * LONGEST + int(place)
        arrived, self.asked[here] = self.asked[here], wanted
        self.delays[vehicle] = ((place + 1.0) % count, count)
        return arrived
