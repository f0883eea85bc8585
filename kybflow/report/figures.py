"""Makes all figures of a report in order, and the curves over time: inputs, errors, heights and
batteries."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from itertools import combinations, pairwise
from math import dist
from typing import Any

import numpy as np

from kybflow.core.errors import UnitError
from kybflow.core.signals import NS
from kybflow.core.units import LENGTH, parse_quantity
from kybflow.inputs.rows import InputRow, InputRows
from kybflow.recording.appearance import VEHICLE_COLOURS, vehicle_colour
from kybflow.report import plot
from kybflow.report.data import RecordedRun, Track
from kybflow.report.estimators import Array, norm
from kybflow.report.events import FAULT, TINTS, shaded
from kybflow.report.map import moving_ball, path_map, room, seen_from_above, shown
from kybflow.report.object_figures import contact_figures, coordinate_figures, objects_over_time
from kybflow.report.timeline import timeline

_MOST_PAIRS = 28
"""The most pairs that get a line each. If there are more, each vehicle gets a line with the
distance to its nearest one."""
_MOST_NAMED = 15
"""The most lines in the legend. If there are more, the names are only in the hover labels."""
_MOMENTS = 9
"""The number of moments in the figure from above."""
_MOVED = 0.05
"""The share of this figure by which an object moves between two of them."""
_BOUND = re.compile(r"\bseparation\([^)]*\)\s*>=?\s*([^()]+?)(?: and | or | for |$)")


def swarm_figures(run: RecordedRun) -> list[plot.Figure]:
    """Return the figures of several vehicles, or of one vehicle and moving obstacles."""
    if run.objects.tracks:  # a vehicle that pushes flies without a setpoint of position
        errors = [np.fmin(track.position_error, track.velocity_error) for track in run.tracks]
        tracks = zip(run.tracks, errors, strict=True)
        run = replace(run, tracks=tuple(replace(t, position_error=error) for t, error in tracks))
    flown = [track for track in run.tracks if len(track.time)]
    moves = len(flown) > 1 or (flown and (run.moving or run.objects.tracks))
    above = [_from_above(run)] if moves else []
    return [*above, _distances(run, flown)] if len(flown) > 1 else above


def _distances(run: RecordedRun, tracks: list[Track]) -> plot.Figure:
    """Draw the distance of each pair while both fly, with the bounds of supervisors and
    expectations."""
    pairs = list(combinations(tracks, 2))
    if len(pairs) <= _MOST_PAIRS:
        curves = [(f"{a.name} and {b.name}", a.time, _between(a, b)) for a, b in pairs]
        note = "Between the centres of two vehicles while both are in the air."
    else:
        curves = [(a.name, a.time, _to_nearest(a, tracks)) for a in tracks]
        note = "From each vehicle to the nearest one, while both are in the air."
    traces = [
        plot.line(name, time, gap, vehicle_colour(n), 1.6, hover="%{y:.3f} m")
        for n, (name, time, gap) in enumerate(curves)
    ]
    if len(traces) > _MOST_NAMED:
        traces = [{**trace, "showlegend": False} for trace in traces]
    if alarms := alarm_distances(run):
        traces += [plot.level(run, f"alarm below {at:g} m", at, "2px,3px") for at in alarms]
        note += " A supervisor alarms below a dotted line, and sooner for vehicles that approach."
    expected = least_separation(run)
    if expected is not None:
        name = f"expected above {round(expected, 3):g} m"
        traces.append(plot.level(run, name, expected, "6px,4px"))
        note += " The dashed line is the least that an expectation allows."
    return plot.Figure(
        "distances", "Distances", note, traces, plot.over_time(run, "distance (m)", "tozero")
    )


def alarm_distances(run: RecordedRun) -> list[float]:
    """Return the distances below which supervisors alarm, as at the start of the run; metres,
    without duplicates and zeros."""
    vehicles = run.mission.get("vehicles", {}).values()
    kept = (bound for facts in vehicles for bound in facts.get("keeps_apart", {}).values())
    return sorted({round(bound, 3) for bound in kept if bound > 0.0})


def least_separation(run: RecordedRun) -> float | None:
    """Return the largest separation that an expectation requires, metres; None if none does."""
    found = []
    for expectation in run.summary.get("expectations", ()):
        for bound in _BOUND.findall(expectation["text"]):
            try:
                found.append(parse_quantity(bound, LENGTH))
            except UnitError:
                continue  # the bound is another expression
    return max(found, default=None)


def _between(a: Track, b: Track) -> Array:
    """Return the distance of two vehicles at the times of `a`, m; NaN where one doesn't fly."""
    here, there = _aloft(a), _at(b, a.time)
    return norm(here - there)


def _to_nearest(a: Track, tracks: list[Track]) -> Array:
    gaps = np.array([_between(a, b) for b in tracks if b is not a])
    known = np.where(np.isnan(gaps), np.inf, gaps).min(axis=0)
    return np.where(np.isinf(known), np.nan, known)


