"""What stands in the world of a run, read from its `mission.resolved.yaml`: named points and
obstacles. Metres, world frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from kybflow.core.geometry import Vec3
from kybflow.core.units import LENGTH, NUMBER, parse_quantity
from kybflow.world.shapes import Box, Cylinder, Plane, Shape, Sphere


@dataclass(frozen=True)
class World:
    """Points and obstacles by name."""

    points: dict[str, Vec3] = field(default_factory=dict)
    obstacles: dict[str, Shape] = field(default_factory=dict)


def read_world(path: Path) -> World:
    """The world of the mission in `path`; an empty one without such a file. Raises ValueError for
    one that no run has written."""
    if not path.exists():
        return World()
    try:
        world = yaml.safe_load(path.read_text(encoding="utf-8")).get("world") or {}
        points = {name: _vector(at) for name, at in world.get("points", {}).items()}
        obstacles = {name: _shape(solid) for name, solid in world.get("obstacles", {}).items()}
    except (yaml.YAMLError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"`{path.name}` has no world that can be read: {error}") from error
    return World(points, obstacles)


def _shape(solid: dict[str, dict[str, Any]]) -> Shape:
    ((kind, of),) = solid.items()
    if kind == "box":
        return Box(_vector(of["from"]), _vector(of["to"]))
    at = _vector(of["at"])
    if kind == "cylinder":
        return Cylinder(at, _length(of["radius"]), _length(of["height"]))
    if kind == "sphere":
        return Sphere(at, _length(of["radius"]))
    x, y, z = (parse_quantity(str(n), NUMBER) for n in of["facing"])
    return Plane(at, (x, y, z))


def _vector(texts: list[str]) -> Vec3:
    x, y, z = (_length(text) for text in texts)
    return (x, y, z)


def _length(text: str) -> float:
    return parse_quantity(text, LENGTH)
