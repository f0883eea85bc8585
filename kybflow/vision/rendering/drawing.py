"""Draws what a camera over a tag floor sees, without a graphics card.

The undistorted ray of each pixel is intersected with the plane of the floor or of a tag, from the
camera's pose while the pixel's row is exposed. The print is sampled there, with texels slightly
larger than a pixel so that edges are smooth. Obstacles and a released parcel hide what is behind
them. Motion blur, defocus, exposure and noise follow. Tags out of view add no cost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, hypot, inf
from typing import NamedTuple

import cv2
import numpy

from kybflow.core.geometry import Vec3
from kybflow.core.signals import Truth
from kybflow.vision.projection import Array
from kybflow.vision.rendering.floor import QUIET_ZONE, Floor, Sheet, swapped
from kybflow.vision.rendering.shot import FLOOR, NO_MAP, Grid, Region, Shot, grid
from kybflow.vision.rendering.solids import NONE, Solid, Solids, cover, hides
from kybflow.world.cameras import SOUND, Camera, Optics, Weakness
from kybflow.world.shapes import Shape
from kybflow.world.tags import TagMap

_VIEW_SPACING, _MOTION_SPACING = 8, 80
"""Distance between the grid nodes for the view, and for the motion in it, pixels."""
_TEXEL = 1.25
"""Size of a print's texel, pixels."""
_LEAST_TEXELS, _MOST_TEXELS = 0.6, 64
_RIM = 3
"""Pixels by which distortion may curve a tag's edges beyond its outline."""
_MAX_RADIUS = 0.5
"""Radius of the largest tag, metres."""
_PATCH_GREY = 90


class Room:
    """Draws a floor with tags, obstacles and a parcel, as seen by cameras. parcel: side of the
    parcel, metres. The same seed and the same calls give the same images."""

    def __init__(
        self,
        tags: TagMap,
        optics: Optics,
        seed: int,
        obstacles: Mapping[str, Shape] = NONE,
        parcel: float = 0.0,
    ) -> None:
        self._optics = optics
        if optics.misplaced > 0.0:
            tags = swapped(tags, optics.misplaced, seed)
        self._floor = Floor(tags, seed, 255.0 * optics.floor, optics.pattern)
        self._solids = Solids(obstacles, parcel, seed)
        self._generator = numpy.random.default_rng(seed)
        self._noises: dict[str, ImageNoise] = {}

    def draw(self, camera: Camera, body: Truth, weakness: Weakness = SOUND) -> Array:
        """Return the image of a camera on a body, (height, width) uint8. body: its state in the
        middle of the middle row's exposure; it moves with constant velocity and body rates. The
        body's released payload is drawn unless it is None."""
        lens, optics = camera.lens, self._optics
        noise = self._noises.get(camera.name)
        if noise is None:
            noise = ImageNoise(lens.height, lens.width, self._generator.spawn(1)[0])
            self._noises[camera.name] = noise
        shot = Shot(camera, body, optics.row_time)
        depth = shot.depth()
        if weakness.dark or depth is None:
            return noise.expose(numpy.zeros((lens.height, lens.width), numpy.uint8), optics)
        solids = self._solids.in_view(shot, body.payload)
        image = _light(self._floor, solids, shot, optics, optics.covered + weakness.covered)
        nodes = grid(lens, _MOTION_SPACING)
        image = blur_motion(image, motion(shot, nodes, optics.exposure), nodes)
        image = blur_lens(image, optics, lens.fx, depth, weakness.blur)
        return noise.expose(image, optics)


def motion(shot: Shot, nodes: Grid, exposure: float) -> Array:
    """Return the motion in the image at each node while its row is exposed, pixels, (rows, columns,
    2)."""
    points = shot.meet(nodes, FLOOR).reshape(-1, 3)
    t = shot.times(nodes.pixels[..., 1]).ravel()
    first, _ = shot.image(points, t - 0.5 * exposure)
    last, _ = shot.image(points, t + 0.5 * exposure)
    return (last - first).reshape(nodes.pixels.shape)


