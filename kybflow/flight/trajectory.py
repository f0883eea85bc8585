"""A trajectory from a file: rows with times, and the smooth curve through them.

The curve is continuous in position, velocity and acceleration, and passes exactly through all given
values. Missing values come from splines that are at rest at both ends: velocities from the
positions, accelerations from the velocities, heading rates from the headings. The heading turns the
shorter way from row to row.

The file is a table of text: comma-separated, with a header, one row per moment.

    t, x, y, z, vx, vy, vz, ax, ay, az, yaw [deg]
    0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0
    ...

The format is that of `kybflow.core.files`, with units in brackets, `x [cm]`; `yaw` must state
`[deg]` or `[rad]`. The columns t, x, y and z are required. Velocities, and accelerations, have all
three columns or none, and accelerations require velocities. The time may begin at any value and
must increase in every row. A file of polynomial pieces, as uav_trajectories writes for Crazyswarm,
is read as well (`kybflow.flight.polynomial_pieces`). Every error is a FileError that names the
line.

The curve consists of quintic pieces that join in position, velocity and acceleration (C2). Between
two knots, with h the time between them and s = t - t0, the piece is the only polynomial of degree
five with the position, slope and second derivative of both:

    p(s) = p0 + v0 s + a0/2 s^2 + c3 s^3 + c4 s^4 + c5 s^5
    D = p1 - p0 - v0 h - a0 h^2/2,   V = v1 - v0 - a0 h,   A = a1 - a0
    c3 = (10 D - 4 V h + A h^2/2) / h^3
    c4 = (-15 D + 7 V h - A h^2) / h^4,   c5 = (6 D - 3 V h + A h^2/2) / h^5

Unknown slopes come from the cubic spline through the values that is level at both ends:

    m[i-1]/h[i-1] + 2 (1/h[i-1] + 1/h[i]) m[i] + m[i+1]/h[i] = 3 (d[i-1]/h[i-1] + d[i]/h[i])

with d the mean slopes between knots (de Boor, "A Practical Guide to Splines", 1978, ch. IV).
"""

from __future__ import annotations

import functools
import re
from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from math import ceil, hypot, pi, sqrt
from typing import NamedTuple

from kybflow.core.errors import FileError
from kybflow.core.files import File, Table, header_line, need
from kybflow.core.files import read_table as read_columns
from kybflow.core.geometry import ZERO, Vec3, norm
from kybflow.core.units import (
    ACCELERATION,
    ANGLE,
    DURATION,
    LENGTH,
    SPEED,
    Dimension,
)
from kybflow.flight.motion import Motion

COLUMNS: dict[str, Dimension | None] = {
    "t": DURATION,
    **dict.fromkeys(("x", "y", "z"), LENGTH),
    **dict.fromkeys(("vx", "vy", "vz"), SPEED),
    **dict.fromkeys(("ax", "ay", "az"), ACCELERATION),
    "yaw": ANGLE,
}
MOST_ROWS = 20_000
_OF_PIECES = re.compile(r"\s*#?\s*duration\s*[,;\t]\s*x\^0", re.IGNORECASE)
"""The beginning of a file of polynomial pieces."""
_NEEDED = ("t", "x", "y", "z")
_LIKE = "t, x, y, z"


class TrajectoryPoint(NamedTuple):
    """One row of a trajectory file, in SI units, with its line number."""

    time: float
    position: Vec3
    velocity: Vec3 | None
    acceleration: Vec3 | None
    yaw: float | None
    line: int


def read_table(text: str) -> tuple[TrajectoryPoint, ...]:
    """Return the rows of `text`, at least two. Raises FileError."""
    if _OF_PIECES.match(text):
        from kybflow.flight.polynomial_pieces import read_pieces  # few files are of this kind

        return tuple(TrajectoryPoint(*row) for row in read_pieces(text, MOST_ROWS))
    table = read_columns(text, COLUMNS, "a trajectory", _LIKE)
    _check(table, header_line(text))
    rows: list[TrajectoryPoint] = []
    for number, values, _ in table.rows:
        rows.append(_row(number, values))
        if len(rows) > MOST_ROWS:
            raise FileError(f"more than {MOST_ROWS} rows", number)
        if len(rows) > 1 and rows[-1].time <= rows[-2].time:
            message = f"the time does not increase: {rows[-1].time:g} s after {rows[-2].time:g} s"
            raise FileError(message, number, "sort the rows by their time, each with another time")
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


class Knot(NamedTuple):
    """A value with its first two derivatives."""

    value: float
    slope: float
    bend: float


