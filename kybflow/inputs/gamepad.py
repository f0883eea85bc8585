"""Steer with a gamepad or a joystick that SDL supports.

The default map is mode 2 of a drone's transmitter: the left stick climbs and turns, the right one
moves forward and sideways. To change it, name the source of an axis, with a minus to invert it:
`x: -right_y`. Sources and buttons of controllers that SDL knows have the names of an Xbox
controller (`left_x`, `left_y`, `right_x`, `right_y`, `left_trigger`, `right_trigger`; `a`, `b`,
`x`, `y`, `back`, `guide`, `start`, `left_stick`, `right_stick`, `left_shoulder`, `right_shoulder`,
`dpad_up`, `dpad_down`, `dpad_left`, `dpad_right`). Those of other joysticks are `axis0`, `button0`,
`hat_up` and so on.

A deflection v is measured from the edge of its dead zone d, with the expo e:

    s = (|v| - d) / (1 - d),    (1 - e) s + e s^3,    with the sign of v.

`controllers` names a table with the map and calibration of each controller. `low`, `centre` and
`high` are the source's values at its ends and at rest:

    controller, axis, source, low, centre, high
    Taranis, x, axis2, -0.92, 0.03, 0.95
    ...

The input uses the first controller whose name contains `controller`. Controllers may be plugged in
and out at any time; while there is none, or if it lacks the source of an axis, the input is lost.
Write `none` for an axis that the device doesn't have. Requires `pip install 'kybflow[inputs]'`.
"""

from __future__ import annotations

from collections import deque
from functools import cache
from typing import NamedTuple

from kybflow.core.errors import FileError
from kybflow.core.files import File, header_line, need, read_table
from kybflow.core.signals import InputReading, Time
from kybflow.core.text import did_you_mean
from kybflow.core.units import NUMBER, Number, Ratio
from kybflow.inputs import sdl
from kybflow.inputs.deflection import deflection
from kybflow.parts import AXES, Input, InputLink, param, params
from kybflow.parts.base import Objection
from kybflow.parts.input import SticksOf

_RAW = tuple(f"axis{i}" for i in range(sdl.NUMBERS))
NONE = "none"
"""The source of an axis that always reads zero."""
SOURCES = (*sdl.PAD_AXES, *_RAW, NONE)
BUTTONS = (
    *sdl.PAD_BUTTONS, "hat_left", "hat_right", "hat_down", "hat_up",
    *(f"button{i}" for i in range(sdl.NUMBERS)),
)  # fmt: skip
_COLUMNS = {
    "controller": None, "axis": None, "source": None,
    **dict.fromkeys(("low", "centre", "high"), NUMBER),
}  # fmt: skip
_MOST_PRESSES = 256
"""Largest number of unread button presses."""
_LIKE = "controller, axis, source, low, centre, high"


class Calibration(NamedTuple):
    """The source of an axis, and the source's values at both ends and at rest."""

    source: str
    low: float = -1.0
    centre: float = 0.0
    high: float = 1.0

    def read(self, state: sdl.PadState) -> float:
        """Return the axis's value, -1 to 1; zero if the device doesn't have its source."""
        raw = state.axes.get(self.source.removeprefix("-"), self.centre)
        span = self.high - self.centre if raw > self.centre else self.centre - self.low
        value = max(-1.0, min(1.0, (raw - self.centre) / span))
        return -value if self.source.startswith("-") else value


@cache
def read_controllers(file: File) -> dict[str, dict[str, Calibration]]:
    """Return the calibrations by controller and axis from a table. Raises FileError."""
    table = read_table(file.text, _COLUMNS, "axes", _LIKE)
    need(table, ("controller", "axis", "source"), header_line(file.text))
    found: dict[str, dict[str, Calibration]] = {}
    for number, values, words in table.rows:
        axis, source = words["axis"], words["source"]
        if axis not in AXES:
            raise FileError(f"there is no axis `{axis[:20]}`", number, did_you_mean(axis, AXES))
        if source.removeprefix("-") not in SOURCES:
            hint = did_you_mean(source, SOURCES)
            raise FileError(f"`{source[:20]}` is not a source of an axis", number, hint)
        ends = (values.get("low", -1.0), values.get("centre", 0.0), values.get("high", 1.0))
        if not ends[0] < ends[1] < ends[2]:
            raise FileError("`low`, `centre` and `high` must rise", number)
        found.setdefault(words["controller"], {})[axis] = Calibration(source, *ends)
    return found


