"""A trajectory of polynomial pieces, as uav_trajectories writes it and Crazyswarm reads it.

    duration,x^0,x^1,x^2,...,x^7,y^0,...,y^7,z^0,...,z^7,yaw^0,...,yaw^7
    1.05,0.0,0.0,...
    ...

Each row is a piece: its duration T, and the coefficients of x, y, z and yaw by their powers of the
time since its beginning,

    p(s) = p^0 + p^1 s + p^2 s^2 + ...,   0 <= s <= T

in seconds, metres and radians. Crazyswarm may fly a file from where the vehicle is; here the
coordinates are those of the world. `#` may precede the first line. Errors are FileErrors, which
name the line.

Source: https://github.com/whoenig/uav_trajectories, scripts/uav_trajectory.py
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from math import ceil

from kybflow.core.errors import FileError
from kybflow.core.files import cells_of, number_in
from kybflow.core.geometry import Vec3, distance

_AXES = ("x", "y", "z", "yaw")
_STEP_S = 0.1
"""Largest time between two rows; a quintic through them is off by less than 0.1 mm."""
_GAP, _SPEED_GAP = 0.01, 0.05
"""Largest step in position (m) and velocity (m/s) between two pieces; their coefficients are
rounded."""
_LONGEST_PIECE_S = 3600.0

Row = tuple[float, Vec3, Vec3, Vec3, float | None, int]
"""Time, position, velocity, acceleration, yaw and line."""


def read_pieces(text: str, most: int) -> Iterator[Row]:
    """Yield the points of the pieces, at most 0.1 s apart. most: the largest number of points.
    Raises FileError."""
    lines = cells_of(re.sub(r"\A(\s*)#", r"\1", text))
    number, header = next(lines)
    names = [name.lower() for name in header]
    powers = {axis: _places(axis, names, number) for axis in _AXES}
    begin, count, before = 0.0, 0, None
    for number, cells in lines:
        if len(cells) != len(names):
            raise FileError(f"{len(cells)} values in a table of {len(names)} columns", number)
        values = [number_in(cell, number) for cell in cells]
        duration = values[names.index("duration")]
        if not 0.0 < duration <= _LONGEST_PIECE_S:
            message = f"a piece lasts above 0 s and at most {_LONGEST_PIECE_S:g} s"
            raise FileError(message, number)
        piece = [[values[place] for place in powers[axis]] for axis in _AXES]
        steps = ceil(duration / _STEP_S)
        count += steps
        if count >= most:
            raise FileError(f"more than {most} points, {_STEP_S:g} s apart", number)
        first = _row(piece, 0.0, begin, number)
        if before is not None and (
            distance(first[1], before[1]) > _GAP or distance(first[2], before[2]) > _SPEED_GAP
        ):
            hint = "each begins with the position and velocity of the last end: check their order"
            raise FileError("this piece does not begin where the one before ends", number, hint)
        yield first
        for i in range(1, steps):
            yield _row(piece, duration * i / steps, begin, number)
        before = _row(piece, duration, begin, number)
        begin += duration
    if before is None:
        raise FileError("it has no pieces")
    yield before


def _places(axis: str, names: Sequence[str], line: int) -> list[int]:
    """Return the columns of an axis's coefficients, in the order of their powers."""
    places: list[int] = []
    while (name := f"{axis}^{len(places)}") in names:
        places.append(names.index(name))
    if not places and axis != "yaw":
        raise FileError(f"the column `{axis}^0` is missing", line)
    return places


def _row(piece: Sequence[Sequence[float]], s: float, begin: float, line: int) -> Row:
    *axes, yaw = piece
    x, y, z = (_derivatives(axis, s) for axis in axes)
    position, velocity, acceleration = zip(x, y, z, strict=True)
    turned = _derivatives(yaw, s)[0] if yaw else None
    return begin + s, position, velocity, acceleration, turned, line


def _derivatives(coefficients: Sequence[float], s: float) -> tuple[float, float, float]:
    """Return the value of a polynomial and its first two derivatives, by Horner's rule."""
    value = slope = bend = 0.0
    for coefficient in reversed(coefficients):
        bend = bend * s + 2.0 * slope
        slope = slope * s + value
        value = value * s + coefficient
    return value, slope, bend
