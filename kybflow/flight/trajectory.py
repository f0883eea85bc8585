"""A trajectory from a file: rows in time, and the smooth curve through them.

Rows are `kybflow.flight.trajectory_table`'s, the curve `kybflow.flight.hermite`'s: position,
velocity and acceleration have no step, and go exactly through what the rows say. What they leave
out comes from splines: velocities from the positions, accelerations from the velocities, headings'
rates from the headings, at rest at both ends. Headings turn the shorter way from row to row.
"""

from __future__ import annotations

import functools
from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from math import ceil, hypot, pi, sqrt
from typing import NamedTuple

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.core.geometry import Vec3, norm
from kybflow.flight.hermite import Knot, Quintic, slopes, vector_slopes
from kybflow.flight.motion import Motion
from kybflow.flight.trajectory_table import TrajectoryPoint, read_table

REST = 0.05
"""Speed (m/s) below which a row counts as at rest."""
_AGREE, _AGREE_SHARE = 0.1, 0.2
_FINEST, _COARSEST = 0.02, 0.5
_MOST_SAMPLES = 20_000
_STRAIGHT = 0.005
"""How far a path between two samples may be from the straight line, metres."""


class Figures(NamedTuple):
    """Extremes of a curve, each with the line where they are: speed and horizontal acceleration;
    `points` along it, with their lines."""

    speed: float
    fastest: int
    acceleration: float
    sharpest: int
    points: tuple[tuple[Vec3, int], ...]


class Trajectory:
    """The curve through the rows of one file; time counts from its first row."""

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
        if given:
            _check_velocities(rows, accelerations)

    @property
    def start(self) -> Vec3:
        return self.at(0.0)[0].position

    @property
    def end(self) -> Vec3:
        return self._last[0].position

    def at(self, time: float) -> tuple[Motion, float | None, float]:
        """(motion, heading, heading rate) `time` seconds after the first row; at rest at the last
        from there on. The heading is None where the file has none."""
        if time >= self.duration:
            return *self._last, 0.0
        time = max(time, 0.0)
        piece = bisect_right(self._times, time) - 1
        s = time - self._times[piece]
        x, y, z = (axis[piece].at(s) for axis in self._axes)
        motion = Motion(*zip(x, y, z, strict=True))
        if self._heading is None:
            return motion, None, 0.0
        heading, rate, *_ = self._heading[piece].at(s)
        return motion, heading, rate

    @functools.cached_property
    def figures(self) -> Figures:
        """How fast and how sharp it is, and where it goes."""
        speed, fastest, sharp, sharpest = 0.0, self._lines[0], 0.0, self._lines[0]
        samples: list[tuple[float, Vec3, int]] = []
        step = max(_FINEST, self.duration / _MOST_SAMPLES)
        for piece, begin in enumerate(self._times[:-1]):
            h = self._times[piece + 1] - begin
            count = max(1, ceil(h / step))
            for i in range(count):
                time, line = begin + h * i / count, self._lines[piece + (2 * i > count)]
                (position, velocity, (ax, ay, _), _), *_ = self.at(time)
                samples.append((time, position, line))
                if norm(velocity) > speed:
                    speed, fastest = norm(velocity), line
                if hypot(ax, ay) > sharp:
                    sharp, sharpest = hypot(ax, ay), line
        samples.append((self.duration, self.end, self._lines[-1]))
        return Figures(speed, fastest, sharp, sharpest, _thinned(samples, sharp))


@functools.lru_cache(maxsize=32)
def read_trajectory(file: File) -> Trajectory:
    """The trajectory in `file`. Raises FileError, with the line, for one that can't be flown by
    anything."""
    rows = read_table(file.text)
    for row, end in ((rows[0], "begins"), (rows[-1], "ends")):
        if row.velocity is not None and norm(row.velocity) > REST:
            raise FileError(
                f"it {end} with {norm(row.velocity):.3g} m/s",
                row.line,
                "a trajectory begins and ends at rest",
            )
    return Trajectory(rows)


def _check_velocities(rows: Sequence[TrajectoryPoint], accelerations: Sequence[Vec3]) -> None:
    """Velocities that are not those of the positions: a wrong column or unit. Between two rows the
    way is h (v0 + v1) / 2 - h^2 (a1 - a0) / 12, but for terms of the order h^5."""
    for i, (a, b) in enumerate(pairwise(rows)):
        h = b.time - a.time
        if a.velocity is None or b.velocity is None:
            continue
        for p, q, v, w, c, d in zip(
            a.position, b.position, a.velocity, b.velocity, accelerations[i],
            accelerations[i + 1], strict=True,
        ):  # fmt: skip
            moved, told = (q - p) / h, 0.5 * (v + w) - h * (d - c) / 12.0
            if abs(moved - told) > _AGREE + _AGREE_SHARE * abs(moved):
                message = f"from the row before it moves {moved:.3g} m/s, but says {told:.3g} m/s"
                raise FileError(message, b.line, "check the columns and units of the velocities")


def _pieces(
    times: Sequence[float], values: Sequence[float], first: Sequence[float], second: Sequence[float]
) -> tuple[Quintic, ...]:
    knots = [Knot(*knot) for knot in zip(values, first, second, strict=True)]
    pairs = zip(knots, knots[1:], times, times[1:], strict=False)
    return tuple(Quintic.between(a, b, end - start) for a, b, start, end in pairs)


def _unwrapped(angles: Sequence[float]) -> list[float]:
    """The same angles without jumps of whole turns."""
    found: list[float] = []
    for angle in angles:
        turn = 2.0 * pi
        found.append(angle - turn * round((angle - found[-1]) / turn) if found else angle)
    return found


def _thinned(
    samples: Sequence[tuple[float, Vec3, int]], sharpest: float
) -> tuple[tuple[Vec3, int], ...]:
    """As few of the samples as a polyline needs to stay near the curve: it is off by at most
    a h^2 / 8."""
    h = sqrt(8.0 * _STRAIGHT / sharpest) if sharpest > 0.0 else _COARSEST
    h = min(max(h, _FINEST), _COARSEST)
    kept = [samples[0]]
    for sample, after in pairwise(samples[1:]):
        if after[0] - kept[-1][0] > h:
            kept.append(sample)
    return tuple((position, line) for _, position, line in (*kept, samples[-1]))
