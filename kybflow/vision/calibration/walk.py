"""Computes the corrections of lens, mount and map from the frames of a recorded walk.

The frames are a video, or a folder of images ordered by name. The walk is divided into sections,
and the sharpest frame of each section is used. The times of a video count from its first frame; the
time of an image is the number of seconds at the start of its name.

First the tags are detected in each frame without using their positions in the map, so that
displaced tags are also found, and corrections are computed from these corners, which are accurate
to half a pixel. Then every tag is searched for where the corrections predict it, to a few
hundredths of a pixel, and the corrections are computed again. The correction of the mount requires
the body's pose, from its start position in the first frame or from motion capture.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy
from numpy.typing import NDArray

from kybflow.core.errors import CalibrationFailed
from kybflow.core.geometry import LEVEL, ZERO, Quat, Vec3, add, from_axes, from_heading, multiply
from kybflow.vision.calibration.adjust import BELIEVED, Adjusted, adjust
from kybflow.vision.calibration.model import (
    LENS,
    MOUNT,
    TAG,
    TAGS,
    KnownPoses,
    Seen,
    Walk,
    corrected_lens,
    mounting,
    poses,
)
from kybflow.vision.calibration.track import RecordedTrack, reference_at, rough_offset
from kybflow.vision.images import grey
from kybflow.vision.locating.locate import AT_REST, Sight, TagView, acquire
from kybflow.vision.locating.locator import Detector
from kybflow.vision.locating.search import Search, Shapes
from kybflow.vision.projection import rotation
from kybflow.world.cameras import Camera
from kybflow.world.tags import Key, Tag, TagMap

_IMAGES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".webp"})
_SECONDS = re.compile(r"\d+(\.\d+)?")


class WalkFrame(NamedTuple):
    """A grey image, and the time at which it was taken, seconds; NaN if unknown."""

    time: float
    image: NDArray[Any]


class WalkFrames(NamedTuple):
    """The selected frames of a walk, and the number of all its frames."""

    frames: list[WalkFrame]
    total: int


def recorded(path: Path, camera: Camera, most: int) -> WalkFrames:
    """Return the sharpest frames of a video or folder, `most` at most. Raises CalibrationFailed if
    there are none or one can't be read, and DriverError if one doesn't have the camera's size."""
    sharp = [cv2.Laplacian(f.image, cv2.CV_32F).var() for f in _frames(path, camera)]
    if not sharp:
        raise CalibrationFailed(f"`{path}` has no frames")
    stretches = numpy.array_split(numpy.arange(len(sharp)), min(most, len(sharp)))
    best = {int(part[numpy.argmax([sharp[i] for i in part])]) for part in stretches}
    frames = [frame for i, frame in enumerate(_frames(path, camera)) if i in best]
    return WalkFrames(frames, len(sharp))


def _frames(path: Path, camera: Camera) -> Iterator[WalkFrame]:
    if path.is_dir():
        for file in sorted(path.iterdir()):
            if file.suffix.lower() in _IMAGES:
                image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) if file.is_file() else None
                if image is None:
                    raise CalibrationFailed(f"`{file}` is not an image")
                said = _SECONDS.match(file.stem)
                yield WalkFrame(float(said[0]) if said else nan, grey(image, camera))
        return
    capture = cv2.VideoCapture(str(path))
    try:
        if not capture.isOpened():
            raise CalibrationFailed(f"`{path}` is not a video")
        while (read := capture.read())[0]:
            time = 1e-3 * capture.get(cv2.CAP_PROP_POS_MSEC)
            yield WalkFrame(time, grey(read[1], camera))
    finally:
        capture.release()


Array = NDArray[Any]

MOST_FRAMES = 100
"""Largest number of frames to use."""
_MIN_FRAMES = 5
_MAX_OFFSET = 2.0
"""Largest distance of tags from their positions predicted by the first corrections, pixels."""
_DETERMINED_SHARE = 0.5
"""Fraction of its prior standard deviation below which a correction counts as determined."""


