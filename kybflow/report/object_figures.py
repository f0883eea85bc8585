"""The figures of objects: where they are on the maps, their coordinates over time, and what presses
them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import cycle
from typing import Any

import numpy as np

from kybflow.core.units import DEG
from kybflow.recording.appearance import fields_text
from kybflow.report import plot
from kybflow.report.data import RecordedRun
from kybflow.report.estimators import Array
from kybflow.report.events import BLIND, TINTS
from kybflow.report.objects import ObjectTrack
from kybflow.report.plot import around

_FILL, _EDGE = "rgba(190,140,50,0.45)", "#9a6f1e"
_CURVES = {"true": ("true", _EDGE, 4.0), "seen": ("tracked", "ink", 1.0)}
_LEAST = {"m": 0.05, "deg": 3.0}
"""Half of the least range of a coordinate's axis."""
_AXES = {"x": "x, east", "y": "y, north", "z": "z, up"}


def objects_from_above(run: RecordedRun) -> Iterator[dict[str, Any]]:
    """Yield the objects at the start and at the end, and dashed at the stops of their joints."""
    first = next((name for name, track in run.objects.tracks.items() if track.stops), None)
    for number, (name, track) in enumerate(run.objects.tracks.items()):
        yield from _drawn(name, track.outlines(0.0), "", 0.4, legend=number == 0)
        if stops := track.at_stops():
            [dashes] = _drawn(f"{name} at a stop", stops, "", 1.0)
            line = {"color": _EDGE, "width": 1.0, "dash": "3px,3px"}
            dashes |= {"name": "at a stop", "legendgroup": "at a stop", "line": line}
            yield dashes | {"fill": "none", "showlegend": name == first}
        yield from _drawn(name, track.outlines(run.end), name, 1.0)


def objects_over_time(
    run: RecordedRun, moments: Sequence[float], moved: float
) -> Iterator[dict[str, Any]]:
    """Yield the objects at the start and, later ones darker, at those of these moments (s) at which
    their extent has changed by `moved` metres."""
    for number, (name, track) in enumerate(run.objects.tracks.items()):
        shown = track.outlines(0.0)
        yield from _drawn(name, shown, "0", 0.3, legend=number == 0)
        for at in moments:
            now = track.outlines(at)
            if max(abs(a - b) for a, b in zip(around(now), around(shown), strict=True)) > moved:
                yield from _drawn(name, now, f"{at:.0f}", 0.3 + 0.7 * at / run.end)
                shown = now


def _drawn(
    name: str, outlines: list[Array], text: str, opacity: float, *, legend: bool = False
) -> Iterator[dict[str, Any]]:
    """Yield the trace of an object's outlines, and a text below them."""
    xs: list[float | None] = []
    ys: list[float | None] = []
    for outline in outlines:
        xs += [*outline[:, 0].tolist(), float(outline[0, 0]), None]
        ys += [*outline[:, 1].tolist(), float(outline[0, 1]), None]
    yield {
        "type": "scatter", "mode": "lines", "name": "object", "legendgroup": "object",
        "showlegend": legend, "x": xs, "y": ys, "opacity": opacity, "fill": "toself",
        "fillcolor": _FILL, "line": {"color": _EDGE, "width": 1.2},
        "hovertemplate": f"object {name}<br>%{{x:.3f}}, %{{y:.3f}} m<extra></extra>",
    }  # fmt: skip
    if text:
        x0, y0, x1, _ = around(outlines)
        yield {
            "type": "scatter", "mode": "text", "name": name, "x": [0.5 * (x0 + x1)], "y": [y0],
            "text": [text], "textposition": "bottom center", "hoverinfo": "skip",
            "textfont": {"color": "ink", "size": 10}, "showlegend": False,
        }  # fmt: skip


def coordinate_figures(run: RecordedRun) -> Iterator[plot.Figure]:
    """Yield a figure of each coordinate of each object, with its goals."""
    for name, track in run.objects.tracks.items():
        yield from (_coordinate(run, name, track, one) for one in track.coordinates)


