"""Draws a run for a paper: as wide as its column, with units and without a title, in a serif font
of 8 pt that the file embeds.

Colours differ in brightness too, for colour-blind readers and grey prints. matplotlib is imported
when a figure is drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import ceil, inf
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kybflow.api.runs import RecordedVehicle, Run, imported
from kybflow.core.errors import KybflowError
from kybflow.core.signals import CommandKind
from kybflow.core.units import DEG
from kybflow.recording.layout import COMMAND_KINDS
from kybflow.report import map as from_above
from kybflow.report.data import RecordedRun, read_run
from kybflow.report.estimators import heading
from kybflow.report.plot import Extent
from kybflow.world.shapes import Plane, Sphere

Array = NDArray[np.float64]
_COLUMN, _PAGE = 3.5, 7.16
"""The widths of a column and of the page of IEEE's papers, inches."""
_COLOURS = (
    "#2a6fb0", "#e6b845", "#661144", "#44aa99", "#999933", "#cc6677", "#332288", "#88ccee",
)  # fmt: skip
"""After the muted scheme of Paul Tol, with the first four further apart in brightness."""
_SETPOINT: dict[str, Any] = {"color": "black", "linewidth": 0.5, "dashes": (4, 3), "zorder": 3}
_STYLE = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 8.0,
    "axes.linewidth": 0.6,
    "axes.xmargin": 0.0,
    "lines.linewidth": 1.2,
    "figure.constrained_layout.h_pad": 0.02,
    "figure.constrained_layout.w_pad": 0.02,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.borderpad": 0.0,
    "legend.borderaxespad": 0.2,
    "legend.columnspacing": 1.2,
    "pdf.fonttype": 42,
    "savefig.dpi": 300,
}


class FigureFailed(KybflowError):
    """A figure can't be drawn or written; the message says why."""


def write_figure(
    run: Run,
    name: str,
    out: Path,
    *,
    vehicles: Sequence[str] = (),
    span: tuple[float, float] = (0.0, inf),
    wide: bool = False,
) -> None:
    """Draw one of FIGURES into the file `out`, whose suffix is its format: .pdf, .svg or .png.

    vehicles: all of the run by default. span: the time that is drawn, s. wide: as wide as two
    columns. Raises FigureFailed, LibraryMissing, SignalUnknown, RunFolderError or OSError.
    """
    library = imported("a figure", "matplotlib", extra="figures")
    figure = imported("a figure", "matplotlib.figure", extra="figures").Figure
    if out.suffix not in (".pdf", ".svg", ".png"):
        raise FigureFailed(f"`{out}` should end with .pdf, .svg or .png")
    each = [run.vehicle(one) for one in vehicles] if vehicles else run.each()
    with library.rc_context(_STYLE):
        width = _PAGE if wide else _COLUMN
        drawing = PaperFigure(run, each, span, width, figure(layout="constrained"))
        if not all(drawing.inside(vehicle.time).any() for vehicle in each):
            raise FigureFailed("the recording has no ticks of each vehicle in this time")
        FIGURES[name](drawing)
        drawing.finish()
        dated = {"metadata": {"CreationDate": None}} if out.suffix == ".pdf" else {}
        drawing.figure.savefig(out, **dated)


