"""What the figures of a report are made of, as the plain dictionaries that plotly.js draws.

Colours that depend on the page's theme are words (`ink`, `soft`, `alarm`, `paper`) that the page
replaces.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from kybflow.report.data import Run, Track
from kybflow.report.estimators import Array
from kybflow.report.intervals import BLIND, CLAMP, FALLBACK, FAULT, HOLD, TINTS, Interval

VEHICLES = ("#2f7ed8", "#e07b26", "#1f9e77", "#a55ec4", "#d1495b", "#7a8b1f", "#00a3b5", "#c2578f")

_SIDES = {FAULT: "top", HOLD: "middle", CLAMP: "middle", BLIND: "middle", FALLBACK: "bottom"}
"""Where an interval's label stands, so that those that overlap can be read."""


@dataclass(frozen=True)
class Figure:
    """One figure. over_time: its x axis is the run's time, and it is zoomed with the others that
    have it."""

    name: str
    title: str
    note: str
    traces: list[dict[str, Any]]
    layout: dict[str, Any]
    over_time: bool = True


def line(
    name: str, x: Array, y: Array, colour: str, width: float, hover: str = ""
) -> dict[str, Any]:
    """A line; `hover` is the template of what is shown for a point, which is nothing without it."""
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
    """A thin dashed line in the colour of the text. Those of one name share one entry of the
    legend, the one that is `shown`."""
    trace = line(name, x, y, "ink", 1.2)
    trace["line"]["dash"] = "5px,3px"
    return {**trace, "legendgroup": name, "showlegend": shown}


def _packed(values: Array) -> dict[str, str]:
    """An array as plotly.js reads it from base64; a gap stays not-a-number."""
    data = values.astype("<f4").tobytes()
    return {"dtype": "f4", "bdata": base64.b64encode(data).decode()}


def time_axis(run: Run) -> dict[str, Any]:
    """The x axis that all figures over time share."""
    end = max(run.end, 0.1)
    return {"title": {"text": "time (s)"}, "range": [-0.01 * end, 1.01 * end]}


def over_time(run: Run, axis: str, mode: str) -> dict[str, Any]:
    """The layout of a figure over time; `mode` is the y axis's range mode."""
    return {
        "xaxis": time_axis(run),
        "yaxis": {"title": {"text": axis}, "rangemode": mode},
        "height": 300,
        "hovermode": "x unified",
    }


def shade(intervals: Sequence[Interval], named: bool) -> dict[str, Any]:
    """Intervals behind curves, as part of a layout: a legend entry a kind, each with its label and,
    where `named`, its vehicle."""
    found = ((i.kind, i.start, i.end, TINTS[i.kind], _label(i, named)) for i in intervals)
    return bands(found)


def _label(interval: Interval, named: bool) -> dict[str, Any]:
    text = f"{interval.vehicle}: {interval.label}" if named else interval.label
    place, font = f"{_SIDES[interval.kind]} left", {"size": 10, "color": "ink"}
    return {"label": {"text": text, "textposition": place, "font": font}}


def bands(found: Iterable[tuple[str, float, float, str, dict[str, Any]]]) -> dict[str, Any]:
    """Bands over the whole height of a figure, as part of a layout, each as (its entry in the
    legend, start, end, colour, more of its shape)."""
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


def coloured(run: Run) -> list[tuple[Track, str]]:
    """Each vehicle's track with its colour, the same in all figures."""
    return [(track, VEHICLES[n % len(VEHICLES)]) for n, track in enumerate(run.tracks)]
