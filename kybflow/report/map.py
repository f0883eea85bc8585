"""The figure of the vehicles' paths from above, with the fence, obstacles and points."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, hypot, pi, sin
from typing import Any

import numpy as np

from kybflow.recording.appearance import IMPACTS
from kybflow.report.data import RecordedRun
from kybflow.report.events import impact_text
from kybflow.report.object_figures import objects_from_above
from kybflow.report.plot import Extent, Figure, around, coloured, dashed, line, markers
from kybflow.world.shapes import Box, Plane, Scanned, Shape, Sphere

_MIN_MARGIN = 3.0
"""Metres around the path that the map always shows; it shows more around a long path."""
_CORNERS = 48
"""The number of corners of a drawn circle."""
_GREY = "#7d8894"


def path_map(run: RecordedRun) -> Figure:
    """Draw the paths over the fence, the obstacles and the named points."""
    window, outside = shown(run)
    x, y = [track.start[0] for track in run.tracks], [track.start[1] for track in run.tracks]
    ring = {"symbol": "circle-open", "size": 10, "color": "ink", "line": {"width": 2}}
    starts = markers("start", x, y, ring, "start %{x:.2f}, %{y:.2f} m")
    traces = [
        *room(run, window), *moving_paths(run), *objects_from_above(run), *_paths(run), starts,
        *_parcels(run), *_collisions(run),
    ]  # fmt: skip
    note = "The flown path and the reference of the tracker."
    obstacles, unit = run.world.obstacles.items(), Extent(0.0, 0.0, 1.0, 1.0)
    if level := [n for n, s in obstacles if isinstance(s, Plane) and not outline(s, unit)[0]]:
        note += f" Not drawn because horizontal: {', '.join(level)}."
    if outside:
        note += f" Outside this map: {', '.join(outside)}."
    layout = seen_from_above(run, window)
    return Figure("path", "Path from above", note, traces, layout, over_time=False)


def seen_from_above(run: RecordedRun, window: Extent) -> dict[str, Any]:
    """Return the layout of a figure from above, with the fence as a dotted rectangle."""
    width, height = window.x1 - window.x0, window.y1 - window.y0
    fence = []
    if run.mission.get("fence"):
        (x0, y0, _), (x1, y1, _) = run.mission["fence"]
        border = {"color": "alarm", "width": 1.5, "dash": "dot"}
        legend = {"name": "fence", "showlegend": True}
        fence = [{"type": "rect", "x0": x0, "y0": y0, "x1": x1, "y1": y1, "line": border, **legend}]
    return {
        "xaxis": {
            "title": {"text": "x, east (m)"},
            "range": [window.x0, window.x1],
            "constrain": "domain",
        },
        "yaxis": {
            "title": {"text": "y, north (m)"},
            "range": [window.y0, window.y1],
            "scaleanchor": "x",
            "constrain": "domain",
        },
        "shapes": fence,
        "height": round(min(680.0, max(400.0, 900.0 * height / width))),
        "hovermode": "closest",
    }


def shown(run: RecordedRun) -> tuple[Extent, list[str]]:
    """Return the extent of the figures from above, and the labels of the objects outside it."""
    standing = _extents(run)
    path = around(
        [*(t.position[:, :2] for t in run.tracks), np.array([t.start[:2] for t in run.tracks])]
    )
    near = path.grown(max(_MIN_MARGIN, 1.5 * path.span))
    within = {name: extent for name, extent in standing.items() if near.covers(extent)}
    x0, y0, x1, y1 = zip(path, *within.values(), strict=True)
    window = Extent(min(x0), min(y0), max(x1), max(y1))
    window = window.grown(max(0.25, 0.06 * window.span))
    return window, [name for name in standing if name not in within]


def _paths(run: RecordedRun) -> list[dict[str, Any]]:
    traces = []
    for track, colour in coloured(run):
        x, y = track.position[:, 0], track.position[:, 1]
        traces.append(line(track.name, x, y, colour, 3.0, hover="%{x:.3f}, %{y:.3f} m"))
    for number, track in enumerate(run.tracks):
        x, y = track.reference[:, 0], track.reference[:, 1]
        traces.append(dashed("reference", x, y, number == 0))
    return traces


def _parcels(run: RecordedRun) -> list[dict[str, Any]]:
    """Draw a square where each payload came to rest, by the simulator's truth."""
    drops = [e for e in run.events if e["event"] == "payload_rested"]
    if not drops:
        return []
    x, y = [e["fields"]["x"] for e in drops], [e["fields"]["y"] for e in drops]
    texts = [f"the payload of {e['vehicle']}" for e in drops]
    square = {"symbol": "square", "size": 10, "color": "ink"}
    return [markers("payload", x, y, square, "%{text} at %{x:.3f}, %{y:.3f} m", text=texts)]