class Standing(NamedTuple):
    """The pose of the body standing level on the ground in the first frame."""

    position: Vec3
    heading: float


@dataclass(frozen=True)
class WalkCalibration:
    """The result of a walk. ahead: the clock of the poses minus that of the frames, seconds; None
    if there is no track of poses."""

    walk: Walk
    adjusted: Adjusted
    ahead: float | None = None

    @property
    def camera(self) -> Camera:
        """The corrected camera."""
        x, camera = self.adjusted.x, self.walk.camera
        position, turn = mounting(camera, x)
        lens = corrected_lens(camera.lens, x)
        return camera._replace(lens=lens, position=_vec3(position), attitude=_quaternion(turn))

    @property
    def tags(self) -> list[Tag]:
        """The observed tags at their corrected positions."""
        return [
            tag._replace(
                position=add(tag.position, _vec3(shift[:3])),
                attitude=multiply(from_heading(float(shift[3])), tag.attitude),
            )
            for tag, shift in zip(self.walk.tags, self.shifts, strict=True)
        ]

    @property
    def shifts(self) -> Array:
        """The corrections of x, y, z and heading of each tag, (t, 4)."""
        shifts: Array = self.adjusted.x[TAGS : self.walk.frames].reshape(-1, TAG)
        return shifts

    @property
    def spreads(self) -> Array:
        """The standard deviation of each correction, in the order of `model`."""
        spreads: Array = numpy.sqrt(numpy.diag(self.adjusted.covariance))
        return spreads

    def is_determined(self, spread: float, kind: str) -> bool:
        """Return whether the walk determines a correction clearly better than its prior. spread:
        the correction's standard deviation."""
        return spread < _DETERMINED_SHARE * BELIEVED[kind]

    @property
    def displaced(self) -> NDArray[numpy.bool_]:
        """Which tags' positions or headings are outliers of the survey, (t,)."""
        used = self.adjusted.used
        wrong: NDArray[numpy.bool_] = ~(used["survey"] & used["survey heading"])
        return wrong


def calibrated(
    frames: Sequence[WalkFrame],
    camera: Camera,
    tags: TagMap,
    known: RecordedTrack | Standing | None = None,
) -> WalkCalibration:
    """Return the corrections from a walk. Raises CalibrationFailed if the frames don't determine
    them. known: the body's pose over time, or in the first frame."""
    walk, shown = _observed(frames, camera, tags)
    times = numpy.array([frame.time for frame in shown])
    offset = 0.0
    if isinstance(known, RecordedTrack):
        offset = _offset(known, times, walk)
        walk = _tracked(walk, known, times, offset)
    elif known is not None:
        if shown[0] is not frames[0]:
            raise CalibrationFailed("the first frame shows less than two tags of the map")
        body, none = rotation(from_heading(known.heading))[None], numpy.zeros((1, 3))
        place = numpy.array([known.position])
        walk = replace(walk, reference=KnownPoses(numpy.array([0]), place, body, none, none))
    rough = adjust(walk, numpy.zeros(walk.size))
    walk = _searched(shown, walk, rough)
    if isinstance(known, RecordedTrack):
        offset += float(rough.x[LENS + MOUNT])
        walk = _tracked(walk, known, times, offset)
    start = numpy.zeros(walk.size)
    start[: walk.frames] = rough.x[: walk.frames]
    start[LENS + MOUNT] = 0.0
    found = adjust(walk, start)
    ahead = offset + float(found.x[LENS + MOUNT]) if isinstance(known, RecordedTrack) else None
    return WalkCalibration(walk, found, ahead)


