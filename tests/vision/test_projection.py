"""World to pixel and back, judged by OpenCV."""

from __future__ import annotations

import random
from math import sqrt

import pytest

pytest.importorskip("cv2")

import cv2
import numpy

from kybflow.core.geometry import LEVEL, ZERO, from_euler, rotate
from kybflow.vision.projection import (
    coefficients,
    distort,
    matrix,
    optical_pose,
    project,
    reach,
    rotation,
    undistort,
)
from kybflow.world.cameras import Camera, Lens

BARREL = Lens(640, 480, 460.0, 462.0, 322.0, 238.0, (-0.25, 0.08, 0.001, -0.002, -0.005))
PINCUSHION = Lens(1280, 720, 900.0, 905.0, 641.0, 355.0, (0.12, -0.05, -0.001, 0.0005, 0.02))
PLAIN = Lens(320, 240, 250.0, 250.0, 159.5, 119.5)
LENSES = pytest.mark.parametrize("lens", [BARREL, PINCUSHION, PLAIN])


@LENSES
def test_it_projects_as_opencv_does(lens: Lens) -> None:
    chance = random.Random(4)
    camera = Camera("down", lens, (0.1, -0.02, -0.05))
    position, attitude = (0.4, -0.3, 1.3), from_euler(0.15, -0.1, 2.0)
    points = numpy.array(
        [[chance.uniform(-0.3, 1.1), chance.uniform(-1, 0.4), 0.1] for _ in range(50)]
    )
    at, turn = optical_pose(camera, position, attitude)
    away = rotation(turn).T
    expected, _ = cv2.projectPoints(
        points, cv2.Rodrigues(away)[0], -away @ at, matrix(lens), coefficients(lens)
    )
    pixels, visible = project(camera, position, attitude, points)
    assert visible.all()
    assert pixels == pytest.approx(expected[:, 0], abs=1e-6)


def test_a_camera_that_looks_down_has_forward_up_and_left_left() -> None:
    camera = Camera("down", PLAIN, ZERO)
    pixels, _ = project(
        camera, (0, 0, 1), LEVEL, numpy.array([[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0]])
    )
    assert pixels == pytest.approx(numpy.array([[159.5, 119.5], [159.5, 69.5], [109.5, 119.5]]))


@LENSES
def test_undistort_is_the_inverse(lens: Lens) -> None:
    chance = random.Random(5)
    pixels = numpy.array(
        [[chance.uniform(0, lens.width), chance.uniform(0, lens.height)] for _ in range(200)]
    )
    assert distort(lens, undistort(lens, pixels)) == pytest.approx(pixels, abs=1e-8)


def test_a_matrix_turns_as_its_quaternion() -> None:
    q = from_euler(0.3, -0.5, 1.1)
    assert rotation(q) @ (1.0, 2.0, 3.0) == pytest.approx(rotate(q, (1.0, 2.0, 3.0)))


def test_what_is_behind_or_beyond_the_model_is_not_visible() -> None:
    folding = Lens(640, 480, 460.0, 460.0, 320.0, 240.0, (-0.3, 0.0, 0.0, 0.0, 0.0))
    assert reach(folding) == pytest.approx(1.0 / sqrt(0.9))
    camera = Camera("down", folding, ZERO)
    points = numpy.array([[0, 0, 0], [0, 0, 2], [1.0, 0, 0], [1.1, 0, 0]])
    assert project(camera, (0, 0, 1), LEVEL, points)[1].tolist() == [True, False, True, False]


def test_a_pixel_that_no_ray_reaches_gives_something_finite() -> None:
    folding = Lens(640, 480, 250.0, 250.0, 320.0, 240.0, (-0.3, 0.0, 0.0, 0.0, 0.0))
    flat = undistort(folding, numpy.array([[639.0, 479.0], [320.0, 240.0]]))
    assert numpy.isfinite(flat).all()
    assert numpy.linalg.norm(flat[0]) == pytest.approx(reach(folding), rel=0.01)
    assert flat[1] == pytest.approx((0.0, 0.0))
