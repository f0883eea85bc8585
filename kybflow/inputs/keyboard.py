"""Steer with the keys of the mission's terminal.

`w` and `s` climb and sink, `a` and `d` turn, the arrows fly forward, back and sideways, and the
space bar stops everything. Every other letter, and `enter`, is a button of that name. A terminal
reports a key when it is pressed and while it repeats, but not its release. A key therefore deflects
its axis by `deflection` for 0.6 s, and by each repetition for another 0.15 s, so that the motion
stops 0.15 s after the release.

The keys of the live table (pause, land, ...) don't work while a keyboard steers; Ctrl-C lands.
"""

from __future__ import annotations

import re
import sys
from string import ascii_lowercase

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, InputReading, Time
from kybflow.core.terminal import Terminal
from kybflow.core.units import Ratio
from kybflow.parts import AXES, Input, InputLink, param, params
from kybflow.parts.input import SticksOf

STEERING = {
    "w": ("z", 1.0), "s": ("z", -1.0), "a": ("turn", 1.0), "d": ("turn", -1.0),
    "\x1b[A": ("x", 1.0), "\x1b[B": ("x", -1.0), "\x1b[D": ("y", 1.0), "\x1b[C": ("y", -1.0),
}  # fmt: skip
"""The axis that each key deflects, and the sign of the deflection."""
BUTTONS = (*(letter for letter in ascii_lowercase if letter not in STEERING), "enter")
_STOP, _ENTER = " ", ("\r", "\n")
_FIRST_HOLD_NS, _REPEAT_HOLD_NS = 6 * NS // 10, 15 * NS // 100
_KEY = re.compile(r"\x1b[\[O][0-9;]*[A-Za-z~]|.", re.DOTALL)


@params
class KeyboardParams:
    deflection: Ratio = param(
        "Deflection of an axis by a key.", default=0.7, above=0.0, at_most=1.0
    )


class Keyboard(Input[KeyboardParams]):
    stuck_after = None
    terminal_keys = "w s climb and sink, a d turn, arrows fly, space stops"

    @classmethod
    def buttons(cls, params: KeyboardParams) -> tuple[str, ...]:
        return BUTTONS

    @classmethod
    def open(cls, params: KeyboardParams, sticks_of: SticksOf) -> InputLink:
        if not sys.stdin.isatty():
            raise DriverError("there is no terminal for the keyboard")
        screen = sys.__stdout__  # the live table puts another in its place
        shown = screen.fileno() if screen is not None and screen.isatty() else None
        return KeyLink(params, Terminal(sys.stdin.fileno(), shown))


class KeyLink(InputLink):
    """Reads the keys of a terminal until it is closed."""

    def __init__(self, params: KeyboardParams, terminal: Terminal) -> None:
        self._params, self._terminal = params, terminal
        self._until: dict[str, tuple[float, Time]] = {}
        terminal.__enter__()

    def read(self, now: Time) -> InputReading | None:
        held: set[str] = set()
        typed = self._terminal.read().decode("utf-8", errors="ignore").replace("\x1bO", "\x1b[")
        for key in _KEY.findall(typed):
            letter = key.lower()
            if key == _STOP:
                self._until.clear()
            elif key in _ENTER:
                held.add("enter")
            elif letter in BUTTONS:
                held.add(letter)
            elif steers := STEERING.get(key if key.startswith("\x1b") else letter):
                axis, way = steers
                value = way * self._params.deflection
                repeats = self._until.get(axis, (0.0, 0))[0] == value
                self._until[axis] = value, now + (_REPEAT_HOLD_NS if repeats else _FIRST_HOLD_NS)
        self._until = {axis: way for axis, way in self._until.items() if way[1] > now}
        axes = {axis: self._until[axis][0] if axis in self._until else 0.0 for axis in AXES}
        return InputReading(now, axes, frozenset(held))

    def close(self) -> None:
        self._terminal.__exit__()
