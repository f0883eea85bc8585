"""What a recording says of each estimator, flown on or not, as arrays and figures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kybflow.runtime.record_layout import dtype_spec
from kybflow.runtime.report_log import Log
from kybflow.signals import NS

Array = NDArray[np.float64]

SURE = 2.796
"""Deviations along an axis within which 95 % of errors in three dimensions are, where each axis has
the same (chi-square, three degrees of freedom)."""

_TICK, _CANDIDATE = np.dtype(dtype_spec("Tick")), np.dtype(dtype_spec("Candidate"))


@dataclass(frozen=True)
class Estimated:
    """One estimator over time, SI, not-a-number where it has no estimate. error: (n, 3), from the
    truth; without one, from the estimate that the vehicle flew on. usable, used: whether the
    vehicle could have flown on it, and did."""

    vehicle: str
    name: str
    time: Array
    error: Array
    age: Array
    spread: Array
    usable: NDArray[np.bool_]
    used: NDArray[np.bool_]

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
    `SURE` spreads. age, oldest: mean and most."""

    share: float
    mean: float | None = None
    high: float | None = None
    worst: float | None = None
    within: float | None = None
    age: float | None = None
    oldest: float | None = None


def figures_of(estimated: Estimated, ticks: int) -> Figures:
    """The figures of one estimator of a vehicle of which so many `ticks` are shown."""
    used = estimated.used & ~np.isnan(estimated.age)
    share = float(estimated.used.sum()) / max(ticks, 1)
    age = estimated.age[used]
    known = used & ~np.isnan(estimated.off)
    if not known.any():
        return Figures(share)
    off = estimated.off[known]
    return Figures(
        share,
        float(off.mean()),
        float(np.quantile(off, 0.99)),
        float(off.max()),
        float((off <= SURE * estimated.spread[known]).mean()),
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
    known = np.where(truth["present"][:, None], truth["position"], _known(flown, "position"))
    began = f"/{vehicle}/estimator/"
    topics = [topic for topic in log.messages if topic.startswith(began)]
    if topics:
        yield _estimated(vehicle, "", stamps, known, flown, flown["present"], flown["present"])
    for topic in topics:
        found = log.messages[topic]
        said = np.frombuffer(b"".join(message.data for message in found), _CANDIDATE)
        at = np.array([message.log_time for message in found], np.int64)
        index = np.searchsorted(stamps, at).clip(0, max(len(stamps) - 1, 0))
        held = stamps[index] == at if len(stamps) else np.zeros(len(at), bool)
        said, index = said[held], index[held]
        name = topic.removeprefix(began)
        yield _estimated(vehicle, name, at[held], known[index], said, said["usable"], said["used"])


def _estimated(
    vehicle: str,
    name: str,
    stamps: NDArray[np.int64],
    known: Array,
    said: NDArray[Any],
    usable: NDArray[np.bool_],
    used: NDArray[np.bool_],
) -> Estimated:
    error, age, spread = (
        _known(said, "position") - known,
        _known(said, "age"),
        _known(said, "spread"),
    )
    return Estimated(vehicle, name, stamps / NS, error, age, spread, usable, used)


def _known(said: NDArray[Any], name: str) -> Array:
    """A field, not-a-number where there is no estimate."""
    values, present = said[name], said["present"]
    known: Array = np.where(present if values.ndim == 1 else present[:, None], values, np.nan)
    return known