@params
class GamepadParams:
    controller: str = param("Part of the controller's name; empty for any.", default="")
    x: str = param("Source of forward.", default="-right_y")
    y: str = param("Source of left.", default="-right_x")
    z: str = param("Source of up.", default="-left_y")
    turn: str = param("Source of turning counterclockwise.", default="-left_x")
    dead_zone: Ratio = param(
        "Deflection that counts as zero.", default=0.08, at_least=0.0, at_most=0.5
    )
    expo: Number = param("Softness around the centre.", default=0.3, at_least=0.0, at_most=1.0)
    controllers: File | None = param(
        "Table of maps and calibrations by controller.", default=None, reads=read_controllers
    )


class Gamepad(Input[GamepadParams]):
    packages = ("pygame-ce",)

    @classmethod
    def buttons(cls, params: GamepadParams) -> tuple[str, ...]:
        return BUTTONS

    @classmethod
    def objection(cls, params: GamepadParams) -> Objection | None:
        for axis in AXES:
            source = getattr(params, axis)
            if source.removeprefix("-") not in SOURCES:
                reason, hint = f"a gamepad has no axis `{source}`", did_you_mean(source, SOURCES)
                return Objection(axis, reason, hint)
        used: dict[str, str] = {}
        for axis in AXES:
            source = getattr(params, axis).removeprefix("-")
            first = used.setdefault(source, axis)
            if first != axis and source != NONE:
                reason = f"`{source}` would move both `{first}` and `{axis}`"
                is_usual = getattr(params, axis) == getattr(GamepadParams(), axis)
                wrong = first if is_usual else axis  # the one that the mission changes
                return Objection(wrong, reason, f"name another source, or `{NONE}`")
        return None

    @classmethod
    def open(cls, params: GamepadParams, sticks_of: SticksOf) -> InputLink:
        return PadLink(params)


class PadLink(InputLink):
    """Reads one controller, through SDL's thread. The constructor raises DriverError if SDL can't
    be used."""

    def __init__(self, params: GamepadParams) -> None:
        self._params = params
        self._latest: tuple[sdl.PadState | None] | None = None
        self._pressed = deque[str](maxlen=_MOST_PRESSES)
        self._reading: InputReading | None = None
        self._name = ""
        self._gone = False
        self._missing: dict[str, str] = {}
        sdl.listen(self._receive)

    def _receive(self, states: tuple[sdl.PadState, ...]) -> None:
        wanted = self._params.controller
        state = next((s for s in states if wanted.lower() in s.name.lower()), None)
        self._pressed.extend(() if state is None else state.held)
        self._latest = (state,)

    def read(self, now: Time) -> InputReading | None:
        latest, self._latest = self._latest, None
        if latest is None:
            return self._reading
        [state], held = latest, set[str]()
        while self._pressed:
            held.add(self._pressed.popleft())
        self._gone = state is None
        if state is not None:
            self._name = state.name
            p, name = self._params, state.name.lower()
            tables = {} if p.controllers is None else read_controllers(p.controllers)
            named = next((table for part, table in tables.items() if part.lower() in name), {})
            maps = {axis: named.get(axis) or Calibration(getattr(p, axis)) for axis in AXES}
            axes = {a: deflection(maps[a].read(state), p.dead_zone, p.expo) for a in AXES}
            sources = {axis: maps[axis].source.removeprefix("-") for axis in AXES}
            self._missing = {a: s for a, s in sources.items() if s not in state.axes and s != NONE}
            self._reading = InputReading(now, axes, frozenset(held))
        return self._reading

    def trouble(self) -> str | None:
        if not self._gone:
            missing = next(iter(self._missing.items()), None)
            if missing is None:
                return None
            axis, source = missing
            return f"`{self._name}` has no axis `{source}`: give `{axis}` another source, or `none`"
        if self._name:
            return f"`{self._name}` is unplugged"
        wanted = self._params.controller
        return f"no controller {f'like `{wanted}` ' if wanted else ''}is plugged in"

    def close(self) -> None:
        sdl.ignore(self._receive)