class Quintic(NamedTuple):
    """One quintic piece: its coefficients, from that of s^0 to that of s^5."""

    c0: float
    c1: float
    c2: float
    c3: float
    c4: float
    c5: float

    @classmethod
    def between(cls, start: Knot, end: Knot, h: float) -> Quintic:
        """Return the piece that goes from `start` to `end` in `h` seconds."""
        p, v, a = start
        square = h * h
        gap = end.value - p - v * h - 0.5 * a * square
        change = (end.slope - v - a * h) * h
        turn = (end.bend - a) * square
        c3 = (10.0 * gap - 4.0 * change + 0.5 * turn) / (square * h)
        c4 = (-15.0 * gap + 7.0 * change - turn) / (square * square)
        c5 = (6.0 * gap - 3.0 * change + 0.5 * turn) / (square * square * h)
        return cls(p, v, 0.5 * a, c3, c4, c5)

    def at(self, s: float) -> tuple[float, float, float, float]:
        """Return the value and its first three derivatives at `s`."""
        c0, c1, c2, c3, c4, c5 = self
        return (
            c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5)))),
            c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5))),
            2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5)),
            6.0 * c3 + s * (24.0 * c4 + s * 60.0 * c5),
        )


def slopes(
    times: Sequence[float], values: Sequence[float], first: float = 0.0, *, goes_on: bool = False
) -> list[float]:
    """Return the slope at each of at least two knots: `first` at the first, and at the last zero,
    or, if the curve goes on beyond it, the one with which the spline isn't bent there. The
    equations are solved by Thomas' algorithm."""
    steps = [b - a for a, b in pairwise(times)]
    pull = [(b - a) / (h * h) for a, b, h in zip(values, values[1:], steps, strict=False)]
    found = [0.0] * len(times)
    ahead = [0.0] * len(times)
    found[0] = first
    for i in range(1, len(times) - 1):
        left, right = 1.0 / steps[i - 1], 1.0 / steps[i]
        pivot = 2.0 * (left + right) - left * ahead[i - 1]
        ahead[i] = right / pivot
        found[i] = (3.0 * (pull[i - 1] + pull[i]) - left * found[i - 1]) / pivot
    if goes_on:
        found[-1] = (3.0 * pull[-1] * steps[-1] - found[-2]) / (2.0 - ahead[-2])
    for i in range(len(times) - 2, 0, -1):
        found[i] -= ahead[i] * found[i + 1]
    return found


def vector_slopes(
    times: Sequence[float], values: Sequence[Vec3], first: Vec3 = ZERO, *, goes_on: bool = False
) -> list[Vec3]:
    """Return the slopes at each knot, found as by `slopes` for each axis."""
    x, y, z = (
        slopes(times, [value[axis] for value in values], first[axis], goes_on=goes_on)
        for axis in range(3)
    )
    return list(zip(x, y, z, strict=True))


REST_SPEED = 0.05
"""Speed (m/s) below which a row counts as at rest."""
_SPEED_TOLERANCE, _SPEED_SHARE = 0.1, 0.2
_MIN_STEP_S, _MAX_STEP_S = 0.02, 0.5
_MOST_SAMPLES = 20_000
_CHORD_ERROR = 0.005
"""How far the path between two samples may be from the straight line, metres."""


class Figures(NamedTuple):
    """Extreme values of a curve. speed, acceleration: the largest speed, m/s, and horizontal
    acceleration, m/s^2. fastest, sharpest: the lines in the file where they occur. points:
    positions along the curve, each with its line."""

    speed: float
    fastest: int
    acceleration: float
    sharpest: int
    points: tuple[tuple[Vec3, int], ...]


