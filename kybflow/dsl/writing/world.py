"""The world of the resolved mission."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from kybflow.core.params import fields_of
from kybflow.core.units import LENGTH, NUMBER
from kybflow.dsl.document import Document
from kybflow.dsl.reading.source import PREFIX
from kybflow.dsl.shaping.world.tag_params import GridParams, TagParams
from kybflow.dsl.writing.values import Line, place, quantity, vector, written_fields
from kybflow.world.shapes import Box, Cylinder, Plane, Shape, Sphere


def world_lines(document: Document) -> Iterator[Line]:
    """The fence, the points, the obstacles and the tags; nothing where there are none."""
    at = place(document.spans.get("world"))
    parts = (document.fence, document.points, document.obstacles, document.tags)
    if not any(parts):
        return
    yield "world:", at
    if document.fence is not None:
        yield f"  fence: {{{_corners(document.fence)}}}", place(document.spans.get("fence"))
    if document.points:
        yield "  points:", at
        for name, point in document.points.items():
            # wherever it was named stand its coordinates now: the name is kept, as its use
            called = f"{document.point_spans[name].at}, {PREFIX}{name}"
            yield f"    {name}: {vector(point, LENGTH)}", called
    if document.obstacles:
        yield "  obstacles:", at
        for use in document.obstacles:
            yield f"    {use.name.text}: {{{_solid(use.shape)}}}", use.span.at
    if document.tags:
        yield "  tags:", at
        for tags in document.tags:
            yield f"    {tags.name.text}: {{{_tags(tags.params)}}}", tags.span.at


def _tags(params: Any) -> str:
    declaration: Any = type(params)
    fields = ", ".join(written_fields(params, fields_of(declaration)))
    match params:
        case GridParams():
            return f"grid: {{{fields}}}"
        case TagParams():
            return f"tag: {{{fields}}}"
        case _:
            return fields


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
