"""The world and the vehicles as viewers draw them: entities of Foxglove's `SceneUpdate`.

What stands still is in the frame `world` (ENU, metres). A vehicle, a moving obstacle and an object
are locked to the frame with their name, which `kybflow.recording.viewers.channels` moves.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from itertools import product
from math import sqrt
from typing import Any

from foxglove import messages as fox

from kybflow.core.geometry import LEVEL, ZERO, Quat, Vec3, add, cross, from_axes, scale
from kybflow.core.signals import NS, Time
from kybflow.dsl.plan import Plan
from kybflow.recording.appearance import vehicle_colour
from kybflow.world.objects import boxes_of, unit
from kybflow.world.shapes import Box, Convex, Cylinder, Plane, Scanned, Sphere, parts_of

WORLD_FRAME = "world"
_FENCE, _OBSTACLE, _OBJECT, _REAR, _TAG = "#d1495b", "#7d8894", "#be8c32", "#404852", "#10151b"
_WALL = 20.0
"""Side of the square that stands for an infinite plane, m."""
_THIN = 0.002
"""Thickness of planes and tags, m."""


def true_frame(name: str) -> str:
    """Return the frame of a vehicle's true pose."""
    return f"{name}/true"


def colours(plan: Plan) -> dict[str, str]:
    """Return the colour `#rrggbb` of each vehicle, by name."""
    return {v.name: vehicle_colour(n) for n, v in enumerate(plan.vehicles)}


def colour(text: str, opacity: float = 1.0) -> fox.Color:
    r, g, b = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return fox.Color(r=r, g=g, b=b, a=opacity)