@dataclass(frozen=True)
class PaperFigure:
    """A figure and what it shows. span: the time that is drawn, s. width: in inches. figure: of
    matplotlib, without axes at first."""

    run: Run
    vehicles: Sequence[RecordedVehicle]
    span: tuple[float, float]
    width: float
    figure: Any
    _names: list[tuple[Any, float]] = field(default_factory=list)

    @cached_property
    def recorded(self) -> RecordedRun:
        """What the report reads of the run: its world and its objects."""
        return read_run(self.run.folder)

    @property
    def coloured(self) -> list[tuple[RecordedVehicle, str]]:
        """The vehicles with their colours."""
        return [(v, _COLOURS[n % len(_COLOURS)]) for n, v in enumerate(self.vehicles)]

    def inside(self, time: Array) -> NDArray[np.bool_]:
        """Return which of these times are drawn."""
        return (time >= self.span[0]) & (time <= self.span[1])

    def curve(self, axes: Any, time: Array, values: Array, **style: Any) -> None:
        """Draw values over time."""
        inside = self.inside(time)
        axes.plot(time[inside], values[inside], **style)

    def states(self, vehicle: RecordedVehicle) -> tuple[Array, NDArray[Any]]:
        """Return when each state that is drawn begins, and its name."""
        inside = self.inside(vehicle.time)
        time, state = vehicle.time[inside], vehicle.state[inside]
        first = np.flatnonzero(np.append(True, state[1:] != state[:-1]))
        return time[first], state[first]

    def over_time(self, *labels: str) -> list[Any]:
        """Add a panel for each label of a y axis, one below the other. The states of a single
        vehicle are bands with names above."""
        if not labels:
            raise FigureFailed("the run has nothing that this figure shows")
        self.figure.set_size_inches(self.width, 0.7 + (len(labels) if len(labels) > 1 else 1.35))
        panels = self.figure.subplots(len(labels), sharex=True, squeeze=False)[:, 0]
        for axes, label in zip(panels, labels, strict=True):
            axes.set_ylabel(label)
        last = max(v.time[self.inside(v.time)][-1] for v in self.vehicles)
        panels[-1].set(xlabel="time (s)", xlim=(self.span[0], last))
        starts, names = self.states(self.vehicles[0])
        alone = [*zip(starts, [*starts[1:], last], names, strict=True)]
        for n, (start, end, name) in enumerate(alone if len(self.vehicles) == 1 else ()):
            for axes in panels if n % 2 else ():
                axes.axvspan(start, end, color="0.92", linewidth=0.0, zorder=0)
            up = panels[0].get_xaxis_transform()
            style = {"ha": "center", "va": "bottom", "color": "0.35", "transform": up}
            text = panels[0].text(0.5 * (start + end), 1.02, name, **style)
            self._names.append((text, end - start))
        return [*panels]

    def finish(self) -> None:
        """Name the curves above all panels, each name once, and leave out the names of states that
        are wider than their band."""
        named: dict[str, Any] = {}
        for axes in self.figure.axes:
            for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
                named.setdefault(name, handle)
        if named:
            rows = ceil(sum(0.45 + 0.06 * len(name) for name in named) / self.width)
            columns = ceil(len(named) / rows)
            above = {"loc": "outside upper center", "ncols": columns}
            self.figure.legend([*named.values()], [*named], **above)
        self.figure.draw_without_rendering()
        for name, lasts in self._names:
            left, right = name.axes.transData.transform([(0.0, 0.0), (lasts, 0.0)])[:, 0]
            name.set_visible(name.get_window_extent().width < right - left)


def _components(
    drawing: PaperFigure,
    labels: Sequence[str],
    values: Callable[[RecordedVehicle], Array],
    wanted: Callable[[RecordedVehicle], Array] | None = None,
    name: str = "setpoint",
) -> None:
    """Draw a panel for each column of `values`, and those of `wanted` as dashed lines. name: of
    these. Ticks above show when several vehicles change their states."""
    panels = drawing.over_time(*labels)
    for vehicle, colour in drawing.coloured:
        known = "true" if "truth.position" in vehicle else "estimated"
        label = vehicle.name if len(drawing.vehicles) > 1 else known if wanted else None
        found, aims = values(vehicle), None if wanted is None else wanted(vehicle)
        for n, axes in enumerate(panels):
            drawing.curve(axes, vehicle.time, found[:, n], color=colour, label=label)
            if aims is not None:
                drawing.curve(axes, vehicle.time, aims[:, n], **_SETPOINT)
    if wanted is not None:
        panels[0].plot([], [], label=name, **_SETPOINT)
    several = len(drawing.vehicles) > 1
    for row, (vehicle, colour) in enumerate(reversed(drawing.coloured) if several else ()):
        starts, _ = drawing.states(vehicle)
        above, *_ = panels[0].get_xaxis_text2_transform(3.0 + 3.6 * row)
        style = {"color": colour, "markersize": 3.0, "transform": above, "clip_on": False}
        panels[0].plot(starts, np.ones(len(starts)), "|", **style)


