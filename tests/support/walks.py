"""Walks with a camera over a tag floor that is not quite as it was surveyed."""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy
from tag_floors import LENS, grid, still

from kybflow.core.geometry import Quat, Vec3, conjugate, from_euler, from_heading, multiply, sub
from kybflow.vision.calibration.model import KnownPoses, Seen, Walk, rotation_vector
from kybflow.vision.calibration.track import RecordedTrack
from kybflow.vision.calibration.walk import WalkCalibration
from kybflow.vision.projection import optical_pose, project, rotation
from kybflow.world.cameras import DOWN, Camera
from kybflow.world.tags import Tag

CAMERA = Camera("down", LENS, (0.11, 0.0, 0.15), DOWN)
"""The true one."""
TURN = tuple(numpy.deg2rad((0.6, -0.6, 0.53)).tolist())
"""A degree."""
ERRORS = numpy.array((0.01, 0.01, 0.01, 0.01))
"""Of the survey: metres, and radians of heading, root mean square."""


class Scene(NamedTuple):
    """What is true, and what is believed: the tags' errors, (t, 4), are to be found."""

    tags: list[Tag]
    survey: list[Tag]
    errors: numpy.ndarray
    believed: Camera


def believed_camera(camera: Camera) -> Camera:
    """A camera as a ruler and a data sheet say: focal length 1 %, k1 0.03, a degree, 9 mm off."""
    lens = camera.lens
    k1, *rest = lens.distortion
    return camera._replace(
        lens=lens._replace(
            fx=lens.fx / 1.01,
            fy=lens.fy / 1.01,
            cx=lens.cx - 4.0,
            cy=lens.cy + 3.0,
            distortion=(k1 - 0.03, *rest),
        ),
        position=sub(camera.position, (0.005, -0.004, 0.006)),
        attitude=multiply(conjugate(from_euler(*TURN)), camera.attitude),
    )


def scene(seed: int, side: int = 5, camera: Camera = CAMERA) -> Scene:
    generator = numpy.random.default_rng(seed)
    tags = grid(side, side)
    errors = ERRORS * generator.standard_normal((len(tags), 4))
    survey = [
        tag._replace(
            position=sub(tag.position, tuple(off[:3])),
            attitude=from_heading(-off[3]),
        )
        for tag, off in zip(tags, errors.tolist(), strict=True)
    ]
    return Scene(tags, survey, errors, believed_camera(camera))


def pose_at(t: float) -> tuple[Vec3, Quat]:
    """Where a hand holds the body: all over the floor, tilted to all sides, turned all round."""
    position = (0.4 + 0.35 * sin(0.9 * t), 0.4 + 0.35 * cos(1.3 * t + 1), 1.0 + 0.3 * sin(0.7 * t))
    return position, from_euler(0.3 * sin(2.1 * t), 0.3 * cos(1.7 * t), 0.8 * t)


def bodies(count: int) -> list:
    return [still(*pose_at(0.5 * i)) for i in range(count)]


def track(seconds: float, ahead: float, seed: int = 1) -> RecordedTrack:
    """What motion capture says meanwhile, to half a millimetre, by a clock that is `ahead`."""
    generator = numpy.random.default_rng(seed)
    times = numpy.arange(-2.0, seconds + 2.0, 0.01)
    poses = [pose_at(t) for t in times.tolist()]
    positions = numpy.array([position for position, _ in poses])
    positions += 0.0005 * generator.standard_normal(positions.shape)
    return RecordedTrack(times + ahead, positions, numpy.array([attitude for _, attitude in poses]))


def walk(made: Scene, count: int, seed: int, noise: float = 0.2, known: bool = True) -> Walk:
    """A walk whose corners are off by `noise` pixels; its reference by 1 mm and 2 mrad."""
    generator = numpy.random.default_rng(seed)
    corners = numpy.array([tag.corners() for tag in made.tags]).reshape(-1, 3)
    parts, lenses, turns = [], [], []
    shown = bodies(count)
    for i, body in enumerate(shown):
        pixels, visible = project(CAMERA, body.position, body.attitude, corners)
        visible &= ((pixels > 0.0) & (pixels < (639.0, 479.0))).all(axis=1)
        whole = numpy.flatnonzero(numpy.repeat(visible.reshape(-1, 4).all(axis=1), 4))
        seen = pixels[whole] + noise * generator.standard_normal((len(whole), 2))
        parts.append((numpy.full(len(whole), i), whole // 4, whole % 4, seen))
        at, turn = optical_pose(CAMERA, body.position, body.attitude)
        lenses.append(numpy.array(at) + 0.01 * generator.standard_normal(3))
        off = multiply(turn, from_euler(*(0.01 * generator.standard_normal(3)).tolist()))
        turns.append(rotation(off))
    seen = Seen(*(numpy.concatenate(part) for part in zip(*parts, strict=True)))
    reference = _reference(shown, generator) if known else None
    at, turn = numpy.array(lenses), numpy.array(turns)
    return Walk(made.believed, made.survey, at, turn, seen, reference)


def _reference(shown, generator) -> KnownPoses:
    positions = numpy.array([body.position for body in shown])
    turns = []
    for body in shown:
        off = from_euler(*(0.002 * generator.standard_normal(3)).tolist())
        turns.append(rotation(multiply(body.attitude, off)))
    still = numpy.zeros_like(positions)
    frames = numpy.arange(len(shown))
    positions = positions + 0.001 * generator.standard_normal(positions.shape)
    return KnownPoses(frames, positions, numpy.array(turns), still, still)


def lens_errors(found: WalkCalibration, camera: Camera = CAMERA) -> numpy.ndarray:
    """What is still wrong: the focal length's share, the centre's pixels, k1."""
    true, lens = camera.lens, found.camera.lens
    focal = (lens.fx - true.fx) / found.walk.camera.lens.fx
    k1 = lens.distortion[0] - true.distortion[0]
    return numpy.array((focal, lens.cx - true.cx, lens.cy - true.cy, k1))


def mount_errors(found: WalkCalibration, camera: Camera = CAMERA) -> numpy.ndarray:
    """What is still wrong: metres, then radians about the body's axes."""
    apart = rotation(found.camera.attitude) @ rotation(camera.attitude).T
    return numpy.append(
        numpy.subtract(found.camera.position, camera.position), rotation_vector(apart[None])[0]
    )


def aligned(off: numpy.ndarray, tags: list[Tag]) -> numpy.ndarray:
    """The errors of a map, (t, 3), but for what moves all of it as one, to first order."""
    places = numpy.array([tag.position for tag in tags])
    none, one = numpy.zeros(len(tags)), numpy.ones(len(tags))
    x, y, z = places.T
    moves = numpy.array(
        [
            [one, none, none], [none, one, none], [none, none, one],
            [none, -z, y], [z, none, -x], [-y, x, none],
        ]
    )  # fmt: skip
    columns = numpy.moveaxis(moves, 2, 1).reshape(6, -1).T
    rest = off.ravel() - columns @ numpy.linalg.lstsq(columns, off.ravel(), rcond=None)[0]
    return rest.reshape(-1, 3)