class Trajectory:
    """The curve through the rows of a file. Time counts from its first row."""

    def __init__(self, rows: Sequence[TrajectoryPoint]) -> None:
        times = [row.time - rows[0].time for row in rows]
        self._times, self._lines = times, [row.line for row in rows]
        positions = [row.position for row in rows]
        given = [row.velocity for row in rows if row.velocity is not None]
        velocities = given or vector_slopes(times, positions)
        stated = [row.acceleration for row in rows if row.acceleration is not None]
        accelerations = stated or vector_slopes(times, velocities)
        self._axes = tuple(
            _pieces(
                times, *([v[axis] for v in of] for of in (positions, velocities, accelerations))
            )
            for axis in range(3)
        )
        headings = _unwrapped([row.yaw for row in rows if row.yaw is not None])
        turns = slopes(times, headings) if headings else []
        self._heading = _pieces(times, headings, turns, slopes(times, turns)) if turns else None
        self._last = Motion(positions[-1]), headings[-1] if headings else None
        self.duration = times[-1]
        self.start, self.end = self.at(0.0)[0].position, positions[-1]
        if given:
            _check_velocities(rows, accelerations)

    def at(self, time: float) -> tuple[Motion, float | None, float]:
        """Return (motion, heading, heading rate) `time` seconds after the first row. From the last
        row on, the vehicle is at rest there. The heading is None if the file has none."""
        if time >= self.duration:
            return *self._last, 0.0
        time = max(time, 0.0)
        piece = bisect_right(self._times, time) - 1
        s = time - self._times[piece]
        x, y, z = self._axes
        px, vx, ax, jx = x[piece].at(s)
        py, vy, ay, jy = y[piece].at(s)
        pz, vz, az, jz = z[piece].at(s)
        motion = Motion((px, py, pz), (vx, vy, vz), (ax, ay, az), (jx, jy, jz))
        if self._heading is None:
            return motion, None, 0.0
        heading, rate, *_ = self._heading[piece].at(s)
        return motion, heading, rate

    @functools.cached_property
    def figures(self) -> Figures:
        """The extreme values of the curve and the points along it."""
        speed, fastest, sharp, sharpest = 0.0, self._lines[0], 0.0, self._lines[0]
        samples: list[tuple[float, Vec3, int]] = []
        step = max(_MIN_STEP_S, self.duration / _MOST_SAMPLES)
        for piece, begin in enumerate(self._times[:-1]):
            h = self._times[piece + 1] - begin
            count = max(1, ceil(h / step))
            for i in range(count):
                time, line = begin + h * i / count, self._lines[piece + (2 * i > count)]
                motion, *_ = self.at(time)
                position, velocity, acceleration, _ = motion
                ax, ay, _ = acceleration
                samples.append((time, position, line))
                if norm(velocity) > speed:
                    speed, fastest = norm(velocity), line
                if hypot(ax, ay) > sharp:
                    sharp, sharpest = hypot(ax, ay), line
        samples.append((self.duration, self.end, self._lines[-1]))
        return Figures(speed, fastest, sharp, sharpest, _thinned(samples, sharp))


@functools.lru_cache(maxsize=32)
def read_trajectory(file: File) -> Trajectory:
    """Return the trajectory in `file`. Raises FileError, with the line, if no vehicle can fly
    it."""
    rows = read_table(file.text)
    for row, end in ((rows[0], "begins"), (rows[-1], "ends")):
        if row.velocity is not None and norm(row.velocity) > REST_SPEED:
            raise FileError(
                f"it {end} with {norm(row.velocity):.3g} m/s",
                row.line,
                "a trajectory begins and ends at rest",
            )
    return Trajectory(rows)


def _check_velocities(rows: Sequence[TrajectoryPoint], accelerations: Sequence[Vec3]) -> None:
    """Raise FileError if the velocities contradict the positions, because of a wrong column or
    unit. Between two rows the path is h (v0 + v1) / 2 - h^2 (a1 - a0) / 12, except for terms of the
    order h^5."""
    for i, (a, b) in enumerate(pairwise(rows)):
        h = b.time - a.time
        if a.velocity is None or b.velocity is None:
            continue
        for p, q, v, w, c, d in zip(
            a.position, b.position, a.velocity, b.velocity, accelerations[i],
            accelerations[i + 1], strict=True,
        ):  # fmt: skip
            moved, told = (q - p) / h, 0.5 * (v + w) - h * (d - c) / 12.0
            if abs(moved - told) > _SPEED_TOLERANCE + _SPEED_SHARE * abs(moved):
                message = (
                    f"from the row before it moves {moved:.3g} m/s, but its velocity is "
                    f"{told:.3g} m/s"
                )
                raise FileError(message, b.line, "check the columns and units of the velocities")


def _pieces(
    times: Sequence[float], values: Sequence[float], first: Sequence[float], second: Sequence[float]
) -> tuple[Quintic, ...]:
    knots = [Knot(*knot) for knot in zip(values, first, second, strict=True)]
    pairs = zip(knots, knots[1:], times, times[1:], strict=False)
    return tuple(Quintic.between(a, b, end - start) for a, b, start, end in pairs)


def _unwrapped(angles: Sequence[float]) -> list[float]:
    """Return the angles without jumps of whole turns."""
    found: list[float] = []
    for angle in angles:
        turn = 2.0 * pi
        found.append(angle - turn * round((angle - found[-1]) / turn) if found else angle)
    return found


def _thinned(
    samples: Sequence[tuple[float, Vec3, int]], sharpest: float
) -> tuple[tuple[Vec3, int], ...]:
    """Return the few samples whose polyline stays near the curve: it is off by at most a h^2 /
    8."""
    h = sqrt(8.0 * _CHORD_ERROR / sharpest) if sharpest > 0.0 else _MAX_STEP_S
    h = min(max(h, _MIN_STEP_S), _MAX_STEP_S)
    kept = [samples[0]]
    for sample, after in pairwise(samples[1:]):
        if after[0] - kept[-1][0] > h:
            kept.append(sample)
    return tuple((position, line) for _, position, line in (*kept, samples[-1]))
