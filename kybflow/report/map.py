"""The figure of where the vehicles flew, from above, with what stands in the room."""

from __future__ import annotations

from typing import Any

import numpy as np

from kybflow.report.data import Run, Track
from kybflow.report.plot import Figure, coloured, dashed, line
from kybflow.report.room import Extent, fence, outline, room, things
from kybflow.world.shapes import Plane

_NEAR = 3.0
"""Metres around the path within which the room is always drawn; beyond, a long path takes more of
it in."""


def path_map(run: Run) -> Figure:
    """Paths over the fence, the obstacles and the named points."""
    standing = things(run)
    path = _path_extent(run)
    near = path.grown(max(_NEAR, 1.5 * path.span))
    shown = {name: extent for name, extent in standing.items() if near.covers(extent)}
    window = _around([path, *shown.values()])
    window = window.grown(max(0.25, 0.06 * window.span))
    traces = [*room(run, window), *_paths(run), _starts(run), *_parcels(run), *_collisions(run)]
    width, height = window.x1 - window.x0, window.y1 - window.y0
    layout = {
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
        "shapes": fence(run),
        "height": round(min(680.0, max(400.0, 900.0 * height / width))),
        "hovermode": "closest",
    }
    note = _note(run, [name for name in standing if name not in shown])
    return Figure("path", "Path from above", note, traces, layout, over_time=False)


def _paths(run: Run) -> list[dict[str, Any]]:
    traces = []
    for track, colour in coloured(run):
        x, y = track.position[:, 0], track.position[:, 1]
        traces.append(line(track.name, x, y, colour, 3.0, hover="%{x:.3f}, %{y:.3f} m"))
    for number, track in enumerate(run.tracks):
        x, y = track.reference[:, 0], track.reference[:, 1]
        traces.append(dashed("reference", x, y, number == 0))
    return traces


def _starts(run: Run) -> dict[str, Any]:
    starts = [track.start for track in run.tracks]
    return {
        "type": "scatter",
        "mode": "markers",
        "name": "start",
        "x": [start[0] for start in starts],
        "y": [start[1] for start in starts],
        "marker": {"symbol": "circle-open", "size": 10, "color": "ink", "line": {"width": 2}},
        "hovertemplate": "start %{x:.2f}, %{y:.2f} m<extra></extra>",
    }


def _parcels(run: Run) -> list[dict[str, Any]]:
    """A square where each payload came to rest, as the simulator knows it."""
    drops = [e for e in run.events if e["event"] == "payload_rested"]
    if not drops:
        return []
    return [
        {
            "type": "scatter",
            "mode": "markers",
            "name": "payload",
            "x": [e["fields"]["x"] for e in drops],
            "y": [e["fields"]["y"] for e in drops],
            "text": [f"the payload of {e['vehicle']}" for e in drops],
            "marker": {"symbol": "square", "size": 10, "color": "ink"},
            "hovertemplate": "%{text} at %{x:.3f}, %{y:.3f} m<extra></extra>",
        }
    ]


def _collisions(run: Run) -> list[dict[str, Any]]:
    """A cross where each vehicle was when it ran into something."""
    tracks = {track.name: track for track in run.tracks if len(track.time)}
    hits = [e for e in run.events if e["event"] == "collided" and e["vehicle"] in tracks]
    if not hits:
        return []
    places = [_place(tracks[e["vehicle"]], e["t_s"]) for e in hits]
    texts = [f"{e['vehicle']} ran into {e['fields'].get('into')}" for e in hits]
    return [
        {
            "type": "scatter",
            "mode": "markers",
            "name": "collision",
            "x": [place[0] for place in places],
            "y": [place[1] for place in places],
            "text": texts,
            "marker": {"symbol": "x", "size": 13, "color": "alarm"},
            "hovertemplate": "%{text}<extra></extra>",
        }
    ]


def _place(track: Track, time: float) -> tuple[float, float]:
    known = np.flatnonzero(~np.isnan(track.position[:, 0]))
    if not len(known):
        return track.start[0], track.start[1]
    nearest = known[np.argmin(np.abs(track.time[known] - time))]
    return float(track.position[nearest, 0]), float(track.position[nearest, 1])


def _path_extent(run: Run) -> Extent:
    points = np.concatenate([t.position[:, :2] for t in run.tracks])
    points = np.concatenate([points, [t.start[:2] for t in run.tracks]])
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    return Extent(float(low[0]), float(low[1]), float(high[0]), float(high[1]))


def _around(extents: list[Extent]) -> Extent:
    x0, y0, x1, y1 = zip(*extents, strict=True)
    return Extent(min(x0), min(y0), max(x1), max(y1))


def _note(run: Run, outside: list[str]) -> str:
    parts = ["Flown path against the reference that the tracker followed."]
    level = [
        name
        for name, shape in run.world.obstacles.items()
        if isinstance(shape, Plane) and not outline(shape, Extent(0.0, 0.0, 1.0, 1.0))[0]
    ]
    if level:
        parts.append(f"Level, so not drawn: {', '.join(level)}.")
    if outside:
        parts.append(f"Farther away than this map reaches: {', '.join(outside)}.")
    return " ".join(parts)
