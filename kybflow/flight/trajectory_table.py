"""A trajectory as a table of text: comma-separated, a header, a row a moment.

    t, x, y, z, vx, vy, vz, ax, ay, az, yaw [deg]
    0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0
    ...

The form is that of `kybflow.core.tables`: units in brackets, `x [cm]`; `yaw` must say `[deg]` or
`[rad]`. Needed are t, x, y, z; velocities and accelerations come as all three columns or none, and
accelerations only with velocities. The time may begin anywhere and increases in every row.
Everything raises FileError, which names the line.
"""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.errors import FileError
from kybflow.core.geometry import Vec3
from kybflow.core.tables import Table, header_line, need
from kybflow.core.tables import read_table as read_columns
from kybflow.core.units import (
    ACCELERATION,
    ANGLE,
    DURATION,
    LENGTH,
    SPEED,
    Dimension,
)

COLUMNS: dict[str, Dimension | None] = {
    "t": DURATION,
    **dict.fromkeys(("x", "y", "z"), LENGTH),
    **dict.fromkeys(("vx", "vy", "vz"), SPEED),
    **dict.fromkeys(("ax", "ay", "az"), ACCELERATION),
    "yaw": ANGLE,
}
MOST_ROWS = 20_000
_NEEDED = ("t", "x", "y", "z")
_LIKE = "t, x, y, z"


class TrajectoryPoint(NamedTuple):
    """One moment, SI, and the line where it stands."""

    time: float
    position: Vec3
    velocity: Vec3 | None
    acceleration: Vec3 | None
    yaw: float | None
    line: int


def read_table(text: str) -> tuple[TrajectoryPoint, ...]:
    """The rows of `text`, at least two."""
    table = read_columns(text, COLUMNS, "a trajectory", _LIKE)
    _check(table, header_line(text))
    rows: list[TrajectoryPoint] = []
    for number, values, _ in table.rows:
        rows.append(_row(number, values))
        if len(rows) > MOST_ROWS:
            raise FileError(f"more than {MOST_ROWS} rows", number)
        if len(rows) > 1 and rows[-1].time <= rows[-2].time:
            message = f"the time does not increase: {rows[-1].time:g} s after {rows[-2].time:g} s"
            raise FileError(message, number)
    if len(rows) < 2:
        raise FileError("a trajectory has at least two rows")
    return tuple(rows)


def _check(table: Table, line: int) -> None:
    need(table, _NEEDED, line)
    for wanted in (("vx", "vy", "vz"), ("ax", "ay", "az")):
        if any(name in table.columns for name in wanted):
            need(table, wanted, line)
    if "ax" in table.columns and "vx" not in table.columns:
        raise FileError("accelerations need the velocities `vx`, `vy`, `vz` beside them", line)


def _row(number: int, values: dict[str, float]) -> TrajectoryPoint:
    def vector(x: str, y: str, z: str) -> Vec3 | None:
        return (values[x], values[y], values[z]) if x in values else None

    velocity, acceleration = vector("vx", "vy", "vz"), vector("ax", "ay", "az")
    position = (values["x"], values["y"], values["z"])
    return TrajectoryPoint(values["t"], position, velocity, acceleration, values.get("yaw"), number)
