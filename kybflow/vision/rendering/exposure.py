"""Motion blur, defocus, exposure and noise of grey images, (height, width) uint8."""

from __future__ import annotations

from math import ceil, hypot

import cv2
import numpy

from kybflow.vision.optics import Optics
from kybflow.vision.projection import Array
from kybflow.vision.rendering.grid import NO_MAP, Grid

_SHARP = 0.1
"""Smallest blur to apply, pixels."""
_EVEN = 1.0
"""Largest variation of the motion over the image that counts as uniform, pixels."""
_APART, _MOST_IMAGES = 1.5, 16
"""Distance between displaced images, pixels, and their largest number, which takes precedence."""


def blur_motion(image: Array, motion: Array, nodes: Grid) -> Array:
    """Return the image blurred by motion during the exposure. motion: pixels, (rows, columns, 2),
    at the nodes. The middle of the exposure stays in place. Uniform motion is a convolution with a
    kernel; other motion is the mean of displaced images."""
    inside = motion[1:-1, 1:-1]
    longest = float(numpy.linalg.norm(inside, axis=2).max())
    if longest < _SHARP:
        return image
    middle = inside.mean(axis=(0, 1))
    if float(numpy.linalg.norm(inside - middle, axis=2).max()) < _EVEN:
        return cv2.filter2D(image, -1, streak(*middle), borderType=cv2.BORDER_REPLICATE)
    count = min(ceil(longest / _APART) + 1, _MOST_IMAGES)
    moved = nodes.fill(motion, nodes.whole)
    still = nodes.fill(nodes.pixels, nodes.whole)
    total = numpy.zeros(image.shape, numpy.float32)
    for i in range(count):
        places = cv2.scaleAdd(moved, (i + 0.5) / count - 0.5, still)
        cv2.accumulate(
            cv2.remap(image, places, NO_MAP, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE),
            total,
        )
    return cv2.convertScaleAbs(total, alpha=1.0 / count)


def streak(dx: float, dy: float) -> Array:
    """Return the kernel that spreads a point evenly from -(dx, dy)/2 to (dx, dy)/2."""
    half = ceil(0.5 * max(abs(dx), abs(dy))) + 1
    count = 4 * ceil(hypot(dx, dy)) + 4
    along = (numpy.arange(count) + 0.5) / count - 0.5
    x, y = along * dx + half, along * dy + half
    places = numpy.arange(2 * half + 1)
    # linear interpolation between neighbouring pixels
    across = numpy.maximum(0.0, 1.0 - abs(x - places[:, None]))
    down = numpy.maximum(0.0, 1.0 - abs(y - places[:, None]))
    kernel: Array = (down @ across.T / count).astype(numpy.float32)
    return kernel


def blur_lens(image: Array, optics: Optics, pixels: float, depth: float, more: float) -> Array:
    """Return the image blurred by `optics.blur`, by `more`, and by defocus at depths below the
    focus. A point out of focus becomes a disc with the diameter
    c = aperture pixels (1/depth - 1/focus), whose standard deviation along an axis is c/4 (thin
    lens). pixels: focal length, pixels. depth: metres. more: additional blur, pixels."""
    disc = optics.aperture * pixels * max(0.0, 1.0 / depth - 1.0 / optics.focus)
    deviation = hypot(optics.blur, 0.25 * disc, more)
    if deviation < _SHARP:
        return image
    return cv2.GaussianBlur(image, (0, 0), deviation, borderType=cv2.BORDER_REPLICATE)


class ImageNoise:
    """A sensor's normal noise, with the variance read_noise^2 + shot_noise^2 light, where light is
    1 for white. The random numbers are drawn once; each frame uses them at a different offset."""

    _RIM = 256

    def __init__(self, height: int, width: int, generator: numpy.random.Generator) -> None:
        self._generator = generator
        size = (height + self._RIM, width + self._RIM)
        self._drawn = generator.standard_normal(size, numpy.float32)

    def expose(self, image: Array, optics: Optics) -> Array:
        """Return the sensor's image for a noise-free image in which 255 is white paper."""
        grey = 255.0 * optics.brightness * numpy.arange(256) / 255.0
        if optics.read_noise == 0.0 and optics.shot_noise == 0.0:
            return cv2.LUT(image, numpy.clip(grey, 0.0, 255.0).round().astype(numpy.uint8))
        variance = optics.read_noise**2 + optics.shot_noise**2 * grey / 255.0
        top, left = self._generator.integers(self._RIM, size=2)
        height, width = image.shape
        drawn = self._drawn[top : top + height, left : left + width]
        noise = cv2.multiply(cv2.LUT(image, numpy.sqrt(variance).astype(numpy.float32)), drawn)
        return cv2.add(cv2.LUT(image, grey.astype(numpy.float32)), noise, dtype=cv2.CV_8U)