def _light(
    floor: Floor, solids: Sequence[Solid], shot: Shot, optics: Optics, covered: float
) -> Array:
    """Return the image without motion blur; white paper has the grey level 255."""
    nodes = grid(shot.camera.lens, _VIEW_SPACING)
    met = shot.meet(nodes, FLOOR)[..., :2]
    places = nodes.fill(met, nodes.whole)
    image = floor.image(places, met.min(axis=(0, 1)))
    views = _in_view(floor, shot, met, optics.missing)
    lying = [
        (view, _texels(view, shot, nodes, places if view.sheet.plane is FLOOR else None))
        for view in views
        if view.sheet.on_floor
    ]
    for view, texels in lying:  # all paper first, so that quiet zones don't hide neighbours
        _draw_paper(image, view, texels)
    for view, texels in lying:
        _draw_ink(image, view, texels, covered)
    _draw_patches(image, shot, optics.patches)
    for solid in solids:
        cover(image, shot, solid)
    eye: Vec3 = tuple(shot.place.tolist())
    for view in views:  # tags on or in front of solids
        place = view.sheet.tag.position
        if not (view.sheet.on_floor or any(hides(solid, eye, place) for solid in solids)):
            texels = _texels(view, shot, nodes)
            _draw_paper(image, view, texels)
            _draw_ink(image, view, texels, covered)
    return image


class _View(NamedTuple):
    """A tag in the image: the region of its pixels, the texels per cell, and its distance."""

    sheet: Sheet
    region: Region
    texels: int
    distance: float


def _in_view(floor: Floor, shot: Shot, met: Array, missing: float) -> list[_View]:
    """Return the tags that may be in the image, the farthest first. met: the points on the floor
    that the nodes' rays hit."""
    sheets = [
        sheet
        for sheet in _near(floor, shot, met)
        if sheet.draws[0] >= missing and sheet.faces(shot.place)
    ]
    if not sheets:
        return []
    outlines = numpy.stack([sheet.outline for sheet in sheets])
    pixels, imaged = shot.project(outlines.reshape(-1, 3), passes=2)
    pixels, whole = pixels.reshape(-1, 8, 2), numpy.all(imaged.reshape(-1, 8), axis=1)
    low, high = pixels.min(axis=1), pixels.max(axis=1)
    size = numpy.array((shot.camera.lens.width, shot.camera.lens.height))
    first = numpy.clip(low - _RIM, 0, size).astype(int)
    last = numpy.clip(high + _RIM + 1, 0, size).astype(int)
    boxes = numpy.hstack((first, last)).tolist()
    views: list[_View] = []
    for i in numpy.flatnonzero(~whole | (last > first).all(axis=1)):
        region = Region(*boxes[i]) if whole[i] else _region(sheets[i], shot, met)
        side = float((high[i] - low[i]).max()) if whole[i] else inf  # of the paper, pixels
        texels = min(side / (sheets[i].cells + 2 * QUIET_ZONE) / _TEXEL, _MOST_TEXELS)
        if region is not None and texels >= _LEAST_TEXELS:
            away = float(numpy.linalg.norm(shot.place - sheets[i].tag.position))
            views.append(_View(sheets[i], region, round(texels), away))
    return sorted(views, key=lambda view: -view.distance)


def _near(floor: Floor, shot: Shot, met: Array) -> list[Sheet]:
    """Return the tags whose paper overlaps the bounding box, from above, of the lens and the floor
    points that the nodes see."""
    low = numpy.minimum(met.min(axis=(0, 1)), shot.place[:2])
    high = numpy.maximum(met.max(axis=(0, 1)), shot.place[:2])
    (x, y), (left, bottom), (right, top) = (a.tolist() for a in (0.5 * (low + high), low, high))
    near = floor.sheets(x, y, 0.5 * hypot(right - left, top - bottom) + _MAX_RADIUS)
    return [
        sheet
        for sheet in near
        if left - sheet.reach <= sheet.tag.position[0] <= right + sheet.reach
        and bottom - sheet.reach <= sheet.tag.position[1] <= top + sheet.reach
    ]


