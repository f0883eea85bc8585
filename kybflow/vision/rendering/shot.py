"""The rays and poses of a moving camera while its rows are exposed.

Smooth quantities are computed at the nodes of a grid over the image, and interpolated to pixels.
The middle of row v's exposure is t = (v - (height - 1)/2) row_time after the middle of the image's
exposure. At that time the body's position is p + v t and its attitude q exp(w t), with constant
velocity v and body rates w.
"""

from __future__ import annotations

import functools
from typing import NamedTuple, cast

import cv2
import numpy

from kybflow.core.signals import Truth
from kybflow.vision.projection import Array, distort, reach, rotation, undistort
from kybflow.world.cameras import Camera, Lens

NO_MAP = cast("Array", None)
"""Second map for `cv2.remap` if the first map has both coordinates; OpenCV's type hints don't allow
None."""


class Region(NamedTuple):
    """A rectangle of pixels; `right` and `bottom` are exclusive."""

    left: int
    top: int
    right: int
    bottom: int


class Grid:
    """Nodes every `step` pixels, with one ring of nodes outside the image.

    pixels: (rows, columns, 2), positions of the nodes in the image. rays: (rows, columns, 3), rays
    through the nodes in the optical frame, with z = 1.
    """

    def __init__(self, lens: Lens, step: int) -> None:
        self.step = step
        self.whole = Region(0, 0, lens.width, lens.height)
        x = self._places(lens.width)
        y = self._places(lens.height)
        self.pixels = numpy.stack(numpy.meshgrid(x, y), axis=-1)
        flat = undistort(lens, self.pixels)
        self.rays = numpy.concatenate((flat, numpy.ones((len(y), len(x), 1))), axis=-1)

    def _places(self, length: int) -> Array:
        return self.step * numpy.arange(-1, -(-length // self.step) + 1) + (self.step - 1) / 2.0

    def around(self, region: Region) -> tuple[slice, slice]:
        """Return the slices of rows and of columns of the nodes around a region of pixels."""
        return (
            slice(region.top // self.step, (region.bottom - 1) // self.step + 3),
            slice(region.left // self.step, (region.right - 1) // self.step + 3),
        )

    def beside(self, nodes: Array) -> Region:
        """Return the region of pixels around the nodes that are True. nodes: (rows, columns)."""
        rows, columns = numpy.flatnonzero(nodes.any(axis=1)), numpy.flatnonzero(nodes.any(axis=0))
        return Region(
            max(0, self.step * int(columns[0] - 2)),
            max(0, self.step * int(rows[0] - 2)),
            max(1, min(self.whole.right, self.step * int(columns[-1] + 1))),
            max(1, min(self.whole.bottom, self.step * int(rows[-1] + 1))),
        )

    def fill(self, values: Array, region: Region) -> Array:
        """Return `values`, given at the nodes `around` a region, linearly interpolated to the
        region's pixels: (height, width, channels) float32."""
        height, width = values.shape[:2]
        size = (width * self.step, height * self.step)
        filled = cv2.resize(values.astype(numpy.float32), size, interpolation=cv2.INTER_LINEAR)
        top = region.top % self.step + self.step
        left = region.left % self.step + self.step
        return filled[
            top : top + region.bottom - region.top, left : left + region.right - region.left
        ]


@functools.lru_cache(maxsize=16)
def grid(lens: Lens, step: int) -> Grid:
    """Return the grid of a lens, cached."""
    return Grid(lens, step)


_NEAR = 1e-6
_TOUCHING = 0.005
MAX_DEPTH = 15.0
"""Largest depth that a camera sees, metres along its optical axis."""


class ProjectionPlane(NamedTuple):
    """A plane. centre: one of its points. axes: (3, 3), whose rows are the plane's right and up
    directions and its normal in the world frame."""

    centre: Array
    axes: Array


FLOOR = ProjectionPlane(numpy.zeros(3), numpy.eye(3))


class Shot:
    """A camera on a moving body. body: its state in the middle of the middle row's exposure. place:
    the position of the lens at that time. row_time: seconds from row to row."""

    def __init__(self, camera: Camera, body: Truth, row_time: float) -> None:
        self.camera = camera
        self.row_time = row_time
        self._lines: dict[int, tuple[Array, Array]] = {}
        self._at = numpy.array(body.position)
        self._velocity = numpy.array(body.velocity)
        self._turn = rotation(body.attitude)
        self._rate = numpy.array(body.angular_velocity)
        self._mount = rotation(camera.attitude)
        self._middle = self._turn @ self._mount
        self.place = self._at + self._turn @ numpy.array(camera.position)

    def poses(self, t: Array) -> tuple[Array, Array]:
        """Return the poses of the lens at times `t` (n,), seconds after the middle of the exposure:
        rotations from the optical frame to the world (n, 3, 3), and positions (n, 3)."""
        speed = float(numpy.linalg.norm(self._rate))
        x, y, z = self._rate / speed if speed > 0.0 else self._rate
        k = numpy.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
        angle = (speed * t)[:, None, None]
        # exp([rate t]x) by Rodrigues' formula
        turned = numpy.eye(3) + numpy.sin(angle) * k + (1.0 - numpy.cos(angle)) * (k @ k)
        body = self._turn @ turned
        at = self._at + t[:, None] * self._velocity + body @ numpy.array(self.camera.position)
        return body @ self._mount, at

    def depth(self) -> float | None:
        """Return the distance of the floor along the optical axis, at most MAX_DEPTH, metres; None
        if the lens touches it."""
        height, slope = float(self.place[2]), float(self._middle[2, 2])
        if height < _TOUCHING:
            return None
        return min(height / -slope, MAX_DEPTH) if slope < 0.0 else MAX_DEPTH

    def times(self, rows: Array) -> Array:
        """Return the times at which rows are exposed, seconds after the middle of the image's
        exposure."""
        return (rows - 0.5 * (self.camera.lens.height - 1)) * self.row_time

    def image(self, points: Array, t: Array) -> tuple[Array, Array]:
        """Return the pixels (n, 2) of world points (n, 3) at times `t`, and which of the points the
        lens can image, as in `projection.project`. t: (n,) or (1,), seconds after the middle of the
        exposure."""
        turn, at = self.poses(t)
        local = numpy.einsum("nij,ni->nj", turn, points - at)
        before = local[:, 2] > _NEAR
        flat = local[:, :2] / numpy.where(before, local[:, 2], 1.0)[:, None]
        seen = before & ((flat**2).sum(axis=1) < reach(self.camera.lens) ** 2)
        return distort(self.camera.lens, flat), seen

    def project(self, points: Array, passes: int = 4) -> tuple[Array, Array]:
        """Return the pixels (n, 2) of world points, each at the time at which its row is exposed,
        and which of the points the lens can image. passes: number of fixed-point iterations."""
        pixels, seen = self.image(points, numpy.zeros(1))
        for _ in range(passes - 1 if self.row_time > 0.0 else 0):
            t = numpy.where(seen, self.times(pixels[:, 1]), 0.0)
            pixels, seen = self.image(points, t)
        return pixels, seen

    def meet(
        self, grid: Grid, plane: ProjectionPlane, where: tuple[slice, slice] | None = None
    ) -> Array:
        """Return the points at which the nodes' rays hit a plane, (rows, columns, 3), in the
        plane's axes: right and up from its centre, and the height above it. The height is 0 unless
        the ray reaches the depth MAX_DEPTH before the plane."""
        rows, columns = where or (slice(None), slice(None))
        origins, rays = self._cast(grid)
        rays = rays[rows, columns] @ plane.axes.T
        begin = (origins[rows] - plane.centre) @ plane.axes.T
        with numpy.errstate(divide="ignore"):
            depth = -begin[:, None, 2] / rays[..., 2]
        depth[~((depth > 0.0) & (depth < MAX_DEPTH))] = MAX_DEPTH
        met: Array = begin[:, None, :] + depth[..., None] * rays
        return met

    def _cast(self, grid: Grid) -> tuple[Array, Array]:
        """Return the origins (rows, 3) and rays (rows, columns, 3) of the nodes, world frame,
        computed once for each grid."""
        if grid.step not in self._lines:
            turn, at = self.poses(self.times(grid.pixels[:, 0, 1]))
            self._lines[grid.step] = at, grid.rays @ turn.swapaxes(1, 2)
        return self._lines[grid.step]