def _flown(vehicle: RecordedVehicle, what: str) -> Array:
    """Return what was true or, on hardware, estimated."""
    return vehicle[f"{'truth' if 'truth.position' in vehicle else 'estimate'}.{what}"]


def position(drawing: PaperFigure) -> None:
    """The position in three panels, true or estimated, and its setpoint."""
    labels = [f"${axis}$ (m)" for axis in "xyz"]
    _components(drawing, labels, lambda v: _flown(v, "position"), lambda v: v.setpoint)


def velocity(drawing: PaperFigure) -> None:
    """The velocity in three panels, true or estimated, and its setpoint."""
    labels = [f"$v_{axis}$ (m/s)" for axis in "xyz"]
    _components(drawing, labels, lambda v: _flown(v, "velocity"), lambda v: v["setpoint.velocity"])


def height(drawing: PaperFigure) -> None:
    """The height above the ground and its setpoint."""
    _components(
        drawing, ["height (m)"], lambda v: _flown(v, "position")[:, 2:], lambda v: v.setpoint[:, 2:]
    )


def error(drawing: PaperFigure) -> None:
    """The distance from the setpoint, in flight."""
    _components(drawing, ["position error (cm)"], lambda v: 100.0 * v.error[:, None])
    drawing.figure.axes[0].set_ylim(bottom=0.0)


def attitude(drawing: PaperFigure) -> None:
    """Roll, pitch and yaw; of one vehicle also those that were commanded."""

    def commanded(vehicle: RecordedVehicle) -> Array:
        is_attitude = vehicle["command.kind"] == COMMAND_KINDS[CommandKind.ATTITUDE_THRUST]
        angles = _angles(vehicle["command.attitude"])
        angles[~(is_attitude & vehicle["command.armed"])] = np.nan
        angles[~vehicle["command.heading_present"], 2] = np.nan
        return angles

    labels = [f"{angle} (deg)" for angle in ("roll", "pitch", "yaw")]
    wanted = commanded if len(drawing.vehicles) == 1 else None
    _components(drawing, labels, lambda v: _angles(_flown(v, "attitude")), wanted, "command")


def _angles(attitude: Array) -> Array:
    """Return roll, pitch and yaw, deg, (n, 3), with a gap where one jumps by a turn."""
    w, x, y, z = attitude.T
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin((2.0 * (w * y - z * x)).clip(-1.0, 1.0))
    angles: Array = np.column_stack((roll, pitch, heading(attitude))) / DEG
    angles[1:][np.abs(np.diff(angles, axis=0)) > 180.0] = np.nan
    return angles


def estimators(drawing: PaperFigure) -> None:
    """The error of each estimator, thick where the vehicle flew on it."""
    several = len(drawing.vehicles) > 1
    panels = drawing.over_time(
        *(f"{v.name if several else 'error'} (cm)" for v in drawing.vehicles)
    )
    for axes, vehicle in zip(panels, drawing.vehicles, strict=True):
        flown = _flown(vehicle, "position")
        own = [name for name in vehicle.sensors if name.startswith("estimator/")]
        for n, name in enumerate(own):
            found = vehicle.sensor(name)
            at = np.searchsorted(vehicle.time, found.time).clip(0, len(flown) - 1)
            gap = 100.0 * np.linalg.norm(found["position"] - flown[at], axis=1)
            style = {"color": _COLOURS[n % len(_COLOURS)], "linewidth": 0.5}
            drawing.curve(axes, found.time, gap, label=name.removeprefix("estimator/"), **style)
            used = np.where(found["used"], gap, np.nan)
            drawing.curve(axes, found.time, used, **style | {"linewidth": 1.4})
        axes.set_ylim(bottom=0.0)


