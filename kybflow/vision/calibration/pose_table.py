"""Tables of a body's poses in text form (`kybflow.core.files`), with one row per pose in order of
time:

    time, x, y, z, qw, qx, qy, qz
    0.00, 1.0, 2.0, 1.1, 1, 0, 0, 0
    ...

The quaternion turns from the body to the world. Columns `roll`, `pitch` and `heading`, each with
its unit, may replace it. Errors in a table raise FileError, which names the line.
"""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.errors import FileError
from kybflow.core.files import header_line, need, read_table
from kybflow.core.geometry import Quat, Vec3, from_euler
from kybflow.core.units import ANGLE, DURATION, LENGTH, NUMBER, Dimension

_QUATERNION = ("qw", "qx", "qy", "qz")
_ANGLES = ("roll", "pitch", "heading")
_COLUMNS: dict[str, Dimension | None] = {
    "time": DURATION,
    **dict.fromkeys(("x", "y", "z"), LENGTH),
    **dict.fromkeys(_QUATERNION, NUMBER),
    **dict.fromkeys(_ANGLES, ANGLE),
}
_LIKE = "time, x, y, z, qw, qx, qy, qz"
_UNIT = 0.01
"""Largest deviation of a quaternion's squared norm from 1."""


class TimedPose(NamedTuple):
    """The pose of a body at a time. time: seconds. attitude: body to world."""

    time: float
    position: Vec3
    attitude: Quat


def read_poses(text: str) -> tuple[TimedPose, ...]:
    """Return the poses of a table: at least two, at increasing times. Raises FileError."""
    table = read_table(text, _COLUMNS, "poses", _LIKE)
    turns = _ANGLES if any(name in table.columns for name in _ANGLES) else _QUATERNION
    need(table, ("time", "x", "y", "z", *turns), header_line(text))
    found: list[TimedPose] = []
    for line, numbers, _ in table.rows:
        time, position = numbers["time"], (numbers["x"], numbers["y"], numbers["z"])
        if found and time <= found[-1].time:
            raise FileError("the times don't grow", line)
        attitude = _attitude(line, [numbers[name] for name in turns])
        found.append(TimedPose(time, position, attitude))
    if len(found) < 2:
        raise FileError(f"it has {len(found)} poses; two are the least")
    return tuple(found)


def _attitude(line: int, numbers: list[float]) -> Quat:
    if len(numbers) == len(_ANGLES):
        roll, pitch, heading = numbers
        return from_euler(roll, pitch, heading)
    w, x, y, z = numbers
    square = w * w + x * x + y * y + z * z
    if abs(square - 1.0) > _UNIT:
        raise FileError(f"the quaternion's length is {square**0.5:.2f}, not 1", line)
    scale = square**-0.5
    return w * scale, x * scale, y * scale, z * scale
