"""A grid of nodes over an image at which smooth quantities are computed, and their interpolation to
pixels."""

from __future__ import annotations

import functools
from typing import NamedTuple, cast

import cv2
import numpy

from kybflow.vision.projection import Array, undistort
from kybflow.world.cameras import Lens

NO_MAP = cast(Array, None)
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
