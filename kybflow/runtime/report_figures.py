"""The figures of a report: where the vehicles flew, and how far from where they should have."""

from __future__ import annotations

from typing import Any

import numpy as np

from kybflow.runtime.report_data import Run, Track
from kybflow.runtime.report_plot import Figure, dashed, line, over_time
from kybflow.runtime.report_timeline import timeline

VEHICLES = ("#2f7ed8", "#e07b26", "#1f9e77", "#a55ec4", "#d1495b", "#7a8b1f", "#00a3b5", "#c2578f")


def figures(run: Run) -> list[Figure]:
    """Every figure, in the order of the page; without a recorded tick there is none."""
    if not any(len(track.time) for track in run.tracks):
        return []
    return [
        _path(run),
        timeline(run),
        _errors(run, "position", "m"),
        _errors(run, "velocity", "m/s"),
        _to_target(run),
        _height(run),
        _battery(run),
    ]


def _path(run: Run) -> Figure:
    traces: list[dict[str, Any]] = []
    for track, colour in _coloured(run):
        x, y = track.position[:, 0], track.position[:, 1]
        traces.append(line(track.name, x, y, colour, 3.0, hover="%{x:.3f}, %{y:.3f} m"))
    for number, track in enumerate(run.tracks):
        x, y = track.reference[:, 0], track.reference[:, 1]
        traces.append(dashed("reference", x, y, number == 0))
    traces.append(_starts(run))
    x_range, y_range = _extent(run)
    layout = {
        "xaxis": {"title": {"text": "x, east (m)"}, "range": x_range, "constrain": "domain"},
        "yaxis": {
            "title": {"text": "y, north (m)"},
            "range": y_range,
            "scaleanchor": "x",
            "constrain": "domain",
        },
        "shapes": _fence(run),
        "height": round(min(640.0, max(360.0, 900.0 * _span(y_range) / _span(x_range)))),
        "hovermode": "closest",
    }
    note = "Flown path against the reference that the tracker followed; dotted: the fence."
    return Figure("path", "Path from above", note, traces, layout, over_time=False)


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


def _errors(run: Run, what: str, unit: str) -> Figure:
    traces = []
    for track, colour in _coloured(run):
        values = (track.position_error if what == "position" else track.velocity_error) * 100.0
        hover = f"%{{y:.2f}} c{unit}"
        traces.append(line(track.name, track.time, values, colour, 1.6, hover=hover))
    note = f"Between the setpoint before tracking and the {_known(run)} {what}."
    layout = over_time(run, f"{what} error (c{unit})", "tozero")
    highest = max((_highest_aloft(track, what) for track in run.tracks), default=0.0)
    if highest > 0.0:
        layout["yaxis"]["range"] = [0.0, 115.0 * highest]
        note += " Scaled to the behaviors that stay in the air; double-click for all of it."
    return Figure(f"{what}_error", f"{what.capitalize()} error", note, traces, layout)


def _highest_aloft(track: Track, what: str) -> float:
    """The largest error in behaviors that neither take off nor land, SI; 0 without any."""
    errors = track.position_error if what == "position" else track.velocity_error
    aloft = np.zeros(len(track.time), bool)
    for visit in track.visits:
        if visit.aloft:
            aloft |= (track.time >= visit.start) & (track.time < visit.end)
    found = errors[aloft & ~np.isnan(errors)]
    return float(found.max()) if len(found) else 0.0


def _to_target(run: Run) -> Figure:
    traces = [
        line(track.name, track.time, track.to_target, colour, 1.6, hover="%{y:.3f} m")
        for track, colour in _coloured(run)
    ]
    note = "From the vehicle to the last setpoint of the behavior that it was in."
    layout = over_time(run, "distance (m)", "tozero")
    return Figure("to_target", "Distance to target", note, traces, layout)


def _height(run: Run) -> Figure:
    traces = [
        line(track.name, track.time, track.position[:, 2], colour, 2.2, hover="%{y:.3f} m")
        for track, colour in _coloured(run)
    ]
    traces += [
        dashed("reference", track.time, track.reference[:, 2], number == 0)
        for number, track in enumerate(run.tracks)
    ]
    return Figure("height", "Height", "", traces, over_time(run, "z, up (m)", "tozero"))


def _battery(run: Run) -> Figure:
    traces = [
        line(track.name, track.battery_time, track.battery * 100.0, colour, 1.8, hover="%{y:.1f} %")
        for track, colour in _coloured(run)
    ]
    layout = over_time(run, "remaining (%)", "normal")
    return Figure("battery", "Battery", "", traces, layout)


def _coloured(run: Run) -> list[tuple[Track, str]]:
    return [(track, VEHICLES[n % len(VEHICLES)]) for n, track in enumerate(run.tracks)]


def _known(run: Run) -> str:
    return "estimated" if run.mission.get("simulated") is False else "true"


def _extent(run: Run) -> tuple[list[float], list[float]]:
    points = np.concatenate([t.position[:, :2] for t in run.tracks])
    points = np.concatenate([points, [t.start[:2] for t in run.tracks]])
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    margin = max(0.25, 0.12 * float((high - low).max()))
    x, y = ([float(low[i]) - margin, float(high[i]) + margin] for i in (0, 1))
    return x, y


def _span(bounds: list[float]) -> float:
    return bounds[1] - bounds[0]


def _fence(run: Run) -> list[dict[str, Any]]:
    fence = run.mission.get("fence")
    if not fence:
        return []
    low, high = fence
    return [
        {
            "type": "rect",
            "x0": low[0],
            "y0": low[1],
            "x1": high[0],
            "y1": high[1],
            "line": {"color": "alarm", "width": 1.2, "dash": "dot"},
        }
    ]
