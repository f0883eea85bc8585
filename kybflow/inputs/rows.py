"""The table of an input's readings, with a row for each change:

    t, x, y, z, turn, buttons, lost
    0, 0, 0, 0, 0, ,
    2.5, 0.4, 0, 0, 0, dead_man,
    9, 0, 0, 0, 0, dead_man land,
    12, , , , , , unplugged

`t` is the run's time in seconds, which must rise from 0 on. An axis is -1 to 1, or `nan`. `buttons`
are the names of held buttons. `lost` is the reason why the input is silent from that time on; such
a row has empty axes. The columns `buttons` and `lost` are optional. A row holds until the next one,
the last row until the end. Tables written by `kybflow record-input` and by runs end with a `lost`
row.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import isfinite
from typing import NamedTuple

from kybflow.core.errors import FileError, UnitError
from kybflow.core.files import cells_of
from kybflow.core.names import NAME
from kybflow.core.signals import NS, Time
from kybflow.core.units import parse_number

TIME, BUTTONS, LOST = "t", "buttons", "lost"
_LIKE = "t, x, y, z, turn, buttons"
_NAME = re.compile(NAME)


class InputRow(NamedTuple):
    """The reading of an input from `time` on. lost: why the input is silent; empty if it is not."""

    time: Time
    axes: Mapping[str, float]
    held: frozenset[str] = frozenset()
    lost: str = ""


class InputRows(NamedTuple):
    """The rows of a table in the order of their times, and the names of its axes."""

    axes: tuple[str, ...]
    rows: tuple[InputRow, ...]

    @property
    def buttons(self) -> tuple[str, ...]:
        """The buttons that are held in any row, sorted by name."""
        return tuple(sorted({name for row in self.rows for name in row.held}))


def head(axes: tuple[str, ...]) -> str:
    """Return the first line of a table."""
    return ", ".join((TIME, *axes, BUTTONS, LOST)) + "\n"


def line(row: InputRow, axes: tuple[str, ...]) -> str:
    """Return a row as a line, from which `parse` reads an equal row."""
    values = ("" if row.lost else f"{row.axes[axis]!r}" for axis in axes)
    why = " ".join(row.lost.replace(",", ";").split())
    return ", ".join((f"{row.time / NS!r}", *values, " ".join(sorted(row.held)), why)) + "\n"


def parse(text: str) -> InputRows:
    """Return the rows of a table. Raises FileError, which names the line."""
    filled = ((number, cells) for number, cells in cells_of(text) if any(cells))
    number, columns = next(filled, (1, []))
    axes = _axes(columns, number)
    rows: list[InputRow] = []
    for number, cells in filled:
        row = _row(dict(zip(columns, cells, strict=False)), axes, number)
        if len(cells) > len(columns):
            raise FileError(f"{len(cells)} cells under {len(columns)} columns", number)
        if row.time < 0 or (rows and row.time <= rows[-1].time):
            raise FileError("`t` must rise from 0 on", number)
        rows.append(row)
    if not rows:
        raise FileError("it has no rows")
    return InputRows(axes, tuple(rows))


def _axes(columns: list[str], number: int) -> tuple[str, ...]:
    if columns[:1] != [TIME]:
        raise FileError("the first column must be `t`", number, f"begin with `{_LIKE}`")
    for name in columns:
        if not _NAME.fullmatch(name) or columns.count(name) > 1:
            why = "occurs twice" if columns.count(name) > 1 else "is not a name"
            raise FileError(f"the column `{name[:40]}` {why}", number)
    return tuple(name for name in columns[1:] if name not in (BUTTONS, LOST))


def _row(cells: Mapping[str, str], axes: tuple[str, ...], number: int) -> InputRow:
    seconds = _number(cells.get(TIME, ""), TIME, number)
    if not isfinite(seconds):
        raise FileError("`t` must be a number of seconds", number)
    time, lost = round(seconds * NS), cells.get(LOST, "")
    if lost:
        return InputRow(time, {}, frozenset(), lost)
    values = {axis: _number(cells.get(axis, ""), axis, number) for axis in axes}
    for axis, value in values.items():
        if abs(value) > 1.0:
            hint = "1 is the full deflection: divide the device's values by their largest"
            raise FileError(f"`{axis}` must be from -1 to 1", number, hint)
    held = cells.get(BUTTONS, "").split()
    for name in held:
        if not _NAME.fullmatch(name):
            raise FileError(f"`{name[:40]}` can't name a button", number)
    return InputRow(time, values, frozenset(held))


def _number(cell: str, column: str, number: int) -> float:
    try:
        return parse_number(cell)
    except UnitError as error:
        message = f"`{column}` must be a number, not `{cell[:40]}`"
        raise FileError(message, number, error.hint) from None
