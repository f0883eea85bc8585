"""Draws the solids of a simulated room, which are obstacles and a released parcel, each in one grey
level.

Solids are convex, and so are their images: the hull of the projected corners, clipped at the lens
and at the image's edges. Points are stored as (X/Z, Y/Z, 1/Z) of the optical frame, in which
straight lines stay straight and depth can be interpolated. The outline is then distorted by the
lens, with each point at the exposure time of its row.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from math import pi, sqrt
from types import MappingProxyType
from typing import NamedTuple

import cv2
import numpy

from kybflow.core.geometry import Vec3, add, norm, scale, sub
from kybflow.vision.projection import Array
from kybflow.vision.rendering.shot import MAX_DEPTH, Shot, grid
from kybflow.world.shapes import Box, Convex, Cylinder, Plane, Shape, Sphere, parts_of

NONE: Mapping[str, Shape] = MappingProxyType({})
_STEP = 8
"""Distance between the grid nodes that bound the image, pixels; also the number of points per edge
of an outline."""
_NEAR_PLANE = 0.01
"""Depth of the near clipping plane, metres."""
_MARGIN = 0.03
"""Clipping margin around the image, as a tangent; points may move while rows are exposed."""
_CORNERS = 32
"""Number of corners that stand for a circle."""
_GREYS = 40, 200
_TOUCHING, _STEPS = 0.005, 64


class Solid(NamedTuple):
    """A shape to draw. centre, radius: a ball that contains it."""

    shape: Convex
    grey: int
    centre: Vec3
    radius: float


class Solids:
    """The obstacles of a room and a parcel. parcel: side of the parcel, metres. Infinite planes are
    not drawn. The same seed gives the same grey levels."""

    def __init__(self, obstacles: Mapping[str, Shape], parcel: float, seed: int) -> None:
        self._fixed = [
            Solid(shape, _grey(seed, name), *_ball(shape))
            for name, whole in obstacles.items()
            for shape in parts_of(whole)
            if not isinstance(shape, Plane)
        ]
        self._half = (0.5 * parcel,) * 3
        self._parcel_grey = _grey(seed, "")
        self._centres = numpy.array([solid.centre for solid in self._fixed]).reshape(-1, 3)
        self._radii = numpy.array([solid.radius for solid in self._fixed])

    def in_view(self, shot: Shot, payload: Vec3 | None) -> list[Solid]:
        """Return the solids that may be in the image, the farthest first. payload: the centre of
        the parcel, which is aligned with the world's axes; None if it is not visible."""
        near: list[Solid] = []
        if self._fixed:  # whose balls intersect the cone of the image's outermost rays
            (turn,), (at,) = shot.poses(numpy.zeros(1))
            local = (self._centres - at) @ turn
            rays = grid(shot.camera.lens, _STEP).rays
            wide = float(numpy.hypot(rays[..., 0], rays[..., 1]).max()) + _MARGIN
            aside = numpy.hypot(local[:, 0], local[:, 1]) - wide * local[:, 2]
            depth = numpy.abs(local[:, 2] - 0.5 * MAX_DEPTH) - 0.5 * MAX_DEPTH
            met = (depth < self._radii) & (aside < self._radii * sqrt(1.0 + wide * wide))
            near = [self._fixed[i] for i in numpy.flatnonzero(met)]
        if payload is not None:
            box = Box(sub(payload, self._half), add(payload, self._half))
            near.append(Solid(box, self._parcel_grey, *_ball(box)))
        eye: Vec3 = tuple(shot.place.tolist())
        return sorted(near, key=lambda solid: -solid.shape.distance(eye))


def cover(image: Array, shot: Shot, solid: Solid) -> None:
    """Draw a solid into the image; it fills the whole image if the lens is inside the solid."""
    eye: Vec3 = tuple(shot.place.tolist())
    if solid.shape.distance(eye) <= 0.0:
        image[:] = solid.grey
        return
    rim = _rim(shot, _corners(solid.shape, eye))
    if len(rim) > 2:
        pixels = (16.0 * rim).round().astype(numpy.int32)
        cv2.fillPoly(image, [pixels], solid.grey, cv2.LINE_AA, 4)


