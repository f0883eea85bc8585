"""A `point_cloud` of `world.obstacles` to its shape: the points that are kept, in the world."""

from __future__ import annotations

from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic
from kybflow.dsl.document import ObstacleEntry, Scan
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Scalar
from kybflow.dsl.reading.point_cloud import read_points
from kybflow.dsl.schema.world import PointCloudParams
from kybflow.dsl.shaping.parts import params_of
from kybflow.world.point_cloud import FARTHEST, METRES, MOST, PointCloud, placed, thinned

CODES = {
    "KYB545": "A point cloud of which nothing is left, or more than can be kept away from.",
}


def scanned(
    name: Scalar, own: MappingEntry, may_touch: bool
) -> Diagnosed[tuple[ObstacleEntry, ...]]:
    """The obstacle; none, and a finding, where something is wrong with it."""
    if not isinstance(own.value, Mapping):
        return ()
    of = yield from params_of(PointCloudParams, own.value, own.key.text, own.key.span)
    if of is None:
        return ()
    points = placed(read_points(of.file), METRES[of.units], of.at, of.heading, of.above)
    span, wrong, hint = own.value.entries["file"].value.span, "", ""
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
        return ()
    shape = PointCloud(tuple(map(tuple, points.tolist())), of.radius)
    return (ObstacleEntry(name.as_text, shape, name.span, may_touch, Scan(of, span)),)