def _coordinate(run: RecordedRun, name: str, track: ObjectTrack, coordinate: str) -> plot.Figure:
    factor, unit = (1.0 / DEG, "deg") if coordinate in ("angle", "yaw") else (1.0, "m")
    told = [event for event in run.events if event["fields"].get("object") == name]
    begins = [event["t_s"] for event in told if event["event"] == "object_lost"]
    ends = [*(event["t_s"] for event in told if event["event"] == "object_found"), run.end]
    goals = {text: value * factor for text, value in track.goals.get(coordinate, {}).items()}
    traces, shown = list[dict[str, Any]](), [*goals.values()]
    for known, motion in track.motions.items():
        time, values = motion.time, motion.coordinate(coordinate) * factor
        shown += [float(values.min()), float(values.max())]
        if known == "seen":  # no line where it was not seen
            gaps = np.searchsorted(time, begins)
            time, values = np.insert(time, gaps, begins), np.insert(values, gaps, np.nan)
        label, colour, width = _CURVES[known]
        hover = f"%{{y:.{1 if unit == 'deg' else 3}f}} {unit}"
        traces.append(plot.line(label, time, values, colour, width, hover=hover))
    traces += [plot.level(run, text, value, "6px,4px") for text, value in goals.items()]
    middle = 0.5 * (min(shown) + max(shown))
    half = max(0.55 * (max(shown) - min(shown)), _LEAST[unit])
    layout = plot.over_time(run, f"{_AXES.get(coordinate, coordinate)} ({unit})", "normal")
    layout["yaxis"]["range"] = [middle - half, middle + half]
    lost = zip(begins, ends, strict=False)
    layout |= plot.bands(("not seen", begin, end, TINTS[BLIND], {}) for begin, end in lost)
    layout["height"] = 240
    return plot.Figure(f"object_{name}_{coordinate}", f"{name}: {coordinate}", "", traces, layout)


def contact_figures(run: RecordedRun) -> Iterator[plot.Figure]:
    """Yield the figure of who touches which object when, and how hard, if any was touched."""
    known, colours = run.objects, {track.name: colour for track, colour in plot.coloured(run)}
    traces: list[dict[str, Any]] = []
    dashes = {name: cycle(("solid", "dot", "dash", "dashdot")) for name in colours}
    for (vehicle, path), force in known.forces.items():
        label, colour = f"{vehicle} on {path}", colours[vehicle]
        curve = plot.line(label, known.time, force, colour, 1.6, hover="%{y:.3f} N")
        curve["line"]["dash"] = next(dashes[vehicle])
        traces.append(curve)
    for name, symbol in (("began", "triangle-right"), ("ended", "triangle-left-open")):
        told = [event for event in run.events if event["event"] == f"contact_{name}"]
        marker = {"symbol": symbol, "size": 9, "color": [colours[e["vehicle"]] for e in told]}
        times, texts = [e["t_s"] for e in told], [f"{e['vehicle']}, {fields_text(e)}" for e in told]
        if told:
            dots = plot.markers(name, times, [0.0] * len(told), marker, "%{text}", text=texts)
            traces.append(dots | {"cliponaxis": False})
    note = "The force with which a vehicle presses a surface, by the simulator's truth."
    note = note if known.forces else "Nobody measures forces."
    layout = plot.over_time(run, "force (N)", "tozero")
    if known.touched:
        note += " The bars are the contacts that conditions read, inferred from poses and tilt."
        layout["yaxis"]["domain"] = [0.16, 1.0]
        layout["xaxis"] |= {"anchor": "free", "position": 0.0}
        rows = [-len(known.touched) - 0.5, -0.5]
        layout["yaxis2"] = {"domain": [0.0, 0.12], "range": rows, "visible": False}
    for row, ((vehicle, name), touched) in enumerate(known.touched.items(), start=1):
        label = f"{vehicle} on {name}, inferred"
        bar = plot.line(label, known.time, -row * touched, colours[vehicle], 5.0)
        traces.append(bar | {"opacity": 0.5, "yaxis": "y2"})
    if traces:
        yield plot.Figure("contacts", "Contacts", note, traces, layout)
