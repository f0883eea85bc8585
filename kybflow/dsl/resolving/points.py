"""Named points of the world: coordinates in the place of `world.points.NAME`."""

from __future__ import annotations

import re
from collections.abc import Mapping as MappingOf
from dataclasses import replace
from typing import Any

from kybflow.core.geometry import ZERO, Vec3
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, did_you_mean, every
from kybflow.dsl.document import Parameter
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, Sequence
from kybflow.dsl.reading.source import PREFIX
from kybflow.dsl.reading.values import origin

CODES = {
    "KYB154": "`world.points.NAME` where the world has no such point.",
}
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
            self._done[id(node)] = (node, (yield from self._inside(node)))
        return self._done[id(node)][1]

    def _inside(self, node: Mapping | Sequence) -> Diagnosed[Node]:
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


def placed(
    parameters: MappingOf[str, Parameter], points: MappingOf[str, Vec3]
) -> dict[str, Parameter]:
    """The parameters, those that name a point with its coordinates."""
    return {
        name: p if p.type != "position" or not isinstance(p.value, str)
        else replace(p, value=points.get(p.value.removeprefix(PREFIX), ZERO))
        for name, p in parameters.items()
    }  # fmt: skip