def objects(drawing: PaperFigure) -> None:
    """The coordinates of objects: true, tracked by motion capture, and their goals."""
    tracks = drawing.recorded.objects.tracks
    shown = [(name, of) for name, track in tracks.items() for of in track.coordinates]
    units = {of: (1.0 / DEG, "deg") if of in ("angle", "yaw") else (1.0, "m") for _, of in shown}
    panels = drawing.over_time(*(f"{name} {of} ({units[of][1]})" for name, of in shown))
    for axes, (name, of) in zip(panels, shown, strict=True):
        factor, _ = units[of]
        for n, (known, motion) in enumerate(tracks[name].motions.items()):
            label = "tracked" if known == "seen" else known
            style = {"color": _COLOURS[n], "linewidth": 1.8 - n, "label": label}
            drawing.curve(axes, motion.time, factor * motion.coordinate(of), **style)
        for goal in tracks[name].goals.get(of, {}).values():
            axes.plot(axes.get_xlim(), [factor * goal] * 2, label="goal", **_SETPOINT)


def path(drawing: PaperFigure) -> None:
    """The path from above and its setpoint, with the fence, obstacles and objects."""
    window, _ = from_above.shown(drawing.recorded)
    tall = (window.y1 - window.y0) / (window.x1 - window.x0)
    drawing.figure.set_size_inches(drawing.width, 0.65 + (drawing.width - 0.45) * tall)
    axes = drawing.figure.subplots()
    axes.set(xlabel="$x$ (m)", xlim=(window.x0, window.x1), ylabel="$y$ (m)", aspect="equal")
    axes.set_ylim(window.y0, window.y1)
    _room(drawing, axes, window)
    for vehicle, colour in drawing.coloured:
        inside = drawing.inside(vehicle.time)
        x, y, _ = _flown(vehicle, "position")[inside].T
        axes.plot(x, y, color=colour, label=vehicle.name)
        axes.plot(x[:1], y[:1], "o", color=colour, markersize=3.0)
        axes.plot(*vehicle.setpoint[inside, :2].T, **_SETPOINT)
    axes.plot([], [], label="setpoint", **_SETPOINT)


def _room(drawing: PaperFigure, axes: Any, window: Extent) -> None:
    """Draw the fence, the obstacles and, where they were at first and at last, the objects."""
    run, (begin, end) = drawing.recorded, drawing.span
    if fence := run.mission.get("fence"):
        (x0, y0, _), (x1, y1, _) = fence
        border = ([x0, x1, x1, x0, x0], [y0, y0, y1, y1, y0])
        axes.plot(*border, color="0.4", linestyle=":", label="fence")
    for shape in run.world.obstacles.values():
        places = np.array(from_above.outline(shape, window), float)
        for piece in np.split(places, np.flatnonzero(np.isnan(places[0])), axis=1):
            kind, width = (axes.plot, 2.0) if isinstance(shape, Plane) else (axes.fill, 0.0)
            kind(*piece[:, ~np.isnan(piece[0])], color="0.75", linewidth=width)
    for ball in run.moving.values():
        way = ball.position[drawing.inside(ball.time)]
        axes.plot(*way[:, :2].T, color="0.6", linestyle=":")
        for x, y, z in way[:1].tolist():
            axes.fill(*from_above.outline(Sphere((x, y, z), ball.radius), window), color="0.75")
    for track in run.objects.tracks.values():
        for corners in track.outlines(begin):
            axes.fill(*corners.T, facecolor="none", edgecolor="0.4", linestyle=":", linewidth=0.6)
        for corners in track.outlines(min(end, run.end)):
            axes.fill(*corners.T, facecolor="0.85", edgecolor="0.4", linewidth=0.6)


FIGURES: dict[str, Callable[[PaperFigure], None]] = {
    draw.__name__: draw
    for draw in (path, position, velocity, height, error, attitude, estimators, objects)
}
"""The figures by name; the first line of the docstring says what it shows."""