def stamp(now: Time) -> fox.Timestamp:
    return fox.Timestamp(now // NS, now % NS)


def vector(v: Vec3) -> fox.Vector3:
    return fox.Vector3(x=v[0], y=v[1], z=v[2])


def point(v: Vec3) -> fox.Point3:
    return fox.Point3(x=v[0], y=v[1], z=v[2])


def quaternion(q: Quat) -> fox.Quaternion:
    return fox.Quaternion(w=q[0], x=q[1], y=q[2], z=q[3])


def pose(position: Vec3, attitude: Quat = LEVEL) -> fox.Pose:
    return fox.Pose(position=vector(position), orientation=quaternion(attitude))


def scene(plan: Plan) -> fox.SceneUpdate:
    """Return everything whose shape doesn't change, except for scanned obstacles."""
    return fox.SceneUpdate(entities=[*_entities(plan)])


def scans(plan: Plan) -> fox.PointCloud | None:
    """Return the points of the scanned obstacles, None without any. A column is its two ends."""
    points = array("f")
    for shape in plan.obstacles.values():
        for part in parts_of(shape) if isinstance(shape, Scanned) else ():
            if isinstance(part, Cylinder):
                points.extend(add(part.at, (0.0, 0.0, part.height)))
            if not isinstance(part, Box):
                points.extend(part.at)
    if not points:
        return None
    kind = fox.PackedElementFieldNumericType.Float32
    fields = [
        fox.PackedElementField(name=axis, offset=4 * i, type=kind) for i, axis in enumerate("xyz")
    ]
    return fox.PointCloud(
        timestamp=stamp(0), frame_id=WORLD_FRAME, pose=pose(ZERO), point_stride=12, fields=fields,
        data=points.tobytes(),
    )  # fmt: skip


def _entities(plan: Plan) -> Iterator[fox.SceneEntity]:
    if plan.fence is not None:
        yield _entity("world/fence", WORLD_FRAME, lines=[_edges(plan.fence)])
    for name, shape in plan.obstacles.items():
        if not isinstance(shape, Scanned):
            yield _entity(name, WORLD_FRAME, **_solid(shape, colour(_OBSTACLE, 0.6)))
    if len(plan.tags):
        black = colour(_TAG)
        tags = [_cube(t.position, t.attitude, (t.size, t.size, _THIN), black) for t in plan.tags]
        yield _entity("world/tags", WORLD_FRAME, cubes=tags)
    for name, ball in plan.moving.items():
        yield _entity(name, name, **_solid(Sphere(ZERO, ball.radius), colour(_OBSTACLE)))
    for one in plan.objects.values():
        boxes = [
            _cube(at, turned, scale(half, 2.0), colour(_OBJECT))
            for at, turned, half in boxes_of(one)
        ]
        yield _entity(one.name, one.name, cubes=boxes)
    for vehicle, shade in zip(plan.vehicles, colours(plan).values(), strict=True):
        name, diameter = vehicle.name, vehicle.airframe.diameter
        label = fox.TextPrimitive(
            pose=pose((0.0, 0.0, 0.5 * diameter)), billboard=True, font_size=0.3 * diameter,
            text=name, color=colour(shade),
        )  # fmt: skip
        yield _entity(name, name, cylinders=_rotors(diameter, shade, 1.0), texts=[label])
        if plan.simulated:
            true = true_frame(name)
            yield _entity(true, true, cylinders=_rotors(diameter, shade, 0.3))


def _entity(name: str, frame: str, /, **primitives: Any) -> fox.SceneEntity:
    return fox.SceneEntity(
        timestamp=stamp(0), frame_id=frame, id=name, frame_locked=True, **primitives
    )


def _edges(box: Box) -> fox.LinePrimitive:
    """Return the edges of a box, each between two corners that differ in one coordinate."""
    corners = [(x, y, z) for x, y, z in product(*zip(*box, strict=True))]
    ends = [i | end for side in (1, 2, 4) for i in range(8) if not i & side for end in (0, side)]
    return fox.LinePrimitive(
        type=fox.LinePrimitiveLineType.LineList, pose=pose(ZERO), thickness=2.0,
        scale_invariant=True, points=[point(corners[i]) for i in ends], color=colour(_FENCE),
    )  # fmt: skip


def _solid(shape: Convex, color: fox.Color) -> dict[str, list[Any]]:
    """Return a shape as an argument of `_entity`."""
    match shape:
        case Box(low, high):
            return {"cubes": [_cube(scale(add(low, high), 0.5), LEVEL, shape.size, color)]}
        case Cylinder(at, radius, height):
            centre = add(at, (0.0, 0.0, 0.5 * height))
            return {"cylinders": [_cylinder(centre, radius, height, color)]}
        case Sphere(at, radius):
            size = vector((2.0 * radius,) * 3)
            return {"spheres": [fox.SpherePrimitive(pose=pose(at), size=size, color=color)]}
        case Plane(at, facing):
            aside = (0.0, 1.0, 0.0) if abs(facing[1]) < 0.9 else (1.0, 0.0, 0.0)
            across = unit(cross(facing, aside))
            attitude = from_axes(across, cross(facing, across), facing)
            return {"cubes": [_cube(at, attitude, (_WALL, _WALL, _THIN), color)]}


def _rotors(diameter: float, front: str, opacity: float) -> list[fox.CylinderPrimitive]:
    """Return the rotors of a vehicle, the front ones in its colour."""
    radius = 0.2 * diameter
    arm = (0.5 * diameter - radius) / sqrt(2.0)
    return [
        _cylinder((x, y, 0.0), radius, 0.1 * radius, colour(front if x > 0.0 else _REAR, opacity))
        for x, y in product((arm, -arm), repeat=2)
    ]


def _cube(at: Vec3, attitude: Quat, size: Vec3, color: fox.Color) -> fox.CubePrimitive:
    return fox.CubePrimitive(pose=pose(at, attitude), size=vector(size), color=color)


def _cylinder(at: Vec3, radius: float, height: float, color: fox.Color) -> fox.CylinderPrimitive:
    size = vector((2.0 * radius, 2.0 * radius, height))
    return fox.CylinderPrimitive(
        pose=pose(at), size=size, bottom_scale=1.0, top_scale=1.0, color=color
    )