def hides(solid: Solid, eye: Vec3, goal: Vec3) -> bool:
    """Return whether a solid lies between two points, by sphere tracing (Hart 1996). `goal` may be
    on the solid's surface."""
    way = sub(goal, eye)
    length = norm(way)
    gone = 0.0
    if length <= _TOUCHING:
        return False
    for _ in range(_STEPS):
        free = solid.shape.distance(add(eye, scale(way, gone / length)))
        if free < 0.1 * _TOUCHING:
            return True
        gone += free
        if gone > length - _TOUCHING:
            return False
    return False


def _rim(shot: Shot, corners: Array) -> Array:
    """Return the outline of a convex solid in the image, pixels (n, 2); empty if the solid is not
    in the image."""
    (turn,), (at,) = shot.poses(numpy.zeros(1))
    local = (corners - at) @ turn
    local = _part(local, local[:, 2] - _NEAR_PLANE)
    points = _hull(numpy.column_stack((local[:, :2], numpy.ones(len(local)))) / local[:, 2:])
    rays = grid(shot.camera.lens, _STEP).rays[..., :2]
    low, high = rays.min(axis=(0, 1)) - _MARGIN, rays.max(axis=(0, 1)) + _MARGIN
    for axis in (0, 1):
        points = _hull(_part(points, points[:, axis] - low[axis]))
        points = _hull(_part(points, high[axis] - points[:, axis]))
    if len(points) < 3:
        return numpy.empty((0, 2))
    along = numpy.arange(_STEP)[:, None] / _STEP
    edges = points[:, None] + along * (numpy.roll(points, -1, axis=0) - points)[:, None]
    flat = edges.reshape(-1, 3)
    rays = numpy.column_stack((flat[:, :2], numpy.ones(len(flat)))) / flat[:, 2:]
    pixels, imaged = shot.project(rays @ turn.T + at, passes=2)
    rim: Array = pixels[imaged]
    return rim


def _part(points: Array, beyond: Array) -> Array:
    """Clip the hull of points to the half-space where `beyond`, a linear function of the points, is
    positive. Return points whose hull is the clipped hull."""
    is_in = beyond > 0.0
    if is_in.all():
        return points
    inside, outside = points[is_in], points[~is_in]
    above, below = beyond[is_in][:, None], beyond[~is_in][None]
    share = (above / (above - below))[..., None]
    cuts = inside[:, None] + share * (outside[None] - inside[:, None])
    return numpy.concatenate((inside, cuts.reshape(-1, points.shape[1])))


def _hull(points: Array) -> Array:
    """Return those points (x, y, 1/z) that are corners of the hull in x and y, in order."""
    if len(points) < 3:
        return points[:0]
    flat = points[:, :2].astype(numpy.float32)
    corners: Array = points[cv2.convexHull(flat, returnPoints=False).ravel()]
    return corners


def _corners(shape: Convex, eye: Vec3) -> Array:
    """Return points (n, 3) whose hull has the same outline as the shape, seen from `eye`."""
    turn = numpy.linspace(0.0, 2.0 * pi, _CORNERS, endpoint=False)
    ring = numpy.column_stack((numpy.cos(turn), numpy.sin(turn)))
    match shape:
        case Cylinder((x, y, z), radius, height):
            level = radius * ring + (x, y)
            ends = [numpy.column_stack((level, numpy.full(_CORNERS, h))) for h in (z, z + height)]
            return numpy.concatenate(ends)
        case Sphere(at, radius):
            # where rays are tangent: a circle around the line from the eye to the centre
            way = numpy.array(sub(at, eye))
            far = float(numpy.linalg.norm(way))
            share = radius / far
            across = numpy.linalg.svd(way[None])[2][1:]
            rim: Array = (
                at - share * share * way + radius * sqrt(1.0 - share * share) * ring @ across
            )
            return rim
        case Box(low, high):
            sides = numpy.meshgrid(*zip(low, high, strict=True))
            return numpy.stack(sides, axis=-1).reshape(-1, 3)
        case Plane():
            raise ValueError("an infinite plane has no corners")


def _ball(shape: Convex) -> tuple[Vec3, float]:
    """Return the centre and radius of a ball that contains a shape."""
    match shape:
        case Cylinder(at, radius, height):
            return add(at, (0.0, 0.0, 0.5 * height)), norm((radius, 0.5 * height, 0.0))
        case Sphere(at, radius):
            return at, radius
        case Box(low, high):
            return scale(add(low, high), 0.5), 0.5 * norm(sub(high, low))
        case Plane():
            raise ValueError("an infinite plane has no centre")


def _grey(seed: int, name: str) -> int:
    return random.Random(f"{seed}/solid/{name}").randrange(*_GREYS)
