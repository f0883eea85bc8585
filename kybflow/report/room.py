"""What stands in the room, from above: the fence, obstacles and named points."""

from __future__ import annotations

from math import cos, hypot, pi, sin
from typing import Any, NamedTuple

from kybflow.report.data import Run
from kybflow.world.shapes import Box, Plane, Shape

_ROUND = 48


class Extent(NamedTuple):
    """A rectangle of the map, in metres."""

    x0: float
    y0: float
    x1: float
    y1: float

    def grown(self, by: float) -> Extent:
        """With `by` metres more on every side."""
        return Extent(self.x0 - by, self.y0 - by, self.x1 + by, self.y1 + by)

    def covers(self, other: Extent) -> bool:
        """Whether all of `other` lies in it."""
        return bool(
            self.x0 <= other.x0
            and self.y0 <= other.y0
            and other.x1 <= self.x1
            and other.y1 <= self.y1
        )

    @property
    def span(self) -> float:
        """Its longer side."""
        return max(self.x1 - self.x0, self.y1 - self.y0)


def outline(shape: Shape, window: Extent) -> tuple[list[float], list[float]]:
    """The outline of an obstacle from above; a wall is a line through the window, and a floor or
    ceiling is nothing."""
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
    turns = [2.0 * pi * step / _ROUND for step in range(_ROUND + 1)]
    x, y, _ = shape.at
    return [x + shape.radius * cos(a) for a in turns], [y + shape.radius * sin(a) for a in turns]


def things(run: Run) -> dict[str, Extent]:
    """Where the fence, the points and the obstacles that end somewhere are."""
    found: dict[str, Extent] = {}
    if run.mission.get("fence"):
        low, high = run.mission["fence"]
        found["the fence"] = Extent(low[0], low[1], high[0], high[1])
    for name, (x, y, _) in run.world.points.items():
        found[f"point {name}"] = Extent(x, y, x, y)
    for name, shape in run.world.obstacles.items():
        if not isinstance(shape, Plane):
            xs, ys = outline(shape, Extent(0.0, 0.0, 0.0, 0.0))
            found[f"obstacle {name}"] = Extent(min(xs), min(ys), max(xs), max(ys))
    return found


def room(run: Run, window: Extent) -> list[dict[str, Any]]:
    """Obstacles and points; what stands at one place shares a label, and a
    point that is called like an obstacle has that one's."""
    traces = []
    for number, (name, shape) in enumerate(run.world.obstacles.items()):
        xs, ys = outline(shape, window)
        if xs:
            traces.append(_obstacle(name, xs, ys, number == 0, isinstance(shape, Plane)))
    places: dict[tuple[float, float], list[str]] = {}
    for name, (x, y, _) in run.world.points.items():
        places.setdefault((x, y), []).append(name)
    if places:
        named, obstacles = places.values(), run.world.obstacles
        traces.append(
            {
                "type": "scatter",
                "mode": "markers+text",
                "name": "named point",
                "x": [x for x, _ in places],
                "y": [y for _, y in places],
                "text": [", ".join(n for n in names if n not in obstacles) for names in named],
                "customdata": [", ".join(names) for names in named],
                "textposition": "top right",
                "textfont": {"color": "soft", "size": 11},
                "marker": {"symbol": "cross-thin-open", "size": 8, "color": "soft"},
                "hovertemplate": "%{customdata}<br>%{x:.3f}, %{y:.3f} m<extra></extra>",
            }
        )
    return traces


def _obstacle(
    name: str, xs: list[float], ys: list[float], first: bool, is_wall: bool
) -> dict[str, Any]:
    lowest = 1 if is_wall else min(range(len(ys)), key=ys.__getitem__)
    trace = {
        "type": "scatter",
        "mode": "lines+text",
        "name": "obstacle",
        "legendgroup": "obstacle",
        "showlegend": first,
        "x": xs,
        "y": ys,
        "text": [name if place == lowest else "" for place in range(len(xs))],
        "textposition": "bottom center",
        "textfont": {"color": "ink", "size": 11},
        "line": {"color": "#7d8894", "width": 3.0 if is_wall else 1.5},
        "hovertemplate": f"obstacle {name}<br>%{{x:.3f}}, %{{y:.3f}} m<extra></extra>",
    }
    return trace if is_wall else {**trace, "fill": "toself", "fillcolor": "rgba(125,136,148,0.3)"}


def fence(run: Run) -> list[dict[str, Any]]:
    """A dotted rectangle, named in the legend."""
    if not run.mission.get("fence"):
        return []
    (x0, y0, _), (x1, y1, _) = run.mission["fence"]
    line = {"color": "alarm", "width": 1.5, "dash": "dot"}
    return [
        {
            **{"type": "rect", "x0": x0, "y0": y0, "x1": x1, "y1": y1, "line": line},
            **{"name": "fence", "showlegend": True},
        }
    ]
