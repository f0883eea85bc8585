"""Reads the points and obstacles of a run from `mission.resolved.yaml`, and scanned obstacles from
the copies of their files in the run folder."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.core.geometry import Vec3
from kybflow.core.units import ANGLE, LENGTH, NUMBER, parse_quantity
from kybflow.world.obstacle_files import occupied_places, read_image, read_info, read_points
from kybflow.world.scanned import METRES, Columns, PointCloud, placed, thinned
from kybflow.world.shapes import Box, Cylinder, Plane, Shape, Sphere


@dataclass(frozen=True)
class RecordedWorld:
    """The named points and the obstacles of a mission, by name; metres, world frame."""

    points: dict[str, Vec3] = field(default_factory=dict)
    obstacles: dict[str, Shape] = field(default_factory=dict)


def read_world(path: Path) -> RecordedWorld:
    """Read the world of the mission file at `path`; an empty one if there is no file. Raises
    ValueError."""
    if not path.exists():
        return RecordedWorld()
    try:
        world = yaml.safe_load(path.read_text(encoding="utf-8")).get("world") or {}
        points = {name: _vector(at) for name, at in world.get("points", {}).items()}
        obstacles = {
            name: shape
            for name, found in world.get("obstacles", {}).items()
            if "moving_sphere" not in found and (shape := _shape(found, path.parent))
        }
    except (yaml.YAMLError, FileError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"`{path.name}` has no readable world: {error}") from error
    return RecordedWorld(points, obstacles)


def _shape(obstacle: dict[str, Any], folder: Path) -> Shape | None:
    ((kind, of),) = ((key, of) for key, of in obstacle.items() if isinstance(of, dict))
    if kind == "point_cloud":
        return _cloud(of, folder)
    if kind == "occupancy":
        return _columns(of, folder)
    if kind == "box":
        return Box(_vector(of["from"]), _vector(of["to"]))
    at = _vector(of["at"])
    if kind == "cylinder":
        return Cylinder(at, _length(of["radius"]), _length(of["height"]))
    if kind == "sphere":
        return Sphere(at, _length(of["radius"]))
    x, y, z = (parse_quantity(str(n), NUMBER) for n in of["facing"])
    return Plane(at, (x, y, z))


def _cloud(of: dict[str, Any], folder: Path) -> PointCloud | None:
    """Read a point cloud from the copy of its file; None if there is no copy."""
    file = _copy(folder, of["file"])
    if file is None:
        return None
    above = None if "above" not in of else _length(of["above"])
    heading = parse_quantity(str(of["heading"]), ANGLE)
    scan = read_points(file)
    points = placed(scan, METRES[of["units"]], _vector(of["at"]), heading, above)
    radius = _length(of["radius"])
    return PointCloud.of(thinned(points, radius), radius)


def _columns(of: dict[str, Any], folder: Path) -> Columns | None:
    """Read an occupancy map from the copies of its files; None if one is missing."""
    file = _copy(folder, of["file"])
    info = None if file is None else read_info(file)
    image = None if info is None else _copy((folder / of["file"]).parent, info.image)
    if info is None or image is None:
        return None
    places = occupied_places(info, read_image(image))
    low = _length(of["foot"])
    return Columns.over(places, info.resolution, low, low + _length(of["height"]))


def _copy(folder: Path, name: str) -> File | None:
    """Read the copy of a mission's file in a run folder; None if there is no copy."""
    try:
        text = (folder / name).read_bytes().decode("utf-8-sig", "surrogateescape")
    except OSError:
        return None
    return File(name, "", text)


def _vector(texts: list[str]) -> Vec3:
    x, y, z = (_length(text) for text in texts)
    return (x, y, z)


def _length(text: str) -> float:
    return parse_quantity(text, LENGTH)
