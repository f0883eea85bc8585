"""Makes all figures of a report in order, and the curves over time: inputs, errors, heights and
batteries."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from kybflow.core.signals import NS
from kybflow.inputs.rows import InputRow, InputRows
from kybflow.report.data import Run, Track
from kybflow.report.intervals import FAULT, TINTS, shaded
from kybflow.report.map import path_map
from kybflow.report.plot import VEHICLES, Figure, bands, coloured, dashed, line, over_time, shade
from kybflow.report.swarm import swarm_figures
from kybflow.report.timeline import timeline

_BELOW = "The setpoint of a landing goes below the ground; the vehicle stops at touchdown."


def figures(run: Run) -> list[Figure]:
    """Return the figures in the order of the page; none if no tick was recorded."""
    if not any(len(track.time) for track in run.tracks):
        return []
    return [
        path_map(run),
        timeline(run),
        *swarm_figures(run),
        *(_input(name, rows, run) for name, rows in run.inputs.items()),
        _errors(run, "position", "m"),
        _errors(run, "velocity", "m/s"),
        _to_target(run),
        _height(run),
        _battery(run),
    ]


def _input(name: str, recorded: InputRows, run: Run) -> Figure:
    """Draw the axes of an input, with bands while it was lost."""
    times = [*(row.time / NS for row in recorded.rows), run.end]
    time = np.repeat(times, 2)[1:-1]  # each row is valid until the time of the next
    traces = []
    for number, axis in enumerate(recorded.axes):
        values = np.repeat([row.axes.get(axis, np.nan) for row in recorded.rows], 2)
        colour = VEHICLES[number % len(VEHICLES)]
        traces.append(line(axis, time, values, colour, 1.6, hover="%{y:.2f}"))
    layout = over_time(run, "deflection", "normal")
    layout["yaxis"]["range"] = [-1.05, 1.05]
    lost = []
    for row, until in zip(recorded.rows, times[1:], strict=True):
        if row.lost and row.time / NS < until:
            font = {"size": 10, "color": "ink"}
            label = {"label": {"text": row.lost, "textposition": "top left", "font": font}}
            lost.append(("lost", row.time / NS, until, TINTS[FAULT], label))
    layout |= bands(lost)
    pressed = [
        f"{button} at {row.time / NS:.2f} s"
        for before, row in pairwise((InputRow(0, {}), *recorded.rows))
        for button in sorted(row.held - before.held)
    ]
    note = f"After dead zones and calibration. Buttons: {', '.join(pressed) or 'none was pressed'}."
    return Figure(f"input_{name}", f"Input {name}", note, traces, layout)


def _errors(run: Run, what: str, unit: str) -> Figure:
    traces = []
    for track, colour in coloured(run):
        values = (track.position_error if what == "position" else track.velocity_error) * 100.0
        hover = f"%{{y:.2f}} c{unit}"
        traces.append(line(track.name, track.time, values, colour, 1.6, hover=hover))
    known = "true" if run.simulated else "estimated"
    note = f"In the air, between the behavior's setpoint and the {known} {what}."
    layout = over_time(run, f"{what} error (c{unit})", "tozero")
    highest = max((_highest_aloft(track, what) for track in run.tracks), default=0.0)
    if highest > 0.0:
        layout["yaxis"]["range"] = [0.0, 115.0 * highest]
        note += " The axis fits behaviors that stay in the air; double-click for the full range."
    layout |= shade(shaded(run), len(run.tracks) > 1)
    return Figure(f"{what}_error", f"{what.capitalize()} error", note, traces, layout)


def _highest_aloft(track: Track, what: str) -> float:
    """Return the largest error in behaviors that neither take off nor land, in SI units; 0 if there
    are none."""
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
    note = "From the vehicle to the last setpoint of its behavior at that time."
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
    below = any((track.reference[:, 2] < track.start[2] - 0.01).any() for track in run.tracks)
    note = _BELOW if below else ""
    return Figure("height", "Height", note, traces, over_time(run, "z, up (m)", "tozero"))


def _battery(run: Run) -> Figure:
    traces = [
        line(track.name, track.battery_time, track.battery * 100.0, colour, 1.8, hover="%{y:.1f} %")
        for track, colour in coloured(run)
    ]
    layout = over_time(run, "remaining (%)", "normal")
    return Figure("battery", "Battery", "", traces, layout)
