"""What was scanned, a `point_cloud` or an `occupancy` of `world.obstacles`, to its shape."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TypeVar

from kybflow.core.params import fields_of
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic
from kybflow.dsl.document import ObstacleEntry, Scan
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Scalar
from kybflow.dsl.reading.occupancy_map import occupied_places, read_image, read_info
from kybflow.dsl.reading.point_cloud import read_points
from kybflow.dsl.reading.values import decode
from kybflow.dsl.schema.world import MapImage, OccupancyParams, PointCloudParams
from kybflow.dsl.shaping.parts import params_of
from kybflow.world.columns import Columns
from kybflow.world.point_cloud import FARTHEST, METRES, MOST, PointCloud, placed, thinned
from kybflow.world.shapes import Scanned

CODES = {
    "KYB545": "Something scanned of which nothing is left, or more than can be kept away from.",
}
P = TypeVar("P")
Found = Diagnosed[tuple[Scanned, Scan] | None]


def scanned(
    name: Scalar, own: MappingEntry, may_touch: bool
) -> Diagnosed[tuple[ObstacleEntry, ...]]:
    """The obstacle; none, and a finding, where something is wrong with it."""
    found = None
    if isinstance(own.value, Mapping):
        found = yield from KINDS[own.key.text](own, own.value)
    if found is None:
        return ()
    shape, scan = found
    return (ObstacleEntry(name.as_text, shape, name.span, may_touch, scan),)


def _cloud(own: MappingEntry, body: Mapping) -> Found:
    of = yield from params_of(PointCloudParams, body, own.key.text, own.key.span)
    if of is None:
        return None
    points = placed(read_points(of.file), METRES[of.units], of.at, of.heading, of.above)
    span, wrong, hint = body.entries["file"].value.span, "", ""
    if not len(points):
        wrong, hint = "no point is higher than `above`", "lower `above`"
    elif abs(points).max() > FARTHEST:
        wrong = f"a point is more than {FARTHEST / 1000:g} km away"
        hint = "is it in millimetres? Then add `units: mm`"
    elif len(points := thinned(points, of.radius)) > MOST:
        wrong = f"{len(points)} points are left of it, and {MOST} can be kept away from"
        hint = "cut it to where the vehicles fly, or choose a larger `radius`"
    if wrong:
        yield Diagnostic("KYB545", f"`{of.file}`: {wrong}", span, help=hint)
        return None
    return PointCloud.of(points, of.radius), Scan(own.key.text, of, (of.file,), span)


def _occupancy(own: MappingEntry, body: Mapping) -> Found:
    of = yield from params_of(OccupancyParams, body, own.key.text, own.key.span)
    if of is None:
        return None
    info, span = read_info(of.file), body.entries["file"].value.span
    beside = os.path.join(os.path.dirname(of.file.name), info.image)
    image = yield from decode(Scalar(beside, span), fields_of(MapImage)[0])
    if image is None:
        return None
    places = occupied_places(info, read_image(image))
    if not 0 < len(places) <= MOST:
        wrong = f"{len(places)} of its cells are occupied, and {MOST} can be kept away from"
        hint = "cut it to where the vehicles fly, or make its cells larger"
        if not len(places):
            wrong, hint = "none of its cells is occupied", "look at `occupied_thresh` and `negate`"
        yield Diagnostic("KYB545", f"`{of.file}`: {wrong}", span, help=hint)
        return None
    shape = Columns.over(places, info.resolution, of.foot, of.foot + of.height)
    return shape, Scan(own.key.text, of, (of.file, image), span)


KINDS: dict[str, Callable[[MappingEntry, Mapping], Found]] = {
    "point_cloud": _cloud,
    "occupancy": _occupancy,
}
