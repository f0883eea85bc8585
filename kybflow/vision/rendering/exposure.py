"""From the light that a lens gathers to the pixels that a sensor gives: blur by motion and by the
lens, exposure, noise. Grey images, (height, width) uint8."""

from __future__ import annotations

from math import ceil, hypot

import cv2
import numpy

from kybflow.vision.optics import Optics
from kybflow.vision.projection import Array
from kybflow.vision.rendering.grid import NO_MAP, Grid

_SHARP = 0.1
"""A blur that is smaller is none, pixels."""
_EVEN = 1.0
"""Motion that differs less over the image is the same everywhere, pixels."""
_APART, _MOST_IMAGES = 1.5, 16
"""Between displaced images, pixels; and how many there are at most, farther apart if need be."""


def blur_motion(image: Array, motion: Array, nodes: Grid) -> Array:
    """Blurred along `motion`, how far what is seen at the nodes moved in the image during the
    exposure, pixels, (rows, columns, 2). The middle of the exposure stays in place. Where the
    motion is about the same everywhere a kernel does it, else the mean of displaced images."""
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
    """The kernel that spreads a point evenly over the line from -(dx, dy)/2 to (dx, dy)/2."""
    half = ceil(0.5 * max(abs(dx), abs(dy))) + 1
    count = 4 * ceil(hypot(dx, dy)) + 4
    along = (numpy.arange(count) + 0.5) / count - 0.5
    x, y = along * dx + half, along * dy + half
    places = numpy.arange(2 * half + 1)
    # a sample's weight falls linearly to the pixels beside it
    across = numpy.maximum(0.0, 1.0 - abs(x - places[:, None]))
    down = numpy.maximum(0.0, 1.0 - abs(y - places[:, None]))
    kernel: Array = (down @ across.T / count).astype(numpy.float32)
    return kernel


def blur_lens(image: Array, optics: Optics, pixels: float, depth: float, more: float) -> Array:
    """Blurred by the lens: in focus by `optics.blur`; nearer than the focus a point becomes a disc
    of the diameter c = aperture pixels (1/depth - 1/focus), whose standard deviation along an axis
    is c/4 (thin lens). pixels: the focal length. depth: metres. more: another blur, pixels."""
    disc = optics.aperture * pixels * max(0.0, 1.0 / depth - 1.0 / optics.focus)
    deviation = hypot(optics.blur, 0.25 * disc, more)
    if deviation < _SHARP:
        return image
    return cv2.GaussianBlur(image, (0, 0), deviation, borderType=cv2.BORDER_REPLICATE)


class ImageNoise:
    """A sensor's noise: normal, of the variance read_noise^2 + shot_noise^2 light, `light` being 1
    for white. Numbers are drawn once, and each frame takes them from another place."""

    _RIM = 256

    def __init__(self, height: int, width: int, generator: numpy.random.Generator) -> None:
        self._generator = generator
        size = (height + self._RIM, width + self._RIM)
        self._drawn = generator.standard_normal(size, numpy.float32)

    def expose(self, image: Array, optics: Optics) -> Array:
        """What the sensor gives for the light of `image`, 255 being white paper."""
        grey = 255.0 * optics.brightness * numpy.arange(256) / 255.0
        if optics.read_noise == 0.0 and optics.shot_noise == 0.0:
            return cv2.LUT(image, numpy.clip(grey, 0.0, 255.0).round().astype(numpy.uint8))
        variance = optics.read_noise**2 + optics.shot_noise**2 * grey / 255.0
        top, left = self._generator.integers(self._RIM, size=2)
        height, width = image.shape
        drawn = self._drawn[top : top + height, left : left + width]
        noise = cv2.multiply(cv2.LUT(image, numpy.sqrt(variance).astype(numpy.float32)), drawn)
        return cv2.add(cv2.LUT(image, grey.astype(numpy.float32)), noise, dtype=cv2.CV_8U)
