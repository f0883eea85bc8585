"""What a report about a behavior's way points at."""

from __future__ import annotations

from collections.abc import Iterable
from math import hypot

from kybflow.core.geometry import Vec3
from kybflow.core.units import LENGTH
from kybflow.dsl.document import State
from kybflow.dsl.reading.source import Span
from kybflow.parts import Footprint

_SAME = 1e-6


def aim_of(state: State, footprint: Footprint) -> Span:
    """The place that the behavior was told to go to, where it was; else the behavior's name."""
    part = state.part
    way = (*footprint.points, *footprint.path, *([footprint.exit] if footprint.exit else []))
    for field in part.spec.fields:
        if field.dimension is not LENGTH or field.shape not in ("vector", "path"):
            continue
        value = getattr(part.params, field.name)
        if field.name not in part.spans or value is None:
            continue
        if _leads((value,) if field.shape == "vector" else value, way):
            return part.spans[field.name]
    return part.name.span


def _leads(told: Iterable[Vec3], way: tuple[Vec3, ...]) -> bool:
    """Whether the way touches or passes above one of the places: the middle of a circle is none."""
    return any(hypot(t[0] - w[0], t[1] - w[1]) < _SAME for t in told for w in way)
