"""`world:` to the fence, the named points, the obstacles and the printed tags."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import sqrt
from typing import NamedTuple

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.units import LENGTH, NUMBER
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.document import ObstacleUse, TagsUse
from kybflow.dsl.reading.nodes import Entry, Mapping, Node, entries_of, head_of
from kybflow.dsl.reading.source import Span
from kybflow.dsl.reading.values import decode, quantity_field
from kybflow.dsl.shaping.world.tags import tags_in
from kybflow.world.shapes import Box, Cylinder, Plane, Shape, Sphere

CODES = {
    "KYB153": "A fence whose corners are in the wrong order.",
    "KYB155": "An obstacle that is no solid, or several.",
    "KYB156": "An obstacle with no inside: a box with its corners in the wrong order, a plane that "
    "faces nowhere.",
}


class World(NamedTuple):
    """What of the world the mission says."""

    fence: Box | None
    points: dict[str, Vec3]
    point_spans: dict[str, Span]
    obstacles: tuple[ObstacleUse, ...]
    tags: tuple[TagsUse, ...]


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
        tags=tuple(tags_in(_value(entries.get("tags")), found)),
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
    if not _is_whole(entry.value, "fence", _CORNERS, found):
        return None
    box = _corners(entry.value, found)
    if box is not None and not _has_inside(box):
        message, hint = "the fence has no inside", _ORDER
        found.append(Diagnostic("KYB153", message, entry.key.span, help=hint))
    return box


def _is_whole(body: Mapping, what: str, keys: tuple[str, ...], found: list[Diagnostic]) -> bool:
    """Whether nothing is missing, now that what a `like` brings is there."""
    missing = [key for key in keys if body.get(key) is None]
    for key in missing:
        found.append(Diagnostic("KYB102", f"a {what} needs `{key}`", head_of(body)))
    return not missing


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
        if isinstance(solid.value, Mapping) and _is_whole(solid.value, kind, _KEYS[kind], found):
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


_CORNERS = ("from", "to")
_KEYS = {
    "box": _CORNERS,
    "cylinder": ("at", "radius", "height"),
    "sphere": ("at", "radius"),
    "plane": ("at", "facing"),
}
_SOLIDS: dict[str, Callable[[Mapping, list[Diagnostic]], Shape | None]] = {
    "box": _box,
    "cylinder": _cylinder,
    "sphere": _sphere,
    "plane": _plane,
}
