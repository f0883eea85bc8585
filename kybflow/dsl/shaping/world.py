"""`world:` to the fence, the named points, the obstacles and the printed tags, and coordinates in
the place of `world.points.NAME`."""

from __future__ import annotations

import re
from collections.abc import Callable
from collections.abc import Mapping as MappingOf
from dataclasses import replace
from math import sqrt
from typing import Any, NamedTuple

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.text import did_you_mean
from kybflow.core.units import LENGTH, NUMBER
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, every
from kybflow.dsl.diagnostics.spans import PREFIX, Span
from kybflow.dsl.document import MovingEntry, ObstacleEntry, Parameter, TagsEntry
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    entries_of,
    head_of,
)
from kybflow.dsl.reading.values import decode, origin, quantity_field
from kybflow.dsl.schema.world import MovingSphereParams
from kybflow.dsl.shaping.parts import params_of
from kybflow.dsl.shaping.scans import KINDS as SCANNED
from kybflow.dsl.shaping.scans import scanned
from kybflow.dsl.shaping.tags import tags_in
from kybflow.world.moving_sphere import MovingSphere
from kybflow.world.shapes import Box, Cylinder, Plane, Shape, Sphere

CODES = {
    "KYB153": "A fence whose corners are in the wrong order.",
    "KYB154": "`world.points.NAME` where the world has no such point.",
    "KYB155": "An obstacle that is no solid, or several.",
    "KYB156": "An obstacle with no inside: a box with its corners in the wrong order, a plane that "
    "faces nowhere.",
}


class WorldEntry(NamedTuple):
    """The `world:` of a mission."""

    fence: Box | None
    points: dict[str, Vec3]
    point_spans: dict[str, Span]
    obstacles: tuple[ObstacleEntry, ...]
    moving: tuple[MovingEntry, ...]
    tags: tuple[TagsEntry, ...]


def world_of(node: Node | None) -> Diagnosed[WorldEntry]:
    """The world of a mission; what is wrong with it is left out."""
    entries = entries_of(node)
    points = entries_of(_value(entries.get("points")))
    places: dict[str, Vec3] = {}
    for name, entry in points.items():
        places[name] = (yield from _vector(entry.value, name)) or ZERO
    return WorldEntry(
        fence=(yield from _fence(entries.get("fence"))),
        points=places,
        point_spans={name: entry.key.span for name, entry in points.items()},
        obstacles=(yield from _obstacles(_value(entries.get("obstacles")))),
        moving=(yield from _moving(_value(entries.get("obstacles")))),
        tags=(yield from tags_in(_value(entries.get("tags")))),
    )


def _value(entry: MappingEntry | None) -> Node | None:
    return None if entry is None else entry.value


def _vector(node: Node | None, name: str) -> Diagnosed[Vec3 | None]:
    field = quantity_field(name, LENGTH, "vector")
    value: Vec3 | None = None if node is None else (yield from decode(node, field))
    return value


def _length(node: Node | None, name: str) -> Diagnosed[float | None]:
    field = quantity_field(name, LENGTH, above=0.0)
    value: float | None = None if node is None else (yield from decode(node, field))
    return value


def _fence(entry: MappingEntry | None) -> Diagnosed[Box | None]:
    if entry is None or not isinstance(entry.value, Mapping):
        return None
    if not (yield from _is_whole(entry.value, "fence", _CORNERS)):
        return None
    box = yield from _corners(entry.value)
    if box is not None and not _has_inside(box):
        yield Diagnostic("KYB153", "the fence has no inside", entry.key.span, help=_ORDER)
    return box


def _is_whole(body: Mapping, what: str, keys: tuple[str, ...]) -> Diagnosed[bool]:
    """Whether nothing is missing, now that what a `like` brings is there."""
    missing = [key for key in keys if body.get(key) is None]
    for key in missing:
        yield Diagnostic("KYB102", f"a {what} needs `{key}`", head_of(body))
    return not missing


def _corners(body: Mapping) -> Diagnosed[Box | None]:
    low = yield from _vector(body.get("from"), "from")
    high = yield from _vector(body.get("to"), "to")
    return None if low is None or high is None else Box(low, high)


def _has_inside(box: Box) -> bool:
    return all(a < b for a, b in zip(box.low, box.high, strict=True))


_ORDER = "each number of `from` must be below that of `to`"


def _obstacles(node: Node | None) -> Diagnosed[tuple[ObstacleEntry, ...]]:
    obstacles: list[ObstacleEntry] = []
    for name, entry in entries_of(node).items():
        solids = {kind: e for kind, e in entries_of(entry.value).items() if kind in _KINDS}
        if len(solids) != 1:
            what = " and ".join(f"a {kind}" for kind in solids) or "nothing solid"
            message = f"the obstacle `{name}` is {what}"
            hint = f"write one of {', '.join(f'`{kind}`' for kind in _KINDS[:-1])} and `{_MOVING}`"
            yield Diagnostic("KYB155", message, entry.key.span, help=hint)
            continue
        ((kind, solid),) = solids.items()
        body, may_touch = solid.value, _text_of(entry.value, "contact") == "allowed"
        if kind in SCANNED:
            obstacles += yield from scanned(entry.key, solid, may_touch)
        if kind not in _SOLIDS:
            continue
        if isinstance(body, Mapping) and (yield from _is_whole(body, kind, _KEYS[kind])):
            shape = yield from _SOLIDS[kind](body)
            if shape is not None:
                obstacles.append(ObstacleEntry(entry.key.as_text, shape, entry.key.span, may_touch))
    return tuple(obstacles)


