"""Makes traces and layouts of figures, as the dictionaries that plotly.js draws.

The page replaces the colours `ink`, `soft`, `alarm` and `paper` by those of its theme.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from kybflow.recording.appearance import vehicle_colour
from kybflow.report.data import RecordedRun, Track
from kybflow.report.estimators import Array
from kybflow.report.events import BLIND, CLAMP, FALLBACK, FAULT, HOLD, TINTS, Interval

_SIDES = {FAULT: "top", HOLD: "middle", CLAMP: "middle", BLIND: "middle", FALLBACK: "bottom"}
"""The vertical position of an interval's label by kind, so that overlapping labels stay readable.
"""


@dataclass(frozen=True)
class Figure:
    """One figure. over_time: whether its x axis is the time of the run; all these figures zoom
    together."""

    name: str
    title: str
    note: str
    traces: list[dict[str, Any]]
    layout: dict[str, Any]
    over_time: bool = True


class Extent(NamedTuple):
    """A rectangle of the map; metres, world frame."""

    x0: float
    y0: float
    x1: float
    y1: float

    def grown(self, by: float) -> Extent:
        return Extent(self.x0 - by, self.y0 - by, self.x1 + by, self.y1 + by)

    def covers(self, other: Extent) -> bool:
        return bool(
            self.x0 <= other.x0
            and self.y0 <= other.y0
            and other.x1 <= self.x1
            and other.y1 <= self.y1
        )

    @property
    def span(self) -> float:
        """The longer side, metres."""
        return max(self.x1 - self.x0, self.y1 - self.y0)


def around(outlines: list[Array]) -> Extent:
    """Return the extent of points from above, (n, 2) each; not-a-number doesn't count."""
    points = np.concatenate(outlines)
    return Extent(*np.nanmin(points, axis=0).tolist(), *np.nanmax(points, axis=0).tolist())


def line(
    name: str, x: Array, y: Array, colour: str, width: float, hover: str = ""
) -> dict[str, Any]:
    """Return the trace of a line. hover: the template of a point's label; empty for no label."""
    trace = {
        "type": "scatter",
        "mode": "lines",
        "name": name,
        "x": _packed(x),
        "y": _packed(y),
        "line": {"color": colour, "width": width},
    }
    if hover:
        trace["hovertemplate"] = f"{hover}<extra>{name}</extra>"
    else:
        trace["hoverinfo"] = "skip"
    return trace


def dashed(name: str, x: Array, y: Array, shown: bool) -> dict[str, Any]:
    """Return a thin dashed line in the colour of the text. Lines with the same name share one
    legend entry; the line with `shown` adds it."""
    trace = line(name, x, y, "ink", 1.2)
    trace["line"]["dash"] = "5px,3px"
    return {**trace, "legendgroup": name, "showlegend": shown}


def markers(
    name: str, x: list[Any], y: list[Any], marker: dict[str, Any], hover: str, **more: Any
) -> dict[str, Any]:
    """Return the trace of points. more: further properties of the trace."""
    trace = {"type": "scatter", "mode": "markers", "name": name, "x": x, "y": y, "marker": marker}
    return {**trace, "hovertemplate": f"{hover}<extra></extra>", **more}


def level(run: RecordedRun, name: str, at: float, dash: str) -> dict[str, Any]:
    """Return a horizontal line over the whole run."""
    limit = line(name, np.array([0.0, run.end]), np.full(2, at), "alarm", 1.4)
    limit["line"]["dash"] = dash
    return limit


def _packed(values: Array) -> dict[str, str]:
    """Encode an array for plotly.js; not-a-number leaves a gap."""
    data = values.astype("<f4").tobytes()
    return {"dtype": "f4", "bdata": base64.b64encode(data).decode()}


def time_axis(run: RecordedRun) -> dict[str, Any]:
    end = max(run.end, 0.1)
    return {"title": {"text": "time (s)"}, "range": [-0.01 * end, 1.01 * end]}


def over_time(run: RecordedRun, axis: str, mode: str) -> dict[str, Any]:
    """Return the layout of a figure over time. mode: the range mode of the y axis."""
    return {
        "xaxis": time_axis(run),
        "yaxis": {"title": {"text": axis}, "rangemode": mode},
        "height": 300,
        "hovermode": "x unified",
    }


def shade(intervals: Sequence[Interval], named: bool) -> dict[str, Any]:
    """Return intervals drawn behind the curves, as part of a layout. named: whether labels include
    the vehicle."""
    found = []
    for one in intervals:
        text = f"{one.vehicle}: {one.label}" if named else one.label
        place, font = f"{_SIDES[one.kind]} left", {"size": 10, "color": "ink"}
        label = {"label": {"text": text, "textposition": place, "font": font}}
        found.append((one.kind, one.start, one.end, TINTS[one.kind], label))
    return bands(found)


def bands(found: Iterable[tuple[str, float, float, str, dict[str, Any]]]) -> dict[str, Any]:
    """Return bands over the full height of a figure, as part of a layout. found: (legend entry,
    start, end, colour, further properties) of each."""
    shapes: list[dict[str, Any]] = []
    seen: set[str] = set()
    for name, start, end, colour, more in found:
        shape = {
            "type": "rect",
            "layer": "below",
            "xref": "x",
            "yref": "paper",
            "x0": start,
            "x1": end,
            "y0": 0,
            "y1": 1,
            "line": {"width": 0},
            "fillcolor": colour,
            "name": name,
            "legendgroup": name,
            "showlegend": name not in seen,
        }
        shapes.append(shape | more)
        seen.add(name)
    return {"shapes": shapes, "showlegend": True} if shapes else {}


def coloured(run: RecordedRun) -> list[tuple[Track, str]]:
    """Return each track with its vehicle's colour, which is the same in all figures."""
    return [(track, vehicle_colour(n)) for n, track in enumerate(run.tracks)]
