"""What a recording says of each estimator, flown on or not, as arrays and figures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kybflow.core.signals import NS
from kybflow.recording.layout import dtype_spec
from kybflow.report.log import Log

Array = NDArray[np.float64]

SURE = 2.796
"""Deviations along an axis within which 95 % of errors in three dimensions are, where each axis has
the same (chi-square, three degrees of freedom)."""

_SAME = 1e-4
"""Metres: what is left of an offset that does not count any more."""
_TICK, _CANDIDATE = np.dtype(dtype_spec("Tick")), np.dtype(dtype_spec("Candidate"))


@dataclass(frozen=True)
class Estimated:
    """One estimator over time, SI, not-a-number where it has no estimate. error: (n, 3), from the
    truth; without one, from the estimate that the vehicle flew on. yaw, turn: of the attitude in
    the same way, about the world's z axis and in all. usable, used: whether the vehicle could have
    flown on it, and did. blended: whether what it flew on was not that of any estimator, because an
    offset was being taken away."""

    vehicle: str
    name: str
    time: Array
    error: Array
    yaw: Array
    turn: Array
    age: Array
    spread: Array
    usable: NDArray[np.bool_]
    used: NDArray[np.bool_]
    blended: NDArray[np.bool_]

    @property
    def off(self) -> Array:
        """How far it was off, metres."""
        distance: Array = np.sqrt((self.error * self.error).sum(axis=1))
        return distance

    def spans(self) -> list[tuple[float, float]]:
        """From when to when it was flown on."""
        step = float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0
        edges = np.flatnonzero(np.diff(np.concatenate(([False], self.used, [False])).astype(int)))
        return [
            (float(self.time[first]), float(self.time[last - 1]) + step)
            for first, last in edges.reshape(-1, 2)
        ]


@dataclass(frozen=True)
class Figures:
    """While it was flown on. share: of the ticks. mean, high, worst: how far it was off, the mean,
    what 99 % are below, the most; None if never. within: the share of errors that were within
    `SURE` spreads, of ticks without an offset that is being taken away. yaw: what 99 % of its
    errors are below. age, oldest: mean and most."""

    share: float
    mean: float | None = None
    high: float | None = None
    worst: float | None = None
    within: float | None = None
    yaw: float | None = None
    age: float | None = None
    oldest: float | None = None


class _Known(NamedTuple):
    """The truth, or what comes nearest to it: (n, 3), (n, 4)."""

    position: Array
    attitude: Array

    def at(self, index: NDArray[np.int64]) -> _Known:
        return _Known(self.position[index], self.attitude[index])


def figures_of(estimated: Estimated, ticks: int) -> Figures:
    """The figures of one estimator of a vehicle of which so many `ticks` are shown."""
    used = estimated.used & ~np.isnan(estimated.age)
    share = float(estimated.used.sum()) / max(ticks, 1)
    age = estimated.age[used]
    known = used & ~np.isnan(estimated.off)
    if not known.any():
        return Figures(share)
    off = estimated.off[known]
    told = known & ~estimated.blended
    is_within = estimated.off[told] <= SURE * estimated.spread[told]
    return Figures(
        share,
        float(off.mean()),
        float(np.quantile(off, 0.99)),
        float(off.max()),
        float(is_within.mean()) if told.any() else None,
        float(np.quantile(np.abs(estimated.yaw[known]), 0.99)),
        float(age.mean()),
        float(age.max()),
    )


def read_estimators(log: Log, vehicle: str) -> Iterator[Estimated]:
    """What a vehicle flew on, whichever it was, as an estimator without a name; then each of its
    estimators. Nothing of one that was not recorded."""
    messages = log.messages.get(f"/{vehicle}/tick", [])
    ticks = np.frombuffer(b"".join(message.data for message in messages), _TICK)
    stamps = np.array([message.log_time for message in messages], np.int64)
    flown, truth = ticks["estimate"], ticks["truth"]
    present = truth["present"][:, None]
    best = _Known(
        np.where(present, truth["position"], _known(flown, "position")),
        np.where(present, truth["attitude"], _known(flown, "attitude")),
    )
    began = f"/{vehicle}/estimator/"
    blended, found = np.full(len(ticks), -1), []
    for topic in (topic for topic in log.messages if topic.startswith(began)):
        said = np.frombuffer(b"".join(m.data for m in log.messages[topic]), _CANDIDATE)
        at = np.array([message.log_time for message in log.messages[topic]], np.int64)
        index = np.searchsorted(stamps, at).clip(0, max(len(stamps) - 1, 0))
        held = stamps[index] == at if len(stamps) else np.zeros(len(at), bool)
        said, index = said[held], index[held]
        apart = np.abs(said["position"] - flown["position"][index]).max(axis=1, initial=0.0)
        used = said["used"]
        blended[index[used]] = apart[used] > _SAME
        found.append(_estimated(vehicle, topic.removeprefix(began), at[held], best.at(index), said))
    if found:
        yield _flown(vehicle, stamps, best, flown, _held(blended) == 1)
    yield from found


def _estimated(
    vehicle: str, name: str, stamps: NDArray[np.int64], best: _Known, said: NDArray[Any]
) -> Estimated:
    """An estimator from what was recorded of it."""
    return Estimated(
        vehicle,
        name,
        stamps / NS,
        _known(said, "position") - best.position,
        *_turned(_known(said, "attitude"), best.attitude),
        _known(said, "age"),
        _known(said, "spread"),
        said["usable"],
        said["used"],
        np.zeros(len(said), bool),
    )


def _flown(
    vehicle: str,
    stamps: NDArray[np.int64],
    best: _Known,
    flown: NDArray[Any],
    blended: NDArray[np.bool_],
) -> Estimated:
    """What was flown on."""
    return Estimated(
        vehicle,
        "",
        stamps / NS,
        _known(flown, "position") - best.position,
        *_turned(_known(flown, "attitude"), best.attitude),
        _known(flown, "age"),
        _known(flown, "spread"),
        flown["present"],
        flown["present"],
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


def _known(said: NDArray[Any], name: str) -> Array:
    """A field, not-a-number where there is no estimate."""
    values, present = said[name], said["present"]
    known: Array = np.where(present if values.ndim == 1 else present[:, None], values, np.nan)
    return known
