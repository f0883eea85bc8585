"""Makes the report's statistics of each estimator, and its page of figures and pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from kybflow.core.units import DEG
from kybflow.report.data import Picture, RecordedRun
from kybflow.report.estimators import EstimatorTrack
from kybflow.report.plot import Figure, bands, dashed, line, over_time

CHI_95 = 2.796
"""Bound of 95 % of the position errors, in standard deviations along an axis, if they are equal for
all axes: the root of the 95 % quantile of the chi-square distribution with three degrees of
freedom."""

MOST_POINTS = 3000
"""The most points in a curve."""
_USED = "rgba(31,158,119,0.16)"
_AXES = (("x", "#2f7ed8"), ("y", "#e07b26"), ("z", "#a55ec4"))


@dataclass(frozen=True)
class EstimatorStatistics:
    """The errors of an estimator while the vehicle flew on it; all but `share` are None if it never
    did.

    share: the share of the vehicle's ticks. mean, p99, highest: of the position error, m. within:
    the share of position errors below `CHI_95` standard deviations, without the ticks in which an
    offset from the estimator before was being removed. yaw_p99: rad. age_mean, age_highest: s.
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
    """Return the statistics of one estimator. ticks: the number of the vehicle's ticks."""
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


@dataclass(frozen=True)
class EstimatorPage:
    """The figures of one estimator and the pictures of its cameras."""

    track: EstimatorTrack
    figures: tuple[Figure, ...]
    pictures: tuple[Picture, ...]


def estimator_pages(run: RecordedRun) -> list[EstimatorPage]:
    """Return a page for each recorded estimator."""
    pages: list[EstimatorPage] = []
    for track in (track for track in run.estimators if track.name):
        draws = (error_figure, attitude_figure, age_figure)
        figures = tuple(draw(run, track, f"estimator_{len(pages)}") for draw in draws)
        own = (track.vehicle, track.name)
        pictures = tuple(p for p in run.pictures if (p.vehicle, p.estimator) == own)
        pages.append(EstimatorPage(track, figures, pictures))
    return pages


def statistics(run: RecordedRun) -> Iterator[tuple[EstimatorTrack, EstimatorStatistics]]:
    """Yield each estimator with its statistics. If a vehicle has several, first yield the estimates
    that it flew on, as an estimator without a name."""
    for vehicle in dict.fromkeys(track.vehicle for track in run.estimators):
        flown, *others = (track for track in run.estimators if track.vehicle == vehicle)
        for track in [flown, *others] if len(others) > 1 else others:
            yield track, statistics_of(track, len(flown.time))


def error_figure(run: RecordedRun, track: EstimatorTrack, name: str) -> Figure:
    """Draw the position error and its bound according to the estimator's spread."""
    kept = _kept(track)
    time, bound = track.time[kept], CHI_95 * track.spread[kept] * 100.0
    off, each = track.position_error[kept] * 100.0, track.error[kept] * 100.0
    traces = [line("error", time, off, "#d1495b", 1.6, hover="%{y:.2f} cm")]
    limit = dashed(f"{CHI_95:.1f} spreads", time, bound, True)
    limit |= {"hoverinfo": "all", "hovertemplate": f"%{{y:.2f}} cm<extra>{limit['name']}</extra>"}
    traces.append({**limit, "legendgroup": name})
    for number, (axis, colour) in enumerate(_AXES):
        trace = line(axis, time, each[:, number], colour, 1.1, hover="%{y:.2f} cm")
        traces.append({**trace, "visible": "legendonly"})
    note = (
        f"From {_reference(run)}. If the spread is right, 95 % of the errors are below its line. "
        "Shaded: in use."
    )
    layout = over_time(run, "error (cm)", "normal")
    # the largest error while in use, or the 99 % quantile of the bounds if that is larger
    errors, bounds = (v[track.used[kept] & np.isfinite(v)] for v in (off, bound))
    common = float(np.quantile(bounds, 0.99)) if len(bounds) else 0.0
    highest = max(common, float(errors.max(initial=0.0)))
    if highest > 0.0:
        layout["yaxis"]["range"] = [0.0, 1.15 * highest]
        note += " Click x, y or z for one axis; double-click for the full range."
    return Figure(f"{name}_error", "Error and spread", note, traces, layout | _in_use(track))


def attitude_figure(run: RecordedRun, track: EstimatorTrack, name: str) -> Figure:
    """Draw the errors of attitude and heading."""
    kept = _kept(track)
    time, attitude = track.time[kept], track.attitude_error[kept] / DEG
    yaw = np.abs(track.yaw_error[kept]) / DEG
    traces = [
        line("attitude", time, attitude, "#d1495b", 1.4, hover="%{y:.2f} deg"),
        line("yaw", time, yaw, "#2f7ed8", 1.4, hover="%{y:.2f} deg"),
    ]
    layout = over_time(run, "error (deg)", "tozero") | {"height": 240}
    note = (
        f"From {_reference(run)}: the angle between the two attitudes, and between their headings."
    )
    return Figure(f"{name}_attitude", "Attitude", note, traces, layout | _in_use(track))


def age_figure(run: RecordedRun, track: EstimatorTrack, name: str) -> Figure:
    """Draw the age of the estimator's newest measurement."""
    kept = _kept(track)
    time, age = track.time[kept], track.age[kept] * 1000.0
    traces = [line("age", time, age, "#2f7ed8", 1.4, hover="%{y:.0f} ms")]
    layout = over_time(run, "age (ms)", "tozero") | {"height": 200, "showlegend": False}
    note = "Of its newest measurement."
    shapes = _in_use(track).get("shapes", [])
    return Figure(f"{name}_age", "Age", note, traces, layout | {"shapes": shapes})


def _kept(track: EstimatorTrack) -> slice:
    return slice(None, None, max(1, -(-len(track.time) // MOST_POINTS)))


def _reference(run: RecordedRun) -> str:
    return "the truth" if run.simulated else "the estimate that the vehicle flew on"


def _in_use(track: EstimatorTrack) -> dict[str, Any]:
    """Return the bands that mark when the vehicle flew on the estimator, as part of a layout."""
    return bands(("in use", start, end, _USED, {}) for start, end in track.intervals_used())
