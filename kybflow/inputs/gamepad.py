"""Steer with a gamepad or a joystick, whatever SDL knows of.

The sticks are as on a drone's transmitter of mode 2: the left one climbs and turns, the right one
goes forward and sideways. Another map names for each axis where it comes from, with a minus where
it is to be turned round: `x: -right_y`. Sources and buttons have the names of an Xbox controller
(`left_x`, `left_y`, `right_x`, `right_y`, `left_trigger`, `right_trigger`; `a`, `b`, `x`, `y`,
`back`, `guide`, `start`, `left_stick`, `right_stick`, `left_shoulder`, `right_shoulder`, `dpad_up`,
`dpad_down`, `dpad_left`, `dpad_right`), wherever SDL knows the controller; a joystick that it
doesn't know has `axis0`, `button0`, `hat_up` and so on.

A deflection v counts from the edge of its dead zone d on, and softly around it by the expo e:

    s = (|v| - d) / (1 - d),    (1 - e) s + e s^3,    with the sign of v.

`controllers` names a table of maps by controller, with calibration; `low`, `centre` and `high` are
what the source says at its ends and at rest:

    controller, axis, source, low, centre, high
    Taranis, x, axis2, -0.92, 0.03, 0.95
    ...

The first controller is used whose name contains `controller`. It may be plugged in and out at any
time: while there is none, the input is lost. Needs `pip install 'kybflow[inputs]'`.
"""

from __future__ import annotations

from collections import deque
from functools import cache
from typing import NamedTuple

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.core.signals import InputReading, Time
from kybflow.core.tables import header_line, need, read_table
from kybflow.core.text import did_you_mean
from kybflow.core.units import NUMBER, Number, Ratio
from kybflow.inputs import sdl
from kybflow.inputs.deflection import beyond
from kybflow.parts import AXES, Input, InputLink, param, params
from kybflow.parts.base import Objection
from kybflow.parts.input import SticksOf

_RAW = tuple(f"axis{i}" for i in range(sdl.NUMBERED))
SOURCES = (*sdl.PAD_AXES, *_RAW)
BUTTONS = (
    *sdl.PAD_BUTTONS, "hat_left", "hat_right", "hat_down", "hat_up",
    *(f"button{i}" for i in range(sdl.NUMBERED)),
)  # fmt: skip
_COLUMNS = {
    "controller": None, "axis": None, "source": None,
    **dict.fromkeys(("low", "centre", "high"), NUMBER),
}  # fmt: skip
_KEPT = 256
"""How many looks at held buttons are kept for whoever reads late."""
_LIKE = "controller, axis, source, low, centre, high"


class Calibration(NamedTuple):
    """Where an axis comes from, and what that says at its ends and at rest."""

    source: str
    low: float = -1.0
    centre: float = 0.0
    high: float = 1.0

    def scaled(self, raw: float) -> float:
        """Return a raw value as one from -1 to 1."""
        span = self.high - self.centre if raw > self.centre else self.centre - self.low
        return max(-1.0, min(1.0, (raw - self.centre) / span))


@cache
def read_controllers(file: File) -> dict[str, dict[str, Calibration]]:
    """Return the axes of each controller in a table. Raises FileError."""
    table = read_table(file.text, _COLUMNS, "axes", _LIKE)
    need(table, ("controller", "axis", "source"), header_line(file.text))
    found: dict[str, dict[str, Calibration]] = {}
    for number, values, words in table.rows:
        axis, source = words["axis"], words["source"]
        if axis not in AXES:
            raise FileError(f"there is no axis `{axis[:20]}`", number, did_you_mean(axis, AXES))
        if source.removeprefix("-") not in SOURCES:
            hint = did_you_mean(source, SOURCES)
            raise FileError(f"`{source[:20]}` is no source of an axis", number, hint)
        ends = (values.get("low", -1.0), values.get("centre", 0.0), values.get("high", 1.0))
        if not ends[0] < ends[1] < ends[2]:
            raise FileError("`low`, `centre` and `high` must rise", number)
        found.setdefault(words["controller"], {})[axis] = Calibration(source, *ends)
    return found


@params
class GamepadParams:
    controller: str = param("Part of the controller's name; any without it.", default="")
    x: str = param("Where forward comes from.", default="-right_y")
    y: str = param("Where left comes from.", default="-right_x")
    z: str = param("Where up comes from.", default="-left_y")
    turn: str = param("Where turning counter-clockwise comes from.", default="-left_x")
    dead_zone: Ratio = param(
        "Deflection that counts as none.", default=0.08, at_least=0.0, at_most=0.5
    )
    expo: Number = param(
        "How soft it is around the centre.", default=0.3, at_least=0.0, at_most=1.0
    )
    controllers: File | None = param(
        "A table of maps and calibrations by controller.", default=None, reads=read_controllers
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
        return None

    @classmethod
    def open(cls, params: GamepadParams, sticks_of: SticksOf) -> InputLink:
        return PadLink(params)


class PadLink(InputLink):
    """Gives what one controller says, as SDL's thread hands it over. Raises DriverError."""

    def __init__(self, params: GamepadParams) -> None:
        self._params = params
        self._latest: tuple[sdl.PadState | None] | None = None
        self._pressed = deque[str](maxlen=_KEPT)
        self._reading: InputReading | None = None
        self._name = ""
        self._gone = False
        sdl.listen(self._hear)

    def _hear(self, states: tuple[sdl.PadState, ...]) -> None:
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
            self._reading = InputReading(now, self._axes(state), frozenset(held))
        return self._reading

    def _axes(self, state: sdl.PadState) -> dict[str, float]:
        own = self._map(state.name)
        zone, expo = self._params.dead_zone, self._params.expo
        return {axis: beyond(_value(state, own[axis]), zone, expo) for axis in AXES}

    def _map(self, name: str) -> dict[str, Calibration]:
        p = self._params
        usual = {axis: Calibration(getattr(p, axis)) for axis in AXES}
        tables = {} if p.controllers is None else read_controllers(p.controllers)
        named = (table for part, table in tables.items() if part.lower() in name.lower())
        return {**usual, **next(named, {})}

    def trouble(self) -> str | None:
        if self._gone:
            return f"`{self._name}` is unplugged" if self._name else self._nothing()
        return None

    def _nothing(self) -> str:
        wanted = self._params.controller
        which = f"no controller like `{wanted}`" if wanted else "no controller"
        return f"{which} is plugged in"

    def close(self) -> None:
        sdl.ignore(self._hear)


def _value(state: sdl.PadState, own: Calibration) -> float:
    """The value of an axis, zero where the device doesn't have it."""
    value = own.scaled(state.axes.get(own.source.removeprefix("-"), own.centre))
    return -value if own.source.startswith("-") else value
