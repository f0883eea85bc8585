"""Writes the page that compares runs: their facts side by side, their errors in one figure for each
vehicle, and their states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from kybflow.recording.appearance import vehicle_colour
from kybflow.recording.run_folder import write_file
from kybflow.report import plot
from kybflow.report.data import read_run
from kybflow.report.figures import error_curves
from kybflow.report.page import rendered
from kybflow.report.timeline import timeline

Row = tuple[str, str, tuple[str | None, ...]]
"""A fact: its section, its name, and its value in each run."""

_SECTIONS = {
    "run": "Runs",
    "expectation": "Expectations",
    "error": "Position errors by behavior",
    "events": "Events",
    "parameter": "Parameters that differ",
    "code": "Code",
}


def write_comparison(out: Path, folders: Sequence[Path], rows: Sequence[Row]) -> None:
    """Write the page about the runs in `folders` to `out`. rows: of each section of `_SECTIONS`.
    Raises RunFolderError, RunUnwritten."""
    runs = [read_run(folder) for folder in folders]
    names = [folder.name for folder in folders]
    longest = max(runs, key=lambda run: run.end)
    figures = []
    for vehicle in dict.fromkeys(track.name for run in runs for track in run.tracks):
        curves = [
            (name, track, vehicle_colour(n))
            for n, (name, run) in enumerate(zip(names, runs, strict=True))
            for track in run.tracks
            if track.name == vehicle
        ]
        traces, layout, _ = error_curves(longest, curves, "position", "m")
        title = f"Position error of {vehicle}"
        figures.append(plot.Figure(f"error_{vehicle}", title, "", traces, layout))
    for n, (name, run) in enumerate(zip(names, runs, strict=True)):
        drawn = timeline(run)
        layout = drawn.layout | {"xaxis": plot.time_axis(longest)}
        title = f"{drawn.title} of {name}"
        figures.append(replace(drawn, name=f"states_{n}", title=title, note="", layout=layout))
    sections = [
        (title, own, section in ("expectation", "parameter", "code"))
        for section, title in _SECTIONS.items()
        if (own := [row for row in rows if row[0] == section])
    ]
    page = rendered("comparison.html", figures, names=names, sections=sections, figures=figures)
    write_file(out, page)
