"""Expand `world:` to its solids and printed tags, and replace `world.points.NAME` by
coordinates."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from collections.abc import Mapping as MappingOf
from math import pi, sqrt
from typing import Any

from kybflow.core.files import File
from kybflow.core.geometry import (
    LEVEL,
    UP,
    ZERO,
    Quat,
    Vec3,
    add,
    from_axes,
    from_heading,
    multiply,
    rotate,
)
from kybflow.core.names import CHARACTER
from kybflow.core.params import RecordOf, fields_of
from kybflow.core.text import did_you_mean
from kybflow.core.units import LENGTH, format_measured, format_quantity
from kybflow.dsl.diagnostics import PREFIX, Collector
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.language.records import EMPTY
from kybflow.dsl.plan import Parameter
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    entries_of,
    is_null,
)
from kybflow.dsl.reading.values import decode_value, origin
from kybflow.dsl.world import (
    BoxParams,
    CylinderParams,
    GridParams,
    MapImage,
    Obstacle,
    OccupancyParams,
    PlaneParams,
    PointCloudParams,
    SphereParams,
    TagParams,
    Tags,
    World,
)
from kybflow.vision.tags import FAMILIES, read_tags
from kybflow.world.obstacle_files import occupied_places, read_image, read_info, read_points
from kybflow.world.scanned import (
    MAX_RANGE,
    METRES,
    MOST_POINTS,
    Columns,
    PointCloud,
    placed,
    thinned,
)
from kybflow.world.shapes import Box, Cylinder, MovingSphere, Plane, Shape, Sphere
from kybflow.world.tags import Tag

CODES = {
    "KYB153": "The corners of the fence are in the wrong order.",
    "KYB154": "`world.points.NAME` names an unknown point.",
    "KYB155": "An obstacle is not exactly one solid.",
    "KYB156": "An obstacle has no inside, such as a box with its corners in the wrong order, or a "
    "plane without a direction.",
    "KYB162": "The fence has a side that is too short to fly in, such as a height of 3 cm.",
    "KYB380": "An entry of `tags` is not exactly one of a grid, a tag and a file.",
    "KYB381": "A tag has a number that its family doesn't have.",
    "KYB382": "A grid of tags is invalid: its `count` is not two numbers, or it leaves out tags "
    "that it doesn't have, or all of them.",
    "KYB545": "A scan or a map has no points left, or too many of them.",
}
_ORDER = "each number of `from` must be below that of `to`"
_SOLIDS = tuple(f.key for f in fields_of(Obstacle) if isinstance(f.type, RecordOf))
_OF_TAGS = ("grid", "tag", "file")


def world_of(node: Node | None, decoder: Decoder) -> World:
    """Return the world of a mission, without the entries that have errors."""
    body = node if isinstance(node, Mapping) else EMPTY
    obstacles, tags = (entries_of(body.get(key)).values() for key in ("obstacles", "tags"))
    made = tuple(o for e in obstacles if (o := _obstacle(e, decoder)) is not None)
    printed = tuple(t for e in tags if (t := _tags(e, decoder)) is not None)
    world = decoder.record(World, body, body.span, obstacles=made, tags=printed)
    if world is None:
        return World(obstacles=made, tags=printed)
    points = entries_of(body.get("points"))
    lost = {n: ZERO for n, e in points.items() if n not in world.points and not is_null(e.value)}
    box = None if world.fence is None else Box(world.fence.low, world.fence.high)
    if box is not None and not _has_inside(box):
        message = f"the fence is empty: {_crossed(box)}"
        decoder.found.report("KYB153", message, world.fence.span, help=_ORDER)
    elif box is not None and (narrow := _narrowest(box))[0] < _LEAST_ROOM:
        size, what = narrow
        message = f"the fence is {format_measured(size, 'm')} {what}"
        hint = f"are metres meant? write `{format_quantity(100.0 * size, LENGTH)}` for it"
        decoder.found.report("KYB162", message, world.fence.span, help=hint)
    whole: World = world.but(box=box, points={**world.points, **lost})
    return whole


def _has_inside(box: Box) -> bool:
    return all(a < b for a, b in zip(box.low, box.high, strict=True))


def _narrowest(box: Box) -> tuple[float, str]:
    """Return the shortest side of a box, in metres, and what it is called."""
    names = ("wide along x", "wide along y", "high")
    return min((b - a, name) for a, b, name in zip(box.low, box.high, names, strict=True))


_LEAST_ROOM = 0.2
"""The shortest side of a room in which anything flies, metres."""


def _crossed(box: Box) -> str:
    """Return the first axis along which a box is empty, in words: `1 m to 0 m along x`."""
    low, high, axis = next(c for c in zip(box.low, box.high, "xyz", strict=True) if c[0] >= c[1])
    return f"{low:g} m to {high:g} m along {axis}"


def _obstacle(entry: MappingEntry, decoder: Decoder) -> Obstacle | None:
    """Return the obstacle with its shape, or None if it has errors, which are reported."""
    name, found = entry.key, decoder.found
    kind = only_kind(entry, _SOLIDS, "KYB155", "obstacle `{}` is", "nothing solid", found)
    if kind is None:
        return None
    obstacle: Obstacle | None = decoder.record(Obstacle, entry.value, name.span, name=name.text)
    if obstacle is None or (solid := getattr(obstacle, kind)) is None:
        return None
    if isinstance(solid, MovingSphere):
        return obstacle
    shape, files = _solid(solid, found)
    return None if shape is None else obstacle.but(shape=shape, files=files)


def only_kind(
    entry: MappingEntry,
    kinds: tuple[str, ...],
    code: str,
    what: str,
    nothing: str,
    found: Collector,
) -> str | None:
    """Return the one of `kinds` that an entry has. If it has none or several, report `code` and
    return None."""
    written = [k for k, e in entries_of(entry.value).items() if k in kinds and not is_null(e.value)]
    if len(written) == 1:
        return written[0]
    own = " and ".join(f"a {kind}" for kind in written) or nothing
    hint = f"write one of {', '.join(f'`{kind}`' for kind in kinds[:-1])} and `{kinds[-1]}`"
    found.report(code, f"the {what.format(entry.key.text)} {own}", entry.key.span, help=hint)
    return None


def _solid(solid: Any, found: Collector) -> tuple[Shape | None, tuple[File, ...]]:
    """Return the shape of an obstacle and the files that it was made from. The shape is None if it
    has errors, which are reported."""
    match solid:
        case BoxParams():
            box = Box(solid.low, solid.high)
            if _has_inside(box):
                return box, ()
            span = solid.source.node.span
            found.report("KYB156", f"the box is empty: {_crossed(box)}", span, help=_ORDER)
        case CylinderParams():
            return Cylinder(solid.at, solid.radius, solid.height), ()
        case SphereParams():
            return Sphere(solid.at, solid.radius), ()
        case PlaneParams():
            if any(solid.facing):
                x, y, z = solid.facing
                norm = sqrt(x * x + y * y + z * z)
                return Plane(solid.at, (x / norm, y / norm, z / norm)), ()
            hint = "`facing` is a direction, like `[1, 0, 0]`"
            found.report("KYB156", "the plane faces nowhere", solid.span_of("facing"), help=hint)
        case PointCloudParams():
            return _cloud(solid, found), (solid.file,)
        case OccupancyParams():
            beside = os.path.join(os.path.dirname(solid.file.name), read_info(solid.file).image)
            node = Scalar(beside, solid.span_of("file"))
            image = decode_value(node, fields_of(MapImage)[0], found)
            columns = None if image is None else _columns(solid, image, found)
            return columns, (solid.file, image)
    return None, ()


def _cloud(scan: PointCloudParams, found: Collector) -> PointCloud | None:
    points = placed(read_points(scan.file), METRES[scan.units], scan.at, scan.heading, scan.above)
    wrong, hint = "", ""
    if not len(points):
        wrong, hint = "no point is higher than `above`", "lower `above`"
    elif abs(points).max() > MAX_RANGE:
        wrong = f"a point is more than {MAX_RANGE / 1000:g} km away"
        hint = "is it in millimetres? Then add `units: mm`"
    elif len(points := thinned(points, scan.radius)) > MOST_POINTS:
        wrong = f"{len(points)} points are left of it, and {MOST_POINTS} can be kept away from"
        hint = "cut it to where the vehicles fly, or choose a larger `radius`"
    if wrong:
        found.report("KYB545", f"`{scan.file}`: {wrong}", scan.span_of("file"), help=hint)
        return None
    return PointCloud.of(points, scan.radius)


def _columns(chart: OccupancyParams, image: File, found: Collector) -> Columns | None:
    info = read_info(chart.file)
    places = occupied_places(info, read_image(image))
    if 0 < len(places) <= MOST_POINTS:
        return Columns.over(places, info.resolution, chart.foot, chart.foot + chart.height)
    wrong = f"{len(places)} of its cells are occupied, and {MOST_POINTS} can be kept away from"
    hint = "cut it to where the vehicles fly, or make its cells larger"
    if not len(places):
        wrong, hint = "none of its cells is occupied", "look at `occupied_thresh` and `negate`"
    found.report("KYB545", f"`{chart.file}`: {wrong}", chart.span_of("file"), help=hint)
    return None


_NAMED = re.compile(rf"world\.points\.({CHARACTER}+)\Z")


class Points:
    """Replaces `world.points.NAME` by coordinates. A node without such a name is returned
    unchanged, and an aliased node is replaced once."""

    def __init__(self, points: MappingOf[str, Vec3], found: Collector) -> None:
        self._points = points
        self._found = found
        self._done: dict[int, tuple[Node, Node]] = {}

    def apply(self, node: Node) -> Node:
        """Return `node` with coordinates in place of every value that names a point."""
        if isinstance(node, Scalar):
            match = _NAMED.match(node.text)
            return node if match is None else self._coordinates(match[1], node)
        if id(node) not in self._done:
            self._done[id(node)] = (node, self._replaced(node))
        return self._done[id(node)][1]

    def _replaced(self, node: Mapping | Sequence) -> Node:
        if isinstance(node, Sequence):
            items = [self.apply(item) for item in node.items]
            same = all(a is b for a, b in zip(items, node.items, strict=True))
            return node if same else Sequence(tuple(items), node.span)
        entries = {k: e._replace(value=self.apply(e.value)) for k, e in node.entries.items()}
        same = all(entries[key].value is e.value for key, e in node.entries.items())
        return node if same else Mapping(entries, node.span)

    def _coordinates(self, name: str, node: Scalar) -> Sequence:
        point = self._points.get(name)
        if point is None:
            message = f"the world has no point `{name}`"
            hint = did_you_mean(name, self._points) or "name it under `points` of `world`"
            self._found.report("KYB154", message, node.span, notes=origin(node), help=hint)
        numbers = (Scalar(repr(number), node.span) for number in point or ZERO)
        return Sequence(tuple(numbers), node.span)


def with_points(root: Mapping, points: MappingOf[str, Vec3], found: Collector) -> Mapping:
    """Return the mission with coordinates in place of `world.points.NAME`, except inside the world
    itself."""
    place = Points(points, found).apply
    entries = {k: e._replace(value=place(e.value)) for k, e in root.entries.items() if k != "world"}
    return Mapping({**root.entries, **entries}, root.span)


def with_coordinates(
    parameters: MappingOf[str, Parameter], points: MappingOf[str, Vec3]
) -> dict[str, Parameter]:
    """Return the parameters, with coordinates in place of the names of points."""

    def placed(value: Any) -> Any:
        if isinstance(value, str):
            return points.get(value.removeprefix(PREFIX), ZERO)
        return tuple(map(placed, value)) if isinstance(value, tuple) else value

    return {
        name: p._replace(value=placed(p.value)) if p.type in ("position", "path") else p
        for name, p in parameters.items()
    }


_NORTH: Vec3 = (0.0, 1.0, 0.0)
_EASTWARD = from_axes(_NORTH, UP, (1.0, 0.0, 0.0))
_FACING: dict[str, Quat] = {
    "up": LEVEL,
    "down": from_axes((-1.0, 0.0, 0.0), _NORTH, (0.0, 0.0, -1.0)),
    "east": _EASTWARD,
    "north": multiply(from_heading(pi / 2), _EASTWARD),
    "west": multiply(from_heading(pi), _EASTWARD),
    "south": multiply(from_heading(-pi / 2), _EASTWARD),
}
"""The attitude of a tag with heading 0 whose printed side faces in the given direction."""


def _tags(entry: MappingEntry, decoder: Decoder) -> Tags | None:
    """Return an entry of `world.tags` with its tags, or None if it has errors, which are
    reported."""
    name, found = entry.key, decoder.found
    if only_kind(entry, _OF_TAGS, "KYB380", "tags `{}` are", "nothing", found) is None:
        return None
    tags: Tags | None = decoder.record(Tags, entry.value, name.span, name=name.text)
    if tags is None:
        return None
    if tags.file is not None:
        rows = read_tags(tags.file)
        lines = tuple(row.line for row in rows)
        source = tags.source._replace(span=tags.span_of("file"))
        return tags.but(tags=tuple(r.tag for r in rows), lines=lines, source=source)
    if (grid := tags.grid) is not None and _is_grid(grid, found):
        return tags.but(tags=tuple(tags_of(grid)))
    if (one := tags.tag) is None:
        return None
    most = FAMILIES[one.family][1] - 1
    if one.id <= most:
        return tags.but(tags=(tag_of(one),))
    message, hint = (
        f"the family `{one.family}` has no tag {one.id}",
        f"choose an `id` from 0 to {most}",
    )
    found.report("KYB381", message, one.span_of("id"), help=hint)
    return None


def _is_grid(grid: GridParams, found: Collector) -> bool:
    """Return whether `count` and `leave_out` are valid for the grid and its family; report it if
    not."""
    if len(grid.count) != 2:
        message = f"`count` must be [columns, rows], but this is a list of {len(grid.count)}"
        found.report("KYB382", message, grid.span_of("count"), help="write it like `[10, 10]`")
        return False
    last = grid.first + grid.count[0] * grid.count[1] - 1
    size = FAMILIES[grid.family][1]
    if last >= size:
        columns, rows = grid.count
        message = (
            f"a grid of {columns} by {rows} needs {columns * rows} tags, but the family "
            f"`{grid.family}` has only {size}"
        )
        if grid.first:
            message = f"the grid needs the tags {grid.first} to {last}, but the last is {size - 1}"
        hint = "use a smaller `count` or `first`, or another family"
        found.report("KYB381", message, grid.span_of("count"), help=hint)
        return False
    strange = [number for number in grid.leave_out if not grid.first <= number <= last]
    message, hint = "", f"name some of its tags, {grid.first} to {last}"
    if strange:
        message = f"the grid has no tag {strange[0]} to leave out"
    elif len(set(grid.leave_out)) > last - grid.first:
        message, hint = "the grid leaves out every tag", "keep at least one"
    if message:
        found.report("KYB382", message, grid.span_of("leave_out"), help=hint)
    return not message


def tag_of(tag: TagParams) -> Tag:
    return Tag(tag.family, tag.id, tag.size, tag.at, _attitude(tag))


def tags_of(grid: GridParams) -> Iterator[Tag]:
    """Yield the tags of a grid, without those left out. `count` must have two numbers."""
    (columns, rows), pitch = grid.count, grid.size + grid.spacing
    down = -pitch if grid.rows == "down" else pitch
    attitude, missing = _attitude(grid), frozenset(grid.leave_out)
    for row in range(rows):
        for column in range(columns):
            number = grid.first + row * columns + column
            if number not in missing:
                at = add(grid.at, rotate(attitude, (column * pitch, row * down, 0.0)))
                yield Tag(grid.family, number, grid.size, at, attitude)


def _attitude(params: GridParams | TagParams) -> Quat:
    return multiply(from_heading(params.heading), _FACING[params.facing])