def _moving(node: Node | None) -> Diagnosed[tuple[MovingEntry, ...]]:
    found: list[MovingEntry] = []
    for entry in entries_of(node).values():
        own = entries_of(entry.value).get(_MOVING)
        if own is None or not isinstance(own.value, Mapping):
            continue
        of = yield from params_of(MovingSphereParams, own.value, _MOVING, own.key.span)
        if of is not None:
            sphere = MovingSphere(of.along, of.radius, of.speed, of.body)
            found.append(MovingEntry(entry.key.as_text, sphere, entry.key.span))
    return tuple(found)


def _text_of(node: Node, key: str) -> str | None:
    entry = entries_of(node).get(key)
    return entry.value.text if entry is not None and isinstance(entry.value, Scalar) else None


def _box(body: Mapping) -> Diagnosed[Shape | None]:
    box = yield from _corners(body)
    if box is None or _has_inside(box):
        return box
    yield Diagnostic("KYB156", "the box has no inside", body.span, help=_ORDER)
    return None


def _cylinder(body: Mapping) -> Diagnosed[Shape | None]:
    at = yield from _vector(body.get("at"), "at")
    radius = yield from _length(body.get("radius"), "radius")
    height = yield from _length(body.get("height"), "height")
    if at is None or radius is None or height is None:
        return None
    return Cylinder(at, radius, height)


def _sphere(body: Mapping) -> Diagnosed[Shape | None]:
    at = yield from _vector(body.get("at"), "at")
    radius = yield from _length(body.get("radius"), "radius")
    return None if at is None or radius is None else Sphere(at, radius)


def _plane(body: Mapping) -> Diagnosed[Shape | None]:
    at, node = (yield from _vector(body.get("at"), "at")), body.get("facing")
    field = quantity_field("facing", NUMBER, "vector")
    facing: Vec3 | None = None if node is None else (yield from decode(node, field))
    if at is None or node is None or facing is None:
        return None
    x, y, z = facing
    norm = sqrt(x * x + y * y + z * z)
    if norm == 0.0:
        hint = "`facing` is a direction, like `[1, 0, 0]`"
        yield Diagnostic("KYB156", "the plane faces nowhere", node.span, help=hint)
        return None
    return Plane(at, (x / norm, y / norm, z / norm))


_CORNERS = ("from", "to")
_KEYS = {
    "box": _CORNERS,
    "cylinder": ("at", "radius", "height"),
    "sphere": ("at", "radius"),
    "plane": ("at", "facing"),
}
_MOVING = "moving_sphere"
_SOLIDS: dict[str, Callable[[Mapping], Diagnosed[Shape | None]]] = {
    "box": _box,
    "cylinder": _cylinder,
    "sphere": _sphere,
    "plane": _plane,
}
_KINDS = (*_SOLIDS, *SCANNED, _MOVING)


_NAMED = re.compile(r"world\.points\.(\w+)\Z", re.ASCII)


def unknown_point(name: str, points: MappingOf[str, Any]) -> tuple[str, str]:
    """(what is wrong with `world.points.NAME`, the way out)."""
    hint = did_you_mean(name, points) or "name it under `points` of `world`"
    return f"the world has no point `{name}`", hint


class Points:
    """Puts coordinates in the place of `world.points.NAME`. A node without any stays the same
    object, and an aliased one is replaced once."""

    def __init__(self, points: MappingOf[str, Vec3]) -> None:
        self._points = points
        self._done: dict[int, tuple[Node, Node]] = {}

    def apply(self, node: Node) -> Diagnosed[Node]:
        """`node` with every name of a point replaced that is a value of its own."""
        if isinstance(node, Scalar):
            return (yield from self._scalar(node)) if node.text.startswith(PREFIX) else node
        if id(node) not in self._done:
            self._done[id(node)] = (node, (yield from self._replaced(node)))
        return self._done[id(node)][1]

    def _replaced(self, node: Mapping | Sequence) -> Diagnosed[Node]:
        if isinstance(node, Sequence):
            items = yield from every(self.apply(item) for item in node.items)
            same = all(a is b for a, b in zip(items, node.items, strict=True))
            return node if same else Sequence(tuple(items), node.span)
        values = yield from every(self.apply(entry.value) for entry in node.entries.values())
        if all(a is e.value for a, e in zip(values, node.entries.values(), strict=True)):
            return node
        pairs = zip(node.entries.items(), values, strict=True)
        entries = {key: entry._replace(value=value) for (key, entry), value in pairs}
        return Mapping(entries, node.span)

    def _scalar(self, node: Scalar) -> Diagnosed[Node]:
        match = _NAMED.match(node.text)
        if match is None:
            return node
        point = self._points.get(match[1])
        if point is None:
            message, hint = unknown_point(match[1], self._points)
            yield Diagnostic("KYB154", message, node.span, notes=origin(node), help=hint)
        numbers = (Scalar(repr(number), node.span) for number in point or ZERO)
        return Sequence(tuple(numbers), node.span)


def with_points(root: Mapping, points: MappingOf[str, Vec3]) -> Diagnosed[Mapping]:
    """The mission with coordinates in the place of `world.points.NAME`, but for the world's own."""
    pasting, entries = Points(points), dict(root.entries)
    for key, entry in root.entries.items():
        if key != "world":
            entries[key] = entry._replace(value=(yield from pasting.apply(entry.value)))
    return Mapping(entries, root.span)


def with_coordinates(
    parameters: MappingOf[str, Parameter], points: MappingOf[str, Vec3]
) -> dict[str, Parameter]:
    """The parameters, those that name a point with its coordinates."""
    return {
        name: p if p.type != "position" or not isinstance(p.value, str)
        else replace(p, value=points.get(p.value.removeprefix(PREFIX), ZERO))
        for name, p in parameters.items()
    }  # fmt: skip