def _region(sheet: Sheet, shot: Shot, met: Array) -> Region | None:
    """Return the pixels that a tag covers if the lens can't image some of its corners, from the
    rays through the nodes of the view's grid; None if no ray hits it."""
    nodes = grid(shot.camera.lens, _VIEW_SPACING)
    if sheet.plane is not FLOOR:
        met = shot.meet(nodes, sheet.plane)[..., :2]
    at = met @ sheet.to_cells[:, :2].T + sheet.to_cells[:, 2]
    within = ((at > -QUIET_ZONE) & (at < sheet.cells + QUIET_ZONE)).all(axis=2)
    return nodes.beside(within) if within.any() else None


def _texels(view: _View, shot: Shot, nodes: Grid, places: Array | None = None) -> Array:
    """Return the texel coordinates of the pixels in a view's region. places: the points that all
    pixels show on the tag's plane, if known."""
    if places is None:
        met = shot.meet(nodes, view.sheet.plane, nodes.around(view.region))[..., :2]
        seen = nodes.fill(met, view.region)
    else:
        seen = places[_pixels(view.region)]
    to_texels = view.sheet.to_cells * view.texels
    to_texels[:, 2] += 0.5  # the picture has a frame of one texel; the first centre is (0, 0)
    texels: Array = cv2.transform(seen, to_texels)
    return texels


def _draw_paper(image: Array, view: _View, texels: Array) -> None:
    """Draw the white paper, including the quiet zone."""
    rim = QUIET_ZONE * view.texels
    low, high = 0.5 - rim, view.sheet.cells * view.texels + rim + 0.5
    part = image[_pixels(view.region)]
    cv2.max(part, cv2.inRange(texels, (low, low), (high, high)), dst=part)


def _draw_ink(image: Array, view: _View, texels: Array, covered: float) -> None:
    picture = view.sheet.picture(view.texels, view.sheet.draws[1] < covered)
    part = image[_pixels(view.region)]
    cv2.remap(
        picture, texels, NO_MAP, cv2.INTER_LINEAR, dst=part, borderMode=cv2.BORDER_TRANSPARENT
    )


def _draw_patches(image: Array, shot: Shot, patches: tuple[Vec3, ...]) -> None:
    turn = numpy.linspace(0.0, 2.0 * numpy.pi, 48, endpoint=False)
    for x, y, radius in patches:
        rim = (x + radius * numpy.cos(turn), y + radius * numpy.sin(turn), 0.0 * turn)
        pixels, imaged = shot.project(numpy.stack(rim, axis=1))
        if imaged.all():
            corners = (16.0 * pixels).round().astype(numpy.int32)
            cv2.fillConvexPoly(image, corners, _PATCH_GREY, cv2.LINE_AA, 4)


def _pixels(region: Region) -> tuple[slice, slice]:
    return slice(region.top, region.bottom), slice(region.left, region.right)


_MIN_BLUR = 0.1
"""Smallest blur to apply, pixels."""
_UNIFORM_MOTION = 1.0
"""Largest variation of the motion over the image that counts as uniform, pixels."""
_IMAGE_SPACING, _MOST_IMAGES = 1.5, 16
"""Distance between displaced images, pixels, and their largest number, which takes precedence."""


def blur_motion(image: Array, motion: Array, nodes: Grid) -> Array:
    """Return the image blurred by motion during the exposure. motion: of the image at each grid
    node, pixels, (rows, columns, 2). The middle of the exposure stays in place. Uniform motion is a
    convolution with a kernel; other motion is the mean of displaced images."""
    inside = motion[1:-1, 1:-1]
    longest = float(numpy.linalg.norm(inside, axis=2).max())
    if longest < _MIN_BLUR:
        return image
    middle = inside.mean(axis=(0, 1))
    if float(numpy.linalg.norm(inside - middle, axis=2).max()) < _UNIFORM_MOTION:
        return cv2.filter2D(image, -1, streak(*middle), borderType=cv2.BORDER_REPLICATE)
    count = min(ceil(longest / _IMAGE_SPACING) + 1, _MOST_IMAGES)
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
    if deviation < _MIN_BLUR:
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
