"""The figures of a report: where the vehicles flew, and how far from where they should have."""

from __future__ import annotations

import numpy as np

from kybflow.report.data import Run, Track
from kybflow.report.inputs import input_figures
from kybflow.report.intervals import shaded
from kybflow.report.map import path_map
from kybflow.report.plot import Figure, coloured, dashed, line, over_time, shade
from kybflow.report.swarm import swarm_figures
from kybflow.report.timeline import timeline

_BELOW = (
    "The setpoint of a landing goes on below the ground: where the vehicle no longer follows it, "
    "it has touched down."
)


def figures(run: Run) -> list[Figure]:
    """Every figure, in the order of the page; without a recorded tick there is none."""
    if not any(len(track.time) for track in run.tracks):
        return []
    return [
        path_map(run),
        timeline(run),
        *swarm_figures(run),
        *input_figures(run),
        _errors(run, "position", "m"),
        _errors(run, "velocity", "m/s"),
        _to_target(run),
        _height(run),
        _battery(run),
    ]


def _errors(run: Run, what: str, unit: str) -> Figure:
    traces = []
    for track, colour in coloured(run):
        values = (track.position_error if what == "position" else track.velocity_error) * 100.0
        hover = f"%{{y:.2f}} c{unit}"
        traces.append(line(track.name, track.time, values, colour, 1.6, hover=hover))
    known = "true" if run.simulated else "estimated"
    note = f"In the air, between what the behavior wanted and the {known} {what}."
    layout = over_time(run, f"{what} error (c{unit})", "tozero")
    highest = max((_highest_aloft(track, what) for track in run.tracks), default=0.0)
    if highest > 0.0:
        layout["yaxis"]["range"] = [0.0, 115.0 * highest]
        note += " Scaled to the behaviors that stay in the air; double-click for all of it."
    layout |= shade(shaded(run), len(run.tracks) > 1)
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
        for track, colour in coloured(run)
    ]
    note = "From the vehicle to the last setpoint of the behavior that it was in."
    layout = over_time(run, "distance (m)", "tozero")
    return Figure("to_target", "Distance to target", note, traces, layout)


def _height(run: Run) -> Figure:
    traces = [
        line(track.name, track.time, track.position[:, 2], colour, 2.2, hover="%{y:.3f} m")
        for track, colour in coloured(run)
    ]
    traces += [
        dashed("reference", track.time, track.reference[:, 2], number == 0)
        for number, track in enumerate(run.tracks)
    ]
    note = _BELOW if any(_lands_below(track) for track in run.tracks) else ""
    return Figure("height", "Height", note, traces, over_time(run, "z, up (m)", "tozero"))


def _lands_below(track: Track) -> bool:
    """Whether its reference goes below the ground that it started from."""
    heights = track.reference[:, 2]
    known = heights[~np.isnan(heights)]
    return len(known) > 0 and float(known.min()) < track.start[2] - 0.01


def _battery(run: Run) -> Figure:
    traces = [
        line(track.name, track.battery_time, track.battery * 100.0, colour, 1.8, hover="%{y:.1f} %")
        for track, colour in coloured(run)
    ]
    layout = over_time(run, "remaining (%)", "normal")
    return Figure("battery", "Battery", "", traces, layout)