def _aloft(track: Track) -> Array:
    """Return a vehicle's positions (n, 3), NaN where it doesn't fly."""
    flies = ~np.isnan(track.position_error)
    return np.where(flies[:, None], track.position, np.nan)


def _at(track: Track, times: Array) -> Array:
    """Return a vehicle's positions at these times, NaN where it doesn't fly."""
    places = _aloft(track)
    index = np.clip(np.searchsorted(track.time, times), 0, len(track.time) - 1)
    return places[index]


def _from_above(run: RecordedRun) -> plot.Figure:
    """Draw the paths from above, with the moving obstacles and flying vehicles at several
    moments."""
    window, objects = shown(run)[0], run.objects.tracks.values()
    if objects:
        ways = [track.position[:, :2] for track in run.tracks]
        ways += [way for track in objects for at in (0.0, run.end) for way in track.outlines(at)]
        window = plot.around(ways)
        window = window.grown(max(0.25, 0.06 * window.span))
    traces = room(run, window)
    for track, colour in plot.coloured(run):
        way = plot.line(track.name, track.position[:, 0], track.position[:, 1], colour, 1.2)
        traces.append({**way, "opacity": 0.5})
    moments = np.linspace(0.0, run.end, _MOMENTS + 2)[1:-1]
    traces += objects_over_time(run, moments.tolist(), _MOVED * window.span)
    labelled: list[tuple[float, float]] = []
    for moment in moments:
        at = float(moment)
        for name in run.moving:
            traces += moving_ball(run, name, at, f"{at:.0f}")
        dots = _moment(run, at)
        for dot in dots[1:] if objects else ():  # labels at one place would cover each other
            place = (dot["x"][0], dot["y"][0])
            near = sum(dist(place, other) < _MOVED * window.span for other in labelled)
            dot["textposition"] = "bottom center" if near else "top center"
            dot["text"] = dot["text"] if near < 2 else None
            labelled.append(place)
        traces += dots
    note = f"The vehicles in the air at {_MOMENTS} moments, with the seconds. Lines join vehicles"
    note += " in one state whose behavior uses the positions of the others."
    if objects:
        note += " Objects are drawn where they were at these moments, if they had moved."
    layout = seen_from_above(run, window)
    return plot.Figure("from_above", "From above over time", note, traces, layout, over_time=False)


def _moment(run: RecordedRun, moment: float) -> list[dict[str, Any]]:
    """Draw a dot for each vehicle that flies at `moment` (s), and lines between vehicles in the
    same state if its behavior uses the others' published data."""
    places = {}
    for track, colour in plot.coloured(run):
        here = _at(track, np.array([moment]))[0] if len(track.time) else np.full(3, np.nan)
        if not np.isnan(here[0]):
            visit = next((v for v in track.visits if v.start <= moment < v.end), None)
            joins = visit.name if visit is not None and visit.hears else ""
            places[track.name] = (float(here[0]), float(here[1]), float(here[2]), colour, joins)
    if not places:
        return []
    edges: list[float] = []
    sides: list[float] = []
    for a, b in combinations(places.values(), 2) if len(places) <= len(VEHICLE_COLOURS) else ():
        if a[4] == b[4] != "":
            edges += [a[0], b[0], np.nan]
            sides += [a[1], b[1], np.nan]
    joined = plot.line("", np.array(edges), np.array(sides), "soft", 0.7)
    dots = plot.markers(
        "in the air",
        [p[0] for p in places.values()],
        [p[1] for p in places.values()],
        {"size": 9, "color": [p[3] for p in places.values()]},
        f"%{{customdata[0]}} at {moment:.1f} s, %{{customdata[1]:.2f}} m high",
        mode="markers+text",
        text=[f"{moment:.0f}", *[""] * (len(places) - 1)],
        textposition="top center",
        textfont={"size": 10, "color": "ink"},
        customdata=[[name, p[2]] for name, p in places.items()],
        showlegend=False,
    )
    return [{**joined, "showlegend": False}, dots]


_BELOW = "The setpoint of a landing goes below the ground; the vehicle stops at touchdown."


def figures(run: RecordedRun) -> list[plot.Figure]:
    """Return the figures in the order of the page; none if no tick was recorded."""
    if not any(len(track.time) for track in run.tracks):
        return []
    return [
        path_map(run),
        timeline(run),
        *swarm_figures(run),
        *coordinate_figures(run),
        *contact_figures(run),
        *(_input(name, rows, run) for name, rows in run.inputs.items()),
        _errors(run, "position", "m"),
        _errors(run, "velocity", "m/s"),
        _to_target(run),
        _height(run),
        _battery(run),
    ]


