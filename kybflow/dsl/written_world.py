"""The world of the resolved mission."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.document import Document
from kybflow.dsl.written_values import Line, place, quantity, vector
from kybflow.shapes import Box, Cylinder, Plane, Shape, Sphere
from kybflow.units import LENGTH, NUMBER


def world_lines(document: Document) -> Iterator[Line]:
    """The fence, the points and the obstacles; nothing where there are none."""
    at = place(document.spans.get("world"))
    if document.fence is None and not document.points and not document.obstacles:
        return
    yield "world:", at
    if document.fence is not None:
        yield f"  fence: {{{_corners(document.fence)}}}", place(document.spans.get("fence"))
    if document.points:
        yield "  points:", at
        for name, point in document.points.items():
            yield f"    {name}: {vector(point, LENGTH)}", document.point_spans[name].at
    if document.obstacles:
        yield "  obstacles:", at
        for use in document.obstacles:
            yield f"    {use.name.text}: {{{_solid(use.shape)}}}", use.span.at


def _corners(box: Box) -> str:
    return f"from: {vector(box.low, LENGTH)}, to: {vector(box.high, LENGTH)}"


def _solid(shape: Shape) -> str:
    at = "" if isinstance(shape, Box) else f"at: {vector(shape.at, LENGTH)}"
    match shape:
        case Box():
            return f"box: {{{_corners(shape)}}}"
        case Cylinder(_, radius, height):
            size = f"radius: {quantity(radius, LENGTH)}, height: {quantity(height, LENGTH)}"
            return f"cylinder: {{{at}, {size}}}"
        case Sphere(_, radius):
            return f"sphere: {{{at}, radius: {quantity(radius, LENGTH)}}}"
        case Plane(_, facing):
            return f"plane: {{{at}, facing: {vector(facing, NUMBER)}}}"
