"""The poses of a body from motion capture at the times of frames.

The poses come from a table (`kybflow.core.files`), with one row per pose in order of time:

    time, x, y, z, qw, qx, qy, qz
    0.00, 1.0, 2.0, 1.1, 1, 0, 0, 0
    ...

The quaternion turns from the body to the world. Columns `roll`, `pitch` and `heading`, each with
its unit, may replace it. Errors in a table raise FileError, which names the line.

The clock of the poses differs from that of the frames. A grid search finds the offset with the
smallest median distance between the positions from tags and the track; the bundle adjustment then
refines it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy
from numpy.typing import NDArray

from kybflow.core.errors import FileError
from kybflow.core.files import header_line, need, read_table
from kybflow.core.geometry import Quat, Vec3, from_euler
from kybflow.core.units import ANGLE, DURATION, LENGTH, NUMBER, Dimension
from kybflow.vision.calibration.model import KnownPoses, rotation_vector

Array = NDArray[Any]

_GRID = 0.05
_GAP = 0.1
"""Largest gap between two poses to interpolate, seconds."""
_STEP_S = 0.01
"""Half the interval of the finite differences that give velocities, seconds."""
_SHARE = 0.5
"""Smallest share of the frames that the track must cover."""


class RecordedTrack(NamedTuple):
    """Poses ordered by time. time: (n,), seconds. position: (n, 3), metres. attitude: (n, 4),
    quaternions from body to world, w first."""

    time: Array
    position: Array
    attitude: Array


def reference_at(track: RecordedTrack, times: Array, offset: float) -> KnownPoses:
    """Return the track's poses at those of `times` that it covers. offset: the track's clock minus
    the frames' clock, seconds."""
    from scipy.spatial.transform import Rotation, Slerp

    at = times + offset
    after = numpy.searchsorted(track.time, at)
    inside = numpy.flatnonzero((at > track.time[0] + _STEP_S) & (at < track.time[-1] - _STEP_S))
    inside = inside[numpy.diff(track.time)[after[inside] - 1] < _GAP]
    turning = Slerp(track.time, Rotation.from_quat(numpy.roll(track.attitude, -1, axis=1)))
    before, now, then = (at[inside] + shift for shift in (-_STEP_S, 0.0, _STEP_S))
    body = turning(now).as_matrix()
    turned = numpy.swapaxes(turning(before).as_matrix(), 1, 2) @ turning(then).as_matrix()
    moved = _positions(track, then) - _positions(track, before)
    over = 2.0 * _STEP_S
    rates = rotation_vector(turned) / over
    return KnownPoses(inside, _positions(track, now), body, moved / over, rates)


def rough_offset(track: RecordedTrack, times: Array, positions: Array) -> float | None:
    """Return the track's clock minus the frames' clock, seconds, to the nearest step of the grid;
    None if they don't overlap. positions: (n, 3), positions of the body from tags."""
    first, last = track.time[0] - times[-1], track.time[-1] - times[0]
    best, least = None, numpy.inf
    for offset in numpy.arange(first, last, _GRID):
        at = times + offset
        inside = (at >= track.time[0]) & (at <= track.time[-1])
        if inside.mean() < _SHARE:
            continue
        apart = numpy.linalg.norm(_positions(track, at[inside]) - positions[inside], axis=1)
        if float(numpy.median(apart)) < least:
            best, least = float(offset), float(numpy.median(apart))
    return best


def _positions(track: RecordedTrack, at: Array) -> Array:
    return numpy.stack([numpy.interp(at, track.time, axis) for axis in track.position.T], axis=-1)


_QUATERNION = ("qw", "qx", "qy", "qz")
_ANGLES = ("roll", "pitch", "heading")
_COLUMNS: dict[str, Dimension | None] = {
    "time": DURATION,
    **dict.fromkeys(("x", "y", "z"), LENGTH),
    **dict.fromkeys(_QUATERNION, NUMBER),
    **dict.fromkeys(_ANGLES, ANGLE),
}
_LIKE = "time, x, y, z, qw, qx, qy, qz"
_NORM_TOLERANCE = 0.01
"""Largest deviation of a quaternion's squared norm from 1."""


def read_poses(text: str) -> RecordedTrack:
    """Return the poses of a table: at least two, at increasing times. Raises FileError."""
    table = read_table(text, _COLUMNS, "poses", _LIKE)
    turns = _ANGLES if any(name in table.columns for name in _ANGLES) else _QUATERNION
    need(table, ("time", "x", "y", "z", *turns), header_line(text))
    times: list[float] = []
    positions: list[Vec3] = []
    attitudes: list[Quat] = []
    for line, numbers, _ in table.rows:
        if times and numbers["time"] <= times[-1]:
            raise FileError("the times don't grow", line)
        times.append(numbers["time"])
        positions.append((numbers["x"], numbers["y"], numbers["z"]))
        if turns is _ANGLES:
            attitudes.append(from_euler(*(numbers[name] for name in _ANGLES)))
            continue
        w, x, y, z = (numbers[name] for name in _QUATERNION)
        square = w * w + x * x + y * y + z * z
        if abs(square - 1.0) > _NORM_TOLERANCE:
            raise FileError(f"the quaternion's length is {square**0.5:.2f}, not 1", line)
        scale = square**-0.5
        attitudes.append((w * scale, x * scale, y * scale, z * scale))
    if len(times) < 2:
        raise FileError(f"it has {len(times)} poses; at least two are needed")
    return RecordedTrack(*(numpy.array(part) for part in (times, positions, attitudes)))