def _input(name: str, recorded: InputRows, run: RecordedRun) -> plot.Figure:
    """Draw the axes of an input, with bands while it was lost."""
    times = [*(row.time / NS for row in recorded.rows), run.end]
    time = np.repeat(times, 2)[1:-1]  # each row is valid until the time of the next
    traces = []
    for number, axis in enumerate(recorded.axes):
        values = np.repeat([row.axes.get(axis, np.nan) for row in recorded.rows], 2)
        colour = vehicle_colour(number)
        traces.append(plot.line(axis, time, values, colour, 1.6, hover="%{y:.2f}"))
    layout = plot.over_time(run, "deflection", "normal")
    layout["yaxis"]["range"] = [-1.05, 1.05]
    lost = []
    for row, until in zip(recorded.rows, times[1:], strict=True):
        if row.lost and row.time / NS < until:
            font = {"size": 10, "color": "ink"}
            label = {"label": {"text": row.lost, "textposition": "top left", "font": font}}
            lost.append(("lost", row.time / NS, until, TINTS[FAULT], label))
    layout |= plot.bands(lost)
    pressed = [
        f"{button} at {row.time / NS:.2f} s"
        for before, row in pairwise((InputRow(0, {}), *recorded.rows))
        for button in sorted(row.held - before.held)
    ]
    note = f"After dead zones and calibration. Buttons: {', '.join(pressed) or 'none was pressed'}."
    return plot.Figure(f"input_{name}", f"Input {name}", note, traces, layout)


def _errors(run: RecordedRun, what: str, unit: str) -> plot.Figure:
    curves = [(track.name, track, colour) for track, colour in plot.coloured(run)]
    traces, layout, fits = error_curves(run, curves, what, unit)
    known = "true" if run.simulated else "estimated"
    note = f"In the air, between the behavior's setpoint and the {known} {what}."
    if fits:
        note += " The axis fits behaviors that stay in the air; double-click for the full range."
    layout |= plot.shade(shaded(run), len(run.tracks) > 1)
    return plot.Figure(f"{what}_error", f"{what.capitalize()} error", note, traces, layout)


def error_curves(
    run: RecordedRun, curves: Iterable[tuple[str, Track, str]], what: str, unit: str
) -> tuple[list[dict[str, Any]], dict[str, Any], bool]:
    """Return the errors over the time of `run` as traces, their layout, and whether its axis fits
    the behaviors that stay in the air. curves: the name, the track and the colour of each."""
    traces, highest = [], 0.0
    hover = f"%{{y:.2f}} c{unit}"
    for name, track, colour in curves:
        errors = track.position_error if what == "position" else track.velocity_error
        traces.append(plot.line(name, track.time, 100.0 * errors, colour, 1.6, hover=hover))
        highest = max(highest, _highest_aloft(track, errors))
    layout = plot.over_time(run, f"{what} error (c{unit})", "tozero")
    if highest > 0.0:
        layout["yaxis"]["range"] = [0.0, 115.0 * highest]
    return traces, layout, highest > 0.0


def _highest_aloft(track: Track, errors: Array) -> float:
    """Return the largest error in behaviors that neither take off nor land; 0 if there are none."""
    aloft = np.zeros(len(track.time), bool)
    for visit in track.visits:
        if visit.aloft:
            aloft |= (track.time >= visit.start) & (track.time < visit.end)
    found = errors[aloft & ~np.isnan(errors)]
    return float(found.max()) if len(found) else 0.0


def _to_target(run: RecordedRun) -> plot.Figure:
    traces = [
        plot.line(track.name, track.time, track.to_target, colour, 1.6, hover="%{y:.3f} m")
        for track, colour in plot.coloured(run)
    ]
    note = "From the vehicle to the last setpoint of its behavior at that time."
    layout = plot.over_time(run, "distance (m)", "tozero")
    return plot.Figure("to_target", "Distance to target", note, traces, layout)


def _height(run: RecordedRun) -> plot.Figure:
    traces = [
        plot.line(track.name, track.time, track.position[:, 2], colour, 2.2, hover="%{y:.3f} m")
        for track, colour in plot.coloured(run)
    ]
    traces += [
        plot.dashed("reference", track.time, track.reference[:, 2], number == 0)
        for number, track in enumerate(run.tracks)
    ]
    below = any((track.reference[:, 2] < track.start[2] - 0.01).any() for track in run.tracks)
    note = _BELOW if below else ""
    return plot.Figure("height", "Height", note, traces, plot.over_time(run, "z, up (m)", "tozero"))


def _battery(run: RecordedRun) -> plot.Figure:
    traces = [
        plot.line(
            track.name, track.battery_time, track.battery * 100.0, colour, 1.8, hover="%{y:.1f} %"
        )
        for track, colour in plot.coloured(run)
    ]
    layout = plot.over_time(run, "remaining (%)", "normal")
    return plot.Figure("battery", "Battery", "", traces, layout)
