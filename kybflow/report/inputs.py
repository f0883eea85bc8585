"""The figures of what people did: the axes of each input, and when it was lost."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from kybflow.core.signals import NS
from kybflow.inputs.rows import InputRow, InputRows
from kybflow.report.data import Run
from kybflow.report.intervals import FAULT, TINTS
from kybflow.report.plot import VEHICLES, Figure, bands, line, over_time

_LOST = "lost"
_NOTE = "As kybflow heard it, after dead zones and calibration. Buttons: {}."


def input_figures(run: Run) -> list[Figure]:
    """A figure of each input."""
    return [_input(name, rows, run) for name, rows in run.inputs.items()]


def _input(name: str, said: InputRows, run: Run) -> Figure:
    times = [*(row.time / NS for row in said.rows), run.end]
    time = np.repeat(times, 2)[1:-1]  # each row holds from its time to the next one's
    traces = []
    for number, axis in enumerate(said.axes):
        values = np.repeat([row.axes.get(axis, np.nan) for row in said.rows], 2)
        colour = VEHICLES[number % len(VEHICLES)]
        traces.append(line(axis, time, values, colour, 1.6, hover="%{y:.2f}"))
    layout = over_time(run, "deflection", "normal")
    layout["yaxis"]["range"] = [-1.05, 1.05]
    layout |= bands(_lost(said, run.end))
    pressed = ", ".join(_pressed(said.rows)) or "none was pressed"
    return Figure(f"input_{name}", f"Input {name}", _NOTE.format(pressed), traces, layout)


def _lost(said: InputRows, end: float) -> Iterator[tuple[str, float, float, str, dict[str, Any]]]:
    """A band for each time in which it said nothing."""
    ends = [*(row.time / NS for row in said.rows[1:]), end]
    for row, until in zip(said.rows, ends, strict=True):
        if row.lost and row.time / NS < until:
            font = {"size": 10, "color": "ink"}
            label = {"label": {"text": row.lost, "textposition": "top left", "font": font}}
            yield _LOST, row.time / NS, until, TINTS[FAULT], label


def _pressed(rows: tuple[InputRow, ...]) -> Iterator[str]:
    """Each press of a button, with its time."""
    first = InputRow(0, {})
    for before, row in pairwise((first, *rows)):
        for button in sorted(row.held - before.held):
            yield f"{button} at {row.time / NS:.2f} s"