def _collisions(run: RecordedRun) -> list[dict[str, Any]]:
    """Draw a cross where a vehicle ran into something or landed hard."""
    tracks = {track.name: track for track in run.tracks if len(track.time)}
    hits = [e for e in run.events if e["event"] in IMPACTS and e["vehicle"] in tracks]
    if not hits:
        return []
    x, y = list[float](), list[float]()
    for event in hits:
        track = tracks[event["vehicle"]]
        known = np.flatnonzero(~np.isnan(track.position[:, 0]))
        at = track.start
        if len(known):
            at = track.position[known[np.argmin(np.abs(track.time[known] - event["t_s"]))]].tolist()
        x.append(at[0])
        y.append(at[1])
    texts = [f"{e['vehicle']} {impact_text(e)}" for e in hits]
    cross = {"symbol": "x", "size": 13, "color": "alarm"}
    return [markers("collision", x, y, cross, "%{text}", text=texts)]


Coordinates = list[float | None]


def outline(shape: Shape, window: Extent) -> tuple[Coordinates, Coordinates]:
    """Return the outline of an obstacle, seen from above, as x and y coordinates; None separates
    several outlines. A wall is a line across the map's window; a floor or ceiling has no
    outline."""
    if isinstance(shape, Box):
        (x0, y0, _), (x1, y1, _) = shape
        return [x0, x1, x1, x0, x0], [y0, y0, y1, y1, y0]
    if isinstance(shape, Plane):
        (x, y, _), (east, north, _) = shape.at, shape.facing
        across = hypot(east, north)
        if across < 1e-6:
            return [], []
        reach = 4.0 * (window.span + hypot(x - window.x0, y - window.y0))
        ux, uy = -north / across, east / across
        middle = ux * ((window.x0 + window.x1) / 2 - x) + uy * ((window.y0 + window.y1) / 2 - y)
        x, y, along = x + ux * middle, y + uy * middle, (ux * reach, uy * reach)
        return [x - along[0], x, x + along[0]], [y - along[1], y, y + along[1]]
    if isinstance(shape, Scanned):
        return _rows(shape)
    turns = [2.0 * pi * step / _CORNERS for step in range(_CORNERS + 1)]
    x, y, _ = shape.at
    return [x + shape.radius * cos(a) for a in turns], [y + shape.radius * sin(a) for a in turns]


def _rows(cloud: Scanned) -> tuple[Coordinates, Coordinates]:
    """Return the outlines of a point cloud from above: the occupied cells of a grid. A cell is as
    wide as the radius. Neighbouring cells in a row form one rectangle, enlarged by half a radius.
    """
    r = cloud.radius
    cells = np.unique(np.floor(cloud.array[:, :2] / r)[:, ::-1], axis=0)
    begins = np.ones(len(cells), bool)
    begins[1:] = (np.diff(cells[:, 0]) != 0.0) | (np.diff(cells[:, 1]) != 1.0)
    firsts = np.flatnonzero(begins)
    lasts = np.append(firsts[1:], len(cells)) - 1
    xs: Coordinates = []
    ys: Coordinates = []
    for (row, first), last in zip(cells[firsts].tolist(), cells[lasts, 1].tolist(), strict=True):
        x0, x1, y0, y1 = (first - 0.5) * r, (last + 1.5) * r, (row - 0.5) * r, (row + 1.5) * r
        xs += (x0, x1, x1, x0, x0, None)
        ys += (y0, y0, y1, y1, y0, None)
    return xs, ys


