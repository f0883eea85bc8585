"""The figures of several vehicles: how far from each other they were, and the swarm from above at
moments of the flight."""

from __future__ import annotations

import re
from itertools import combinations
from typing import Any

import numpy as np

from kybflow.core.errors import UnitError
from kybflow.core.units import LENGTH, parse_quantity
from kybflow.report.data import Run, Track
from kybflow.report.estimators import Array, norm
from kybflow.report.plot import VEHICLES, Figure, coloured, line, over_time

_MOST_PAIRS = 28
"""The most pairs with a line each; of more vehicles each has its distance to the nearest."""
_MOMENTS = 9
"""How often the swarm is shown from above."""
_BOUND = re.compile(r"\bseparation\([^)]*\)\s*>=?\s*([^()]+?)(?: and | or | for |$)")


def swarm_figures(run: Run) -> list[Figure]:
    """The figures of a run of several vehicles; of one there are none."""
    flown = [track for track in run.tracks if len(track.time)]
    return [_from_above(run), _distances(run, flown)] if len(flown) > 1 else []


def _distances(run: Run, tracks: list[Track]) -> Figure:
    """The distance of each pair while both fly, and the least that the mission asks for."""
    pairs = list(combinations(tracks, 2))
    if len(pairs) <= _MOST_PAIRS:
        curves = [(f"{a.name} and {b.name}", a.time, _between(a, b)) for a, b in pairs]
        note = "Between the centres of each two vehicles while both are in the air."
    else:
        curves = [(a.name, a.time, _to_nearest(a, tracks)) for a in tracks]
        note = "Of each vehicle to the nearest one, while both are in the air."
    traces = [
        line(name, time, gap, VEHICLES[n % len(VEHICLES)], 1.6, hover="%{y:.3f} m")
        for n, (name, time, gap) in enumerate(curves)
    ]
    bound = least_separation(run)
    if bound is not None:
        ends = np.array([0.0, run.end])
        limit = line("least allowed", ends, np.full(2, bound), "alarm", 1.4)
        limit["line"]["dash"] = "6px,4px"
        traces.append(limit)
        note += " The dashed line is the least that an expectation allows."
    return Figure("distances", "Distances", note, traces, over_time(run, "distance (m)", "tozero"))


def least_separation(run: Run) -> float | None:
    """The largest least separation that an expectation asks for, metres; None where none does."""
    found = []
    for expectation in run.summary.get("expectations", ()):
        for bound in _BOUND.findall(expectation["text"]):
            try:
                found.append(parse_quantity(bound, LENGTH))
            except UnitError:
                continue  # it is another expression
    return max(found, default=None)


def _between(a: Track, b: Track) -> Array:
    """The distance of two vehicles at the times of the first, not-a-number where one rests."""
    here, there = _aloft(a), _at(b, a.time)
    gap: Array = norm(here - there)
    return gap


def _to_nearest(a: Track, tracks: list[Track]) -> Array:
    gaps = np.array([_between(a, b) for b in tracks if b is not a])
    known = np.where(np.isnan(gaps), np.inf, gaps).min(axis=0)
    nearest: Array = np.where(np.isinf(known), np.nan, known)
    return nearest


def _aloft(track: Track) -> Array:
    """Where a vehicle is while it flies."""
    flies = ~np.isnan(track.position_error)
    place: Array = np.where(flies[:, None], track.position, np.nan)
    return place


def _at(track: Track, times: Array) -> Array:
    """Where a vehicle that flies is at these times."""
    places = _aloft(track)
    index = np.clip(np.searchsorted(track.time, times), 0, len(track.time) - 1)
    found: Array = places[index]
    return found


def _from_above(run: Run) -> Figure:
    """The ways from above, and at some moments the vehicles in the air, joined to a figure."""
    traces = [
        {
            **line(track.name, track.position[:, 0], track.position[:, 1], colour, 0.8),
            "opacity": 0.4,
        }
        for track, colour in coloured(run)
    ]
    for moment in np.linspace(0.0, run.end, _MOMENTS + 2)[1:-1]:
        traces += _moment(run, float(moment))
    layout = {
        "xaxis": {"title": {"text": "x, east (m)"}},
        "yaxis": {"title": {"text": "y, north (m)"}, "scaleanchor": "x"},
        "height": 560,
        "hovermode": "closest",
    }
    note = f"Who flies at {_MOMENTS} moments, from above; lines join who is in one state."
    return Figure("from_above", "The swarm from above", note, traces, layout, over_time=False)


def _moment(run: Run, moment: float) -> list[dict[str, Any]]:
    """The vehicles that fly at a moment: a dot each, and lines between those in one state."""
    places = {}
    for track, colour in coloured(run):
        here = _at(track, np.array([moment]))[0] if len(track.time) else np.full(3, np.nan)
        if not np.isnan(here[0]):
            state = next((v.name for v in track.visits if v.start <= moment < v.end), "")
            places[track.name] = (float(here[0]), float(here[1]), float(here[2]), colour, state)
    if not places:
        return []
    edges: list[float] = []
    sides: list[float] = []
    for a, b in combinations(places.values(), 2) if len(places) <= len(VEHICLES) else ():
        if a[4] == b[4]:
            edges += [a[0], b[0], np.nan]
            sides += [a[1], b[1], np.nan]
    joined = line("", np.array(edges), np.array(sides), "soft", 0.7)
    dots = {
        "type": "scatter",
        "mode": "markers+text",
        "x": [p[0] for p in places.values()],
        "y": [p[1] for p in places.values()],
        "text": [f"{moment:.0f}", *[""] * (len(places) - 1)],
        "textposition": "top center",
        "textfont": {"size": 10, "color": "ink"},
        "marker": {"size": 9, "color": [p[3] for p in places.values()]},
        "customdata": [[name, p[2]] for name, p in places.items()],
        "hovertemplate": f"%{{customdata[0]}} at {moment:.1f} s, %{{customdata[1]:.2f}} m high"
        "<extra></extra>",
        "showlegend": False,
    }
    return [{**joined, "showlegend": False}, dots]
