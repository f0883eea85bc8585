"""Computes the errors of each estimator over time, whether or not the vehicle flew on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kybflow.core.signals import NS
from kybflow.recording.layout import dtype_spec, kept_every
from kybflow.recording.messages import TICK, Recording

Array = NDArray[np.float64]

_SAME_POSITION = 1e-4
"""The largest negligible offset between two positions, m."""
_CANDIDATE = np.dtype(dtype_spec("Candidate"))


@dataclass(frozen=True)
class EstimatorTrack:
    """One estimator over time. SI units; not-a-number where it has no estimate.

    error: (n, 3), the offset from the true position or, if there is no truth, from the estimate
    that the vehicle flew on. yaw_error, attitude_error: the angles between its heading or attitude
    and those of this reference. usable, used: whether the vehicle could have flown on it, and
    whether it did. blended: whether the vehicle flew on an estimate that still contained an offset
    being removed.
    """

    vehicle: str
    name: str
    time: Array
    error: Array
    yaw_error: Array
    attitude_error: Array
    age: Array
    spread: Array
    usable: NDArray[np.bool_]
    used: NDArray[np.bool_]
    blended: NDArray[np.bool_]

    @property
    def position_error(self) -> Array:
        """The norm of `error`, metres."""
        return norm(self.error)

    def intervals_used(self) -> list[tuple[float, float]]:
        """Return the (start, end) of each interval in which the vehicle flew on this estimator,
        seconds."""
        step = float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0
        edges = np.flatnonzero(np.diff(np.concatenate(([False], self.used, [False])).astype(int)))
        return [
            (float(self.time[first]), float(self.time[last - 1]) + step)
            for first, last in edges.reshape(-1, 2)
        ]


def read_estimators(log: Recording, vehicle: str) -> Iterator[EstimatorTrack]:
    """Yield the estimates that a vehicle flew on as a track without a name, then a track for each
    of its estimators; nothing if none was recorded. Candidates are matched with all ticks: after a
    gap in the recording, thinned ones are others than those at which candidates were recorded."""
    stamps, ticks = log[f"/{vehicle}/tick"].decoded(TICK)
    flown, truth = ticks["estimate"], ticks["truth"]
    is_known = truth["present"][:, None]
    reference = _Reference(
        np.where(is_known, truth["position"], _present(flown, "position")),
        np.where(is_known, truth["attitude"], _present(flown, "attitude")),
    )
    prefix = f"/{vehicle}/estimator/"
    blended, found = np.full(len(ticks), -1), []
    for topic in (topic for topic in log.topics if topic.startswith(prefix)):
        at, rows = log[topic].decoded(_CANDIDATE)
        index = np.searchsorted(stamps, at).clip(0, max(len(stamps) - 1, 0))
        held = stamps[index] == at if len(stamps) else np.zeros(len(at), bool)
        rows, index, at = rows[held], index[held], at[held]
        apart = np.abs(rows["position"] - flown["position"][index]).max(axis=1, initial=0.0)
        used, own = rows["used"], np.zeros(len(rows), bool)
        blended[index[used]] = apart[used] > _SAME_POSITION
        name = topic.removeprefix(prefix)
        nearest = _Reference(reference.position[index], reference.attitude[index])
        found.append(_track(vehicle, name, at, nearest, rows, rows["usable"], used, own))
    if found:  # a tick without a candidate counts like the last one that has any
        last = np.maximum.accumulate(np.where(blended >= 0, np.arange(len(blended)), 0))
        some = slice(None, None, kept_every(log.mission["control_rate"]))
        present, offset = flown["present"][some], blended[last][some] == 1
        nearest = _Reference(reference.position[some], reference.attitude[some])
        yield _track(vehicle, "", stamps[some], nearest, flown[some], present, present, offset)
    yield from found


class _Reference(NamedTuple):
    """The truth or, without it, the estimate that the vehicle flew on: positions (n, 3) and
    quaternions (n, 4)."""

    position: Array
    attitude: Array


def _track(
    vehicle: str,
    name: str,
    stamps: NDArray[np.int64],
    reference: _Reference,
    rows: NDArray[Any],
    usable: NDArray[np.bool_],
    used: NDArray[np.bool_],
    blended: NDArray[np.bool_],
) -> EstimatorTrack:
    own, theirs = _present(rows, "attitude"), reference.attitude
    yaw: Array = (heading(own) - heading(theirs) + np.pi) % (2.0 * np.pi) - np.pi
    turn: Array = 2.0 * np.arccos(np.abs((own * theirs).sum(axis=1)).clip(0.0, 1.0))
    error = _present(rows, "position") - reference.position
    age, spread = _present(rows, "age"), _present(rows, "spread")
    return EstimatorTrack(
        vehicle, name, stamps / NS, error, yaw, turn, age, spread, usable, used, blended
    )


def heading(q: Array) -> Array:
    w, x, y, z = q.T
    found: Array = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return found


def _present(rows: NDArray[Any], name: str) -> Array:
    """Return a field of the rows, not-a-number where there is no estimate."""
    values, present = rows[name], rows["present"]
    return np.where(present if values.ndim == 1 else present[:, None], values, np.nan)


def norm(vectors: Array) -> Array:
    """Return the norm of each row, for an array of shape (n, 3)."""
    length: Array = np.sqrt((vectors * vectors).sum(axis=1))
    return length
