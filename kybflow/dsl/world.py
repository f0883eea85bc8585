"""`world:` to the fence, the named points and the obstacles; points in the place of their names."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from collections.abc import Mapping as MappingOf
from dataclasses import replace
from math import sqrt
from typing import Any, NamedTuple

from kybflow.dsl.diagnostics import Diagnostic, did_you_mean
from kybflow.dsl.document import ObstacleUse, Parameter
from kybflow.dsl.nodes import Entry, Mapping, Node, Scalar, Sequence, entries_of
from kybflow.dsl.source import PREFIX, Span
from kybflow.dsl.values import decode, origin, quantity_field
from kybflow.geometry import ZERO, Vec3
from kybflow.shapes import Box, Cylinder, Plane, Shape, Sphere
from kybflow.units import LENGTH, NUMBER

CODES = {
    "KYB153": "A fence whose corners are in the wrong order.",
    "KYB154": "`world.points.NAME` where the world has no such point.",
    "KYB155": "An obstacle that is no solid, or several.",
    "KYB156": "An obstacle with no inside: a box with its corners in the wrong order, a plane that "
    "faces nowhere.",
}
_NAMED = re.compile(r"world\.points\.(\w+)\Z", re.ASCII)


class World(NamedTuple):
    """What of the world the mission says."""

    fence: Box | None
    points: dict[str, Vec3]
    point_spans: dict[str, Span]
    obstacles: tuple[ObstacleUse, ...]


def world_of(node: Node | None, found: list[Diagnostic]) -> World:
    """The world of a mission; what is wrong with it is left out."""
    entries = entries_of(node)
    points = entries_of(_value(entries.get("points")))
    places = {name: _vector(entry.value, name, found) or ZERO for name, entry in points.items()}
    return World(
        fence=_fence(entries.get("fence"), found),
        points=places,
        point_spans={name: entry.key.span for name, entry in points.items()},
        obstacles=tuple(_obstacles(_value(entries.get("obstacles")), found)),
    )


def _value(entry: Entry | None) -> Node | None:
    return None if entry is None else entry.value


def _vector(node: Node | None, name: str, found: list[Diagnostic]) -> Vec3 | None:
    field = quantity_field(name, LENGTH, "vector")
    value: Vec3 | None = None if node is None else decode(node, field, found)
    return value


def _length(node: Node | None, name: str, found: list[Diagnostic]) -> float | None:
    field = quantity_field(name, LENGTH, above=0.0)
    value: float | None = None if node is None else decode(node, field, found)
    return value


def _fence(entry: Entry | None, found: list[Diagnostic]) -> Box | None:
    if entry is None or not isinstance(entry.value, Mapping):
        return None
    box = _corners(entry.value, found)
    if box is not None and not _has_inside(box):
        message, hint = "the fence has no inside", _ORDER
        found.append(Diagnostic("KYB153", message, entry.key.span, help=hint))
    return box


def _corners(body: Mapping, found: list[Diagnostic]) -> Box | None:
    low, high = (_vector(body.get(key), key, found) for key in ("from", "to"))
    return None if low is None or high is None else Box(low, high)


def _has_inside(box: Box) -> bool:
    return all(a < b for a, b in zip(box.low, box.high, strict=True))


_ORDER = "each number of `from` must be below that of `to`"


def _obstacles(node: Node | None, found: list[Diagnostic]) -> Iterator[ObstacleUse]:
    for name, entry in entries_of(node).items():
        solids = {kind: e for kind, e in entries_of(entry.value).items() if kind in _SOLIDS}
        if len(solids) != 1:
            what = " and ".join(f"a {kind}" for kind in solids) or "nothing solid"
            message = f"the obstacle `{name}` is {what}"
            hint = "write one of `box`, `cylinder`, `sphere` and `plane`"
            found.append(Diagnostic("KYB155", message, entry.key.span, help=hint))
            continue
        ((kind, solid),) = solids.items()
        if isinstance(solid.value, Mapping):
            shape = _SOLIDS[kind](solid.value, found)
            if shape is not None:
                yield ObstacleUse(entry.key.as_text, shape, entry.key.span)


def _box(body: Mapping, found: list[Diagnostic]) -> Shape | None:
    box = _corners(body, found)
    if box is None or _has_inside(box):
        return box
    found.append(Diagnostic("KYB156", "the box has no inside", body.span, help=_ORDER))
    return None


def _cylinder(body: Mapping, found: list[Diagnostic]) -> Shape | None:
    at = _vector(body.get("at"), "at", found)
    radius, height = (_length(body.get(key), key, found) for key in ("radius", "height"))
    if at is None or radius is None or height is None:
        return None
    return Cylinder(at, radius, height)


def _sphere(body: Mapping, found: list[Diagnostic]) -> Shape | None:
    at, radius = _vector(body.get("at"), "at", found), _length(body.get("radius"), "radius", found)
    return None if at is None or radius is None else Sphere(at, radius)


def _plane(body: Mapping, found: list[Diagnostic]) -> Shape | None:
    at, node = _vector(body.get("at"), "at", found), body.get("facing")
    field = quantity_field("facing", NUMBER, "vector")
    facing: Vec3 | None = None if node is None else decode(node, field, found)
    if at is None or node is None or facing is None:
        return None
    x, y, z = facing
    norm = sqrt(x * x + y * y + z * z)
    if norm == 0.0:
        hint = "`facing` is a direction, like `[1, 0, 0]`"
        found.append(Diagnostic("KYB156", "the plane faces nowhere", node.span, help=hint))
        return None
    return Plane(at, (x / norm, y / norm, z / norm))


_SOLIDS: dict[str, Callable[[Mapping, list[Diagnostic]], Shape | None]] = {
    "box": _box,
    "cylinder": _cylinder,
    "sphere": _sphere,
    "plane": _plane,
}


def unknown_point(name: str, points: MappingOf[str, Any]) -> tuple[str, str]:
    """(what is wrong with `world.points.NAME`, the way out)."""
    hint = did_you_mean(name, points) or "name it under `points` of `world`"
    return f"the world has no point `{name}`", hint


class Points:
    """Puts coordinates in the place of `world.points.NAME`. A node without any stays the same
    object, and an aliased one is replaced once."""

    def __init__(self, points: MappingOf[str, Vec3], found: list[Diagnostic]) -> None:
        self._points = points
        self._found = found
        self._done: dict[int, tuple[Node, Node]] = {}

    def apply(self, node: Node) -> Node:
        """`node` with every name of a point replaced that is a value of its own."""
        if isinstance(node, Scalar):
            return self._scalar(node) if node.text.startswith(PREFIX) else node
        if id(node) not in self._done:
            self._done[id(node)] = (node, self._inside(node))
        return self._done[id(node)][1]

    def _inside(self, node: Mapping | Sequence) -> Node:
        if isinstance(node, Sequence):
            items = tuple(self.apply(item) for item in node.items)
            same = all(a is b for a, b in zip(items, node.items, strict=True))
            return node if same else Sequence(items, node.span)
        values = [self.apply(entry.value) for entry in node.entries.values()]
        if all(a is e.value for a, e in zip(values, node.entries.values(), strict=True)):
            return node
        pairs = zip(node.entries.items(), values, strict=True)
        entries = {key: entry._replace(value=value) for (key, entry), value in pairs}
        return Mapping(entries, node.span)

    def _scalar(self, node: Scalar) -> Node:
        match = _NAMED.match(node.text)
        if match is None:
            return node
        point = self._points.get(match[1])
        if point is None:
            message, hint = unknown_point(match[1], self._points)
            notes = origin(node)
            self._found.append(Diagnostic("KYB154", message, node.span, notes=notes, help=hint))
        numbers = (Scalar(repr(number), node.span) for number in point or ZERO)
        return Sequence(tuple(numbers), node.span)


def with_points(root: Mapping, points: MappingOf[str, Vec3], found: list[Diagnostic]) -> Mapping:
    """The mission with coordinates in the place of `world.points.NAME`, but for the world's own."""
    pasting = Points(points, found)
    entries = {
        key: entry if key == "world" else entry._replace(value=pasting.apply(entry.value))
        for key, entry in root.entries.items()
    }
    return Mapping(entries, root.span)


def placed(
    parameters: MappingOf[str, Parameter], points: MappingOf[str, Vec3]
) -> dict[str, Parameter]:
    """The parameters, those that name a point with its coordinates."""
    return {
        name: p if p.type != "position" or not isinstance(p.value, str)
        else replace(p, value=points.get(p.value.removeprefix(PREFIX), ZERO))
        for name, p in parameters.items()
    }  # fmt: skip
