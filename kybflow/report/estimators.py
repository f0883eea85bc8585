"""How good each estimator was, whether the vehicle flew on it or not: arrays over time and the
statistics of their errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from mcap.records import Message
from numpy.typing import NDArray

from kybflow.core.signals import NS
from kybflow.recording.layout import dtype_spec

Array = NDArray[np.float64]

CHI_95 = 2.796
"""Standard deviations along an axis within which 95 % of errors in three dimensions are, where each
axis has the same: the root of the chi-square quantile with three degrees of freedom."""

_SAME_POSITION = 1e-4
"""Metres: what is left of an offset that does not count any more."""
_TICK, _CANDIDATE = np.dtype(dtype_spec("Tick")), np.dtype(dtype_spec("Candidate"))


@dataclass(frozen=True)
class EstimatorTrack:
    """One estimator over time, SI, not-a-number where it has no estimate.

    error: (n, 3), from the true position; without a truth, from the estimate that the vehicle flew
    on. yaw_error, attitude_error: of the attitude in the same way, about the world's z axis and in
    all. usable, used: whether the vehicle could have flown on it, and did. blended: whether the
    vehicle flew on no estimator's own estimate, because an offset was being taken away.
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
        """The length of `error`, metres."""
        return norm(self.error)

    def intervals_used(self) -> list[tuple[float, float]]:
        """From when to when the vehicle flew on it, seconds."""
        step = float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0
        edges = np.flatnonzero(np.diff(np.concatenate(([False], self.used, [False])).astype(int)))
        return [
            (float(self.time[first]), float(self.time[last - 1]) + step)
            for first, last in edges.reshape(-1, 2)
        ]


@dataclass(frozen=True)
class EstimatorStatistics:
    """The errors of an estimator while the vehicle flew on it; None if it never did.

    share: of all ticks. mean, p99, highest: of the position error, m. within: the share of position
    errors within `CHI_95` spreads, of the ticks in which no offset was being taken away. yaw_p99:
    rad. age_mean, age_highest: s.
    """

    share: float
    mean: float | None = None
    p99: float | None = None
    highest: float | None = None
    within: float | None = None
    yaw_p99: float | None = None
    age_mean: float | None = None
    age_highest: float | None = None


def statistics_of(track: EstimatorTrack, ticks: int) -> EstimatorStatistics:
    """The statistics of one estimator of a vehicle of which so many `ticks` are shown."""
    used = track.used & ~np.isnan(track.age)
    share = float(track.used.sum()) / max(ticks, 1)
    age, distance = track.age[used], track.position_error
    known = used & ~np.isnan(distance)
    if not known.any():
        return EstimatorStatistics(share)
    errors, own = distance[known], known & ~track.blended
    is_within = distance[own] <= CHI_95 * track.spread[own]
    return EstimatorStatistics(
        share,
        float(errors.mean()),
        float(np.quantile(errors, 0.99)),
        float(errors.max()),
        float(is_within.mean()) if own.any() else None,
        float(np.quantile(np.abs(track.yaw_error[known]), 0.99)),
        float(age.mean()),
        float(age.max()),
    )


def read_estimators(
    messages: Mapping[str, Sequence[Message]], vehicle: str
) -> Iterator[EstimatorTrack]:
    """What a vehicle flew on, whichever it was, as an estimator without a name; then each of its
    estimators. Nothing where none was recorded. messages: by topic."""
    ticks, stamps = _decoded(messages.get(f"/{vehicle}/tick", ()), _TICK)
    flown, truth = ticks["estimate"], ticks["truth"]
    is_known = truth["present"][:, None]
    reference = _Reference(
        np.where(is_known, truth["position"], _present(flown, "position")),
        np.where(is_known, truth["attitude"], _present(flown, "attitude")),
    )
    prefix = f"/{vehicle}/estimator/"
    blended, found = np.full(len(ticks), -1), []
    for topic in (topic for topic in messages if topic.startswith(prefix)):
        said, at = _decoded(messages[topic], _CANDIDATE)
        index = np.searchsorted(stamps, at).clip(0, max(len(stamps) - 1, 0))
        held = stamps[index] == at if len(stamps) else np.zeros(len(at), bool)
        said, index, at = said[held], index[held], at[held]
        apart = np.abs(said["position"] - flown["position"][index]).max(axis=1, initial=0.0)
        used, own = said["used"], np.zeros(len(said), bool)
        blended[index[used]] = apart[used] > _SAME_POSITION
        name = topic.removeprefix(prefix)
        found.append(
            _track(vehicle, name, at, reference.at(index), said, said["usable"], used, own)
        )
    if found:
        present, offset = flown["present"], _held(blended) == 1
        yield _track(vehicle, "", stamps, reference, flown, present, present, offset)
    yield from found


class _Reference(NamedTuple):
    """The truth, or what comes nearest to it: (n, 3), (n, 4)."""

    position: Array
    attitude: Array

    def at(self, index: NDArray[np.int64]) -> _Reference:
        return _Reference(self.position[index], self.attitude[index])


def _decoded(
    messages: Sequence[Message], kind: np.dtype[Any]
) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """(the messages as one array, their log times in ns)."""
    data = np.frombuffer(b"".join(message.data for message in messages), kind)
    return data, np.array([message.log_time for message in messages], np.int64)


def _track(
    vehicle: str,
    name: str,
    stamps: NDArray[np.int64],
    reference: _Reference,
    said: NDArray[Any],
    usable: NDArray[np.bool_],
    used: NDArray[np.bool_],
    blended: NDArray[np.bool_],
) -> EstimatorTrack:
    return EstimatorTrack(
        vehicle,
        name,
        stamps / NS,
        _present(said, "position") - reference.position,
        *_turned(_present(said, "attitude"), reference.attitude),
        _present(said, "age"),
        _present(said, "spread"),
        usable,
        used,
        blended,
    )


def _held(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Each value, or the last one before it that is not negative."""
    last = np.maximum.accumulate(np.where(values >= 0, np.arange(len(values)), 0))
    held: NDArray[np.int64] = values[last]
    return held


def _turned(a: Array, b: Array) -> tuple[Array, Array]:
    """From attitude `b` to `a`: how far the heading turned, and the attitude in all, radians."""
    product: Array = np.abs((a * b).sum(axis=1))
    yaw: Array = (_heading(a) - _heading(b) + np.pi) % (2.0 * np.pi) - np.pi
    turn: Array = 2.0 * np.arccos(product.clip(0.0, 1.0))
    return yaw, turn


def _heading(q: Array) -> Array:
    w, x, y, z = q.T
    heading: Array = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return heading


def _present(said: NDArray[Any], name: str) -> Array:
    """A field, not-a-number where there is no estimate."""
    values, present = said[name], said["present"]
    known: Array = np.where(present if values.ndim == 1 else present[:, None], values, np.nan)
    return known


def norm(vectors: Array) -> Array:
    """The length of each row of (n, 3)."""
    length: Array = np.sqrt((vectors * vectors).sum(axis=1))
    return length
