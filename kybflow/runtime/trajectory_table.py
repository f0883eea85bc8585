"""A trajectory as a table of text: comma-separated, a header, a row a moment.

    t, x, y, z, vx, vy, vz, ax, ay, az, yaw [deg]
    0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0
    ...

The header names the columns in any order, each with its unit in brackets, `x [cm]`; without one it
is SI, but for `yaw`, which must say `[deg]` or `[rad]`. Needed are t, x, y, z; velocities and
accelerations come as all three columns or none, and accelerations only with velocities. Empty lines
and those that begin with `#` are passed over. The time may begin anywhere and increases in every
row. Everything raises FileError, which names the line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import isfinite
from typing import NamedTuple

from kybflow.errors import FileError
from kybflow.geometry import Vec3
from kybflow.units import (
    ACCELERATION,
    ANGLE,
    DURATION,
    LENGTH,
    SPEED,
    Dimension,
)

COLUMNS: dict[str, Dimension] = {
    "t": DURATION,
    **dict.fromkeys(("x", "y", "z"), LENGTH),
    **dict.fromkeys(("vx", "vy", "vz"), SPEED),
    **dict.fromkeys(("ax", "ay", "az"), ACCELERATION),
    "yaw": ANGLE,
}
MOST_ROWS = 20_000
_NEEDED = ("t", "x", "y", "z")
_HEADER = re.compile(r"([A-Za-z]\w*)\s*(?:\[([^\]]*)\])?\Z")


class Row(NamedTuple):
    """One moment, SI, and the line where it stands."""

    time: float
    position: Vec3
    velocity: Vec3 | None
    acceleration: Vec3 | None
    yaw: float | None
    line: int


def read_table(text: str) -> tuple[Row, ...]:
    """The rows of `text`, at least two."""
    lines = _lines(text)
    first = next(lines, None)
    if first is None:
        raise FileError("it has no header", hint="begin with a line like `t, x, y, z`")
    factors = _header(*first)
    rows: list[Row] = []
    for number, line in lines:
        rows.append(_row(number, line, factors))
        if len(rows) > MOST_ROWS:
            raise FileError(f"more than {MOST_ROWS} rows", number)
        if len(rows) > 1 and rows[-1].time <= rows[-2].time:
            message = f"the time does not increase: {rows[-1].time:g} s after {rows[-2].time:g} s"
            raise FileError(message, number)
    if len(rows) < 2:
        raise FileError("a trajectory has at least two rows")
    return tuple(rows)


def _lines(text: str) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, line


def _header(number: int, line: str) -> dict[str, float]:
    """Each column with the factor to SI, in order."""
    factors: dict[str, float] = {}
    for cell in line.split(","):
        name, factor = _column(number, cell.strip())
        if name in factors:
            raise FileError(f"the column `{name}` is there twice", number)
        factors[name] = factor
    for wanted in (_NEEDED, ("vx", "vy", "vz"), ("ax", "ay", "az")):
        missing = [name for name in wanted if name not in factors]
        if missing and (wanted is _NEEDED or len(missing) < 3):
            raise FileError(f"the column `{missing[0]}` is missing", number)
    if "ax" in factors and "vx" not in factors:
        raise FileError("accelerations need the velocities `vx`, `vy`, `vz` beside them", number)
    return factors


def _column(number: int, cell: str) -> tuple[str, float]:
    match = _HEADER.match(cell)
    dimension = COLUMNS.get(match[1]) if match else None
    if match is None or dimension is None:
        known = ", ".join(f"`{name}`" for name in COLUMNS)
        raise FileError(
            f"`{cell}` is no column of a trajectory", number, f"the columns are {known}"
        )
    name, unit = match[1], match[2]
    if unit is None and dimension.bare_allowed:
        return name, 1.0
    units = " or ".join(f"`{name} [{known}]`" for known in dimension.units)
    if unit is None:
        raise FileError(f"`{name}` needs a unit", number, f"write {units}")
    if unit.strip() not in dimension.units:
        raise FileError(f"`{unit}` is no unit of {dimension.name}", number, f"write {units}")
    return name, dimension.units[unit.strip()]


def _row(number: int, line: str, factors: dict[str, float]) -> Row:
    cells = line.split(",")
    if len(cells) != len(factors):
        message = f"{len(cells)} values in a table of {len(factors)} columns"
        raise FileError(message, number)
    values = {
        name: factor * _number(number, cell.strip())
        for (name, factor), cell in zip(factors.items(), cells, strict=True)
    }

    def vector(x: str, y: str, z: str) -> Vec3 | None:
        return (values[x], values[y], values[z]) if x in values else None

    velocity, acceleration = vector("vx", "vy", "vz"), vector("ax", "ay", "az")
    position = (values["x"], values["y"], values["z"])
    return Row(values["t"], position, velocity, acceleration, values.get("yaw"), number)


def _number(line: int, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        raise FileError(f"`{cell[:20]}` is no number", line) from None
    if not isfinite(value):
        raise FileError(f"`{cell}` is not finite", line)
    return value
