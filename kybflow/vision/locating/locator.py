"""Locates the body from frames, by the fastest method that works.

With a prediction, tags are searched for at their predicted positions (`search`). If that fails, a
wide search (`WideSearch`) gives a rough pose, from which tags are searched for again. Without a
prediction, or if the wide search fails too, whole images are searched (`Detector`), and tags are
searched for again from the result. After a failure, the slow search of whole images is skipped for
up to four frames.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import cv2
import numpy
from numpy.typing import NDArray

from kybflow.core.geometry import Quat, Vec3
from kybflow.core.signals import Frame
from kybflow.vision.locating.locate import AT_REST, BodyMotion, Located, Start, TagView, locate
from kybflow.vision.locating.search import Search, Shapes
from kybflow.vision.projection import optical_pose, project, rotation, undistort
from kybflow.vision.tags import dictionary
from kybflow.world.cameras import LEAST_SIDE, Camera
from kybflow.world.tags import Tag, TagMap

Array = NDArray[Any]


class DetectedTag(NamedTuple):
    """A detected tag. corners: (4, 2) pixels, in the order of `Tag.corners`."""

    family: str
    id: int
    corners: NDArray[Any]


class Detector:
    """Finds tags of given families in whole images, without a prediction.

    It uses OpenCV's detector in its quick form (ArUco 3; Romero-Ramirez, Munoz-Salinas and
    Medina-Carnicer, "Speeded up detection of squared fiducial markers", 2018), which takes a third
    of the time, and in its thorough form after every other miss. The corners are accurate to a
    pixel, enough to start `kybflow.vision.locating.search`.
    """

    def __init__(self, families: Sequence[str]) -> None:
        self._quick, self._thorough = (
            [(family, _detector(family, quick)) for family in families] for quick in (True, False)
        )
        self._misses = 0

    def find(self, image: NDArray[Any]) -> list[DetectedTag]:
        """Return the tags in a grey image, (height, width) uint8."""
        detectors = self._thorough if self._misses % 2 else self._quick
        found = []
        for family, detector in detectors:
            quads, numbers, _ = detector.detectMarkers(image)
            for quad, number in zip(quads, () if numbers is None else numbers.ravel(), strict=True):
                corners = quad.reshape(4, 2).astype(float)
                found.append(DetectedTag(family, int(number), corners))
        self._misses = 0 if found else self._misses + 1
        return found


def _detector(family: str, quick: bool) -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.useAruco3Detection = quick
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    return cv2.aruco.ArucoDetector(dictionary(family), parameters)


_TAGS = 9
_ALIKE = 0.6
_STRIDE = 0.4
"""Distance between the positions compared, cells."""
_PLACES = 20
"""Largest number of positions compared to either side of the prediction."""


class WideSearch:
    """Searches for tags with a prediction that is some centimetres or degrees off.

    It compares a few tags, spread over the image, with the image at all positions around their
    prediction, half a cell apart, by the correlation coefficient of pattern and grey levels at the
    cells' centres. If the best correlation of a tag is high enough, its position gives the tag's
    corners to half a cell.
    """

    def __init__(self, shapes: Shapes) -> None:
        self._shapes = shapes

    def find(
        self, image: Array, camera: Camera, pose: Start, tags: Iterable[Tag], off: float
    ) -> TagView:
        """Return some of `tags` in a grey image with approximate corners, seen from a body near
        `pose`. off: largest error of the prediction, pixels."""
        chosen, shapes = self._shapes.in_view(camera, pose, tags)
        found, corners = [], []
        spread = numpy.linspace(0, len(chosen) - 1, min(len(chosen), _TAGS))
        for i in sorted({round(i) for i in spread}):
            tag, shape = chosen[i], shapes[i]
            outline = project(camera, *pose, shape.sides[:, 0])[0]
            size = float(numpy.linalg.norm(outline - numpy.roll(outline, 1, axis=0), axis=1).min())
            stride = max(1.0, _STRIDE * size / shape.size, off / _PLACES)
            pixels = project(camera, *pose, shape.cells)[0]
            shift, alike = _best(image, pixels, shape.bits, off, stride)
            if alike >= _ALIKE:
                found.append(tag)
                corners.append(outline + shift)
        return TagView(camera, found, numpy.array(corners).reshape(-1, 4, 2))


def _best(
    image: Array, pixels: Array, bits: Array, off: float, stride: float
) -> tuple[Array, float]:
    """Return the shift of `pixels` at which the grey levels correlate best with `bits`, (2,)
    pixels, and that correlation."""
    count = int(numpy.ceil(off / stride))
    steps = numpy.arange(-count, count + 1) * stride
    dy, dx = (grid.ravel() for grid in numpy.meshgrid(steps, steps, indexing="ij"))
    x = (pixels[:, :1] + dx).astype(numpy.float32)
    y = (pixels[:, 1:] + dy).astype(numpy.float32)
    levels = cv2.remap(image, x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    levels = levels.astype(numpy.float32)
    levels -= levels.mean(axis=0)
    both = bits.astype(numpy.float32) @ levels
    alone = numpy.einsum("ij,ij->j", levels, levels) * float(bits @ bits)
    alike = both / numpy.sqrt(numpy.maximum(alone, 1e-9))
    best = int(alike.argmax())
    return numpy.array((dx[best], dy[best])), float(alike[best])


_CLOSE_DISTANCE = 6.0
"""Largest distance of tags from their predicted positions if the prediction is a located pose,
pixels."""
_REPEATED_ERROR = 4.0
"""Error of the prediction above which the search is repeated from its result, pixels."""
_SIGMAS = 3.0
"""Half-width of the search, in standard deviations of the prediction."""
_MIN_DISTANCE, _MAX_DISTANCE = 12.0, 100.0
"""Smallest search distance, and the largest of the wide search, pixels."""
_MIN_TAGS, _SHARE = 3, 0.4
"""Number of tags that a pose needs (all of them, if fewer should be in view), and the share of the
tags in view that it needs."""
_MOST_SKIPPED = 4
_GRAZING_COSINE = 0.05


class Prediction(NamedTuple):
    """The expected pose and motion of the body when a frame is taken. spread, turn: standard
    deviations of the position (metres) and of the attitude (radians)."""

    position: Vec3
    attitude: Quat
    motion: BodyMotion
    spread: float
    turn: float


class Sighting(NamedTuple):
    """Frames of one time, and the pose located from them; None if there is none."""

    frames: Sequence[Frame]
    located: Located | None


class Locator:
    """Locates one body, independently of earlier poses. survey: standard deviation of a full-sized
    tag's position, metres. sighting: the latest sighting, for the recording."""

    def __init__(self, tags: TagMap, cameras: Mapping[str, Camera], survey: float = 0.0) -> None:
        self._tags, self._cameras, self._survey = tags, cameras, survey
        self._lowest = min((tag.position[2] for tag in tags), default=0.0)
        self._largest = max((tag.size for tag in tags), default=0.0)
        shapes = Shapes()
        self._search, self._wide = Search(shapes), WideSearch(shapes)
        self._detector = Detector(tags.families)
        self._rims: dict[str, NDArray[Any]] = {}
        for name, camera in cameras.items():  # rays of the image's corners, in the optical frame
            right, low = camera.lens.width - 1.0, camera.lens.height - 1.0
            pixels = numpy.array(((0.0, 0.0), (right, 0.0), (right, low), (0.0, low)))
            rays = numpy.column_stack((undistort(camera.lens, pixels), numpy.ones(4)))
            self._rims[name] = rays / numpy.linalg.norm(rays, axis=1)[:, None]
        self._misses = self._wait = 0
        self.sighting: Sighting | None = None

    def locate(self, frames: Sequence[Frame], prediction: Prediction | None) -> Located | None:
        """Return the body's pose from frames of one time; None if they don't determine it. Raises
        KeyError for a frame of a camera that the body doesn't have."""
        located = self._located(frames, prediction)
        self.sighting = Sighting(frames, located)
        return located

    def _located(self, frames: Sequence[Frame], prediction: Prediction | None) -> Located | None:
        weak: Located | None = None
        motion = AT_REST
        if prediction is not None:
            motion = prediction.motion
            weak, holds = self._predicted(frames, prediction)
            if holds:
                return weak
        if self._wait > 0:
            self._wait -= 1
            return weak
        located = self._detected(frames, motion)
        if located is None or (weak is not None and len(located.used) <= len(weak.used)):
            self._wait, self._misses = self._misses, min(self._misses + 1, _MOST_SKIPPED)
            return weak
        self._misses = 0
        return located

    def _predicted(
        self, frames: Sequence[Frame], prediction: Prediction
    ) -> tuple[Located | None, bool]:
        """Return the pose of the body near a prediction, and whether enough tags support the
        pose."""
        pose, motion = (prediction.position, prediction.attitude), prediction.motion
        off = max(
            _MIN_DISTANCE,
            self._pixels(frames, pose, _SIGMAS * prediction.spread, _SIGMAS * prediction.turn),
        )
        located, holds = self._searched(frames, pose, motion, off)
        if holds:
            return located, True
        wide = min(off, _MAX_DISTANCE)
        seen = self._seen(frames, pose)
        rough = locate([self._wide.find(*s, off=wide) for s in seen], pose, motion, self._survey)
        if rough is None:
            return located, False
        again, holds = self._searched(frames, rough[:2], motion, _MIN_DISTANCE)
        return (again, holds) if again is not None else (located, False)

    def _detected(self, frames: Sequence[Frame], motion: BodyMotion) -> Located | None:
        """Return the pose from tags detected in whole images; None if too few tags support it."""
        views = []
        for frame in frames:
            found = [(self._tags.get(f.family, f.id), f) for f in self._detector.find(frame.image)]
            known = [(tag, f.corners) for tag, f in found if tag is not None]
            corners = numpy.array([corners for _, corners in known]).reshape(-1, 4, 2)
            views.append(TagView(self._cameras[frame.camera], [tag for tag, _ in known], corners))
        rough = locate(views, None, motion, self._survey)
        if rough is None:
            return None
        located, holds = self._searched(frames, rough[:2], motion, _CLOSE_DISTANCE)
        return located if holds else None

    def _searched(
        self, frames: Sequence[Frame], pose: Start, motion: BodyMotion, off: float
    ) -> tuple[Located | None, bool]:
        """Search for the tags where `pose` predicts them. Return the body's pose, and whether
        enough tags support it. off: largest error of the prediction, pixels."""
        views = [self._search.find(*seen, off=off) for seen in self._seen(frames, pose)]
        located = locate([view for view, _ in views], pose, motion, self._survey)
        if located is None:
            return None, False
        metres = float(numpy.linalg.norm(numpy.subtract(pose[0], located.position)))
        cosine = abs(sum(a * b for a, b in zip(pose[1], located.attitude, strict=True)))
        turn = 2.0 * max(0.0, 2.0 * (1.0 - min(1.0, cosine))) ** 0.5  # of small angles
        if off > _CLOSE_DISTANCE and self._pixels(frames, pose, metres, turn) > _REPEATED_ERROR:
            return self._searched(frames, located[:2], motion, _CLOSE_DISTANCE)
        expected = sum(count for _, count in views)
        return located, len(located.used) >= max(min(_MIN_TAGS, expected), _SHARE * expected)

    def _seen(
        self, frames: Sequence[Frame], pose: Start
    ) -> Iterator[tuple[NDArray[Any], Camera, Start, list[Tag]]]:
        """Yield the arguments of a search in each frame: the image, the camera, the body's pose,
        and the tags that the camera may see. These are within a circle around its view of the
        lowest tag's plane, up to the distance at which the largest tag is detectable."""
        for frame in frames:
            camera = self._cameras[frame.camera]
            at, turn = optical_pose(camera, *pose)
            rays = self._rims[camera.name] @ rotation(turn).T
            far = self._largest * camera.lens.fx / LEAST_SIDE
            down = numpy.maximum(-rays[:, 2], _GRAZING_COSINE)
            reach = numpy.clip((at[2] - self._lowest) / down, 0.0, far)
            ends = numpy.vstack((rays[:, :2] * reach[:, None], (0.0, 0.0))) + at[:2]
            low, high = ends.min(axis=0), ends.max(axis=0)
            x, y = (0.5 * (low + high)).tolist()
            radius = 0.5 * float(numpy.hypot(*(high - low))) + self._largest
            yield frame.image, camera, pose, self._tags.near(x, y, radius)

    def _pixels(self, frames: Sequence[Frame], pose: Start, metres: float, turn: float) -> float:
        """Return by how many pixels an error of the pose moves tags in the image. metres, turn:
        errors of the position and of the attitude (radians)."""
        most = 0.0
        for frame in frames:
            camera = self._cameras[frame.camera]
            height = optical_pose(camera, *pose)[0][2] - self._lowest
            most = max(most, camera.lens.fx * (metres / max(height, 0.05) + turn))
        return most