def _extents(run: RecordedRun) -> dict[str, Extent]:
    """Return the extents of the fence, the points and the bounded obstacles, by label."""
    found: dict[str, Extent] = {}
    if run.mission.get("fence"):
        low, high = run.mission["fence"]
        found["the fence"] = Extent(low[0], low[1], high[0], high[1])
    for name, (x, y, _) in run.world.points.items():
        found[f"point {name}"] = Extent(x, y, x, y)
    for name, shape in run.world.obstacles.items():
        if not isinstance(shape, Plane):
            xs, ys = map(_known, outline(shape, Extent(0.0, 0.0, 0.0, 0.0)))
            found[f"obstacle {name}"] = Extent(min(xs), min(ys), max(xs), max(ys))
    for name, ball in run.moving.items():
        way = ball.position[:, :2]
        extent = Extent(*way.min(axis=0).tolist(), *way.max(axis=0).tolist())
        found[f"obstacle {name}"] = extent.grown(ball.radius)
    for name, track in run.objects.tracks.items():
        outlines = [*track.outlines(0.0), *track.outlines(run.end)]
        found[f"object {name}"] = around(outlines)
        if stops := track.at_stops():
            found[f"a stop of {name}"] = around(stops)
    return found


def _known(coordinates: Coordinates) -> list[float]:
    return [x for x in coordinates if x is not None]


def moving_paths(run: RecordedRun) -> Iterator[dict[str, Any]]:
    """Yield the paths of the moving obstacles, each with the ball at its first position."""
    for number, (name, ball) in enumerate(run.moving.items()):
        x, y = ball.position[:, 0], ball.position[:, 1]
        hover = f"obstacle {name}<br>%{{x:.3f}}, %{{y:.3f}} m"
        way = line("moving obstacle", x, y, _GREY, 1.5, hover=hover)
        way["line"]["dash"] = "dot"
        yield {**way, "legendgroup": way["name"], "showlegend": number == 0}
        yield from moving_ball(run, name, 0.0, name)


def moving_ball(run: RecordedRun, name: str, moment: float, text: str) -> list[dict[str, Any]]:
    """Return the traces of a moving obstacle at its last known position before `moment` (s), with a
    text inside."""
    ball = run.moving[name]
    seen = max(0, int(np.searchsorted(ball.time, moment, side="right")) - 1)
    x, y, z = map(float, ball.position[seen])
    xs, ys = outline(Sphere((x, y, z), ball.radius), Extent(x, y, x, y))
    inside = {"type": "scatter", "mode": "text", "x": [x], "y": [y], "text": [text]}
    style = {"textfont": {"color": "ink", "size": 10}, "hoverinfo": "skip", "showlegend": False}
    return [_obstacle(name, xs, ys, first=False), {**inside, **style, "name": name}]


def room(run: RecordedRun, window: Extent) -> list[dict[str, Any]]:
    """Return the traces of obstacles and points. Points at the same position share a label; a point
    with the name of an obstacle has none."""
    traces = []
    for number, (name, shape) in enumerate(run.world.obstacles.items()):
        xs, ys = outline(shape, window)
        if xs:
            is_wall = isinstance(shape, Plane)
            drawn = _obstacle(name, xs, ys, first=number == 0, is_wall=is_wall)
            lowest = 1 if is_wall else ys.index(min(_known(ys)))
            text = [name if place == lowest else "" for place in range(len(ys))]
            style = {"textposition": "bottom center", "textfont": {"color": "ink", "size": 11}}
            traces.append({**drawn, **style, "mode": "lines+text", "text": text})
    places: dict[tuple[float, float], list[str]] = {}
    for name, (x, y, _) in run.world.points.items():
        places.setdefault((x, y), []).append(name)
    if places:
        named, obstacles = places.values(), run.world.obstacles
        traces.append(
            markers(
                "named point",
                [x for x, _ in places],
                [y for _, y in places],
                {"symbol": "cross-thin-open", "size": 8, "color": "soft"},
                "%{customdata}<br>%{x:.3f}, %{y:.3f} m",
                mode="markers+text",
                text=[", ".join(n for n in names if n not in obstacles) for names in named],
                customdata=[", ".join(names) for names in named],
                textposition="top right",
                textfont={"color": "soft", "size": 11},
            )
        )
    return traces


def _obstacle(
    name: str, xs: Coordinates, ys: Coordinates, *, first: bool, is_wall: bool = False
) -> dict[str, Any]:
    trace = {
        "type": "scatter",
        "mode": "lines",
        "name": "obstacle",
        "legendgroup": "obstacle",
        "showlegend": first,
        "x": xs,
        "y": ys,
        "line": {"color": _GREY, "width": 3.0 if is_wall else 1.5},
        "hovertemplate": f"obstacle {name}<br>%{{x:.3f}}, %{{y:.3f}} m<extra></extra>",
    }
    return trace if is_wall else {**trace, "fill": "toself", "fillcolor": "rgba(125,136,148,0.3)"}