def _observed(
    frames: Sequence[WalkFrame], camera: Camera, tags: TagMap
) -> tuple[Walk, list[WalkFrame]]:
    """Detect the map's tags. Return the walk, and the frames that show at least two tags."""
    detector = Detector(tags.families)
    position, mount = mounting(camera, numpy.zeros(TAGS))
    keys: set[Key] = set()
    views: list[TagView] = []
    shown: list[WalkFrame] = []
    lenses: list[tuple[Array, Array]] = []
    for frame in frames:
        found = ((tags.get(one.family, one.id), one.corners) for one in detector.find(frame.image))
        known = {tag: corners for tag, corners in found if tag is not None}
        keys.update(tag.key for tag in known)
        view = TagView(camera, list(known), numpy.array(list(known.values())))
        fit = acquire([Sight(view, AT_REST)], None) if len(known) > 1 else None
        if fit is not None:
            views.append(view)
            shown.append(frame)
            lenses.append((fit.at + fit.body @ position, fit.body @ mount))
    if not keys:
        raise CalibrationFailed(f"no tag of the map is found in {len(frames)} frames")
    if len(keys) == 1:
        ((family, number),) = keys
        raise CalibrationFailed(
            f"only one tag is found, {number} of {family}: a map can't be determined"
        )
    if len(shown) < _MIN_FRAMES:
        message = f"{len(shown)} of {len(frames)} frames show two tags or more"
        raise CalibrationFailed(f"{message}; {_MIN_FRAMES} are needed, and 50 are recommended")
    listed = [tag for tag in tags if tag.key in keys]
    at, turn = (numpy.array(part) for part in zip(*lenses, strict=True))
    return Walk(camera, listed, at, turn, _seen(views, listed)), shown


def _seen(views: Sequence[TagView], tags: Sequence[Tag]) -> Seen:
    order = {tag.key: i for i, tag in enumerate(tags)}
    frame = numpy.repeat(numpy.arange(len(views)), [4 * len(view.tags) for view in views])
    tag = numpy.repeat([order[tag.key] for view in views for tag in view.tags], 4)
    pixel = numpy.concatenate([view.corners.reshape(-1, 2) for view in views])
    corner = numpy.tile(numpy.arange(4), len(tag) // 4)
    held = numpy.isfinite(pixel).all(axis=1)
    return Seen(frame[held], tag[held], corner[held], pixel[held])


def _searched(frames: Sequence[WalkFrame], walk: Walk, rough: Adjusted) -> Walk:
    """Search for the tags where the corrections predict them, and return the walk with the corners
    found."""
    search = Search(Shapes())
    found = WalkCalibration(walk, rough)
    camera, tags = found.camera._replace(position=ZERO, attitude=LEVEL), found.tags
    at, turn, _ = poses(walk, rough.x)
    views = [
        search.find(frame.image, camera, (_vec3(p), _quaternion(c)), tags, _MAX_OFFSET)[0]
        for frame, p, c in zip(frames, at, turn, strict=True)
    ]
    return replace(walk, at=at, turn=turn, seen=_seen(views, tags))


def _offset(track: RecordedTrack, times: Array, walk: Walk) -> float:
    if not numpy.isfinite(times).all():
        raise CalibrationFailed("the frames have no times; name images by seconds, 0012.345.png")
    position, mount = mounting(walk.camera, numpy.zeros(TAGS))
    bodies = walk.at - walk.turn @ mount.T @ position
    offset = rough_offset(track, times, bodies)
    if offset is None:
        raise CalibrationFailed("the poses cover less than half of the time of the frames")
    return offset


def _tracked(walk: Walk, track: RecordedTrack, times: Array, offset: float) -> Walk:
    reference = reference_at(track, times, offset)
    if not len(reference.frame):
        raise CalibrationFailed("the poses have gaps wherever a frame was taken")
    return replace(walk, reference=reference)


def _vec3(values: Array) -> Vec3:
    x, y, z = values.tolist()
    return x, y, z


def _quaternion(matrix: Array) -> Quat:
    x, y, z = matrix.T.tolist()
    return from_axes(tuple(x), tuple(y), tuple(z))
