"""What the simulator keeps of every vehicle from one physics step to the next: plain numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

Numbers = tuple[float, ...]


class Rows(Protocol):
    """A row of numbers for each vehicle, by its place in the world."""

    def __getitem__(self, vehicle: int) -> Numbers: ...
    def __setitem__(self, vehicle: int, numbers: Numbers) -> None: ...


class Aboard:
    """The rows of `count` vehicles. steps: how many physics steps have been made.

    setpoints, filters, loops, gains: what `onboard` follows, has estimated, remembers and is tuned
    by. controls, rotors, thrusts, winds, constants: what `rotors.push` takes.
    """

    def __init__(self, count: int, rows: Callable[[int, int], Any]) -> None:
        self.count, self.steps = count, 0
        self.tables = [rows(count, width) for width in (10, 8, 7, 12, 4, 4, 4, 2, 4)]
        self.setpoints: Rows
        self.setpoints, self.filters, self.loops, self.gains, *rest = self.tables
        self.controls, self.rotors, self.thrusts, self.winds, self.constants = rest
