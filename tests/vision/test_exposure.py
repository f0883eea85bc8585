"""Blur and noise have the sizes that their formulas say."""

from __future__ import annotations

from math import sqrt

import pytest

pytest.importorskip("cv2")

import numpy

from kybflow.vision.rendering.drawing import ImageNoise, blur_lens, streak
from kybflow.world.cameras import Optics


@pytest.mark.parametrize(("dx", "dy"), [(6.0, 0.0), (3.0, -4.0), (0.3, 0.2), (-7.3, 1.1)])
def test_a_streak_is_a_line_about_its_middle(dx: float, dy: float) -> None:
    kernel = streak(dx, dy)
    half = len(kernel) // 2
    x = numpy.arange(-half, half + 1)
    assert kernel.sum() == pytest.approx(1.0, abs=1e-5)
    assert kernel.sum(axis=0) @ x == pytest.approx(0.0, abs=1e-5)
    assert kernel.sum(axis=1) @ x == pytest.approx(0.0, abs=1e-5)
    # a line's variance is length^2/12; a pixel's linear weights add at most 1/4
    assert 0.0 <= kernel.sum(axis=0) @ x**2 - dx * dx / 12.0 <= 0.25
    assert 0.0 <= kernel.sum(axis=1) @ x**2 - dy * dy / 12.0 <= 0.25


@pytest.mark.parametrize("depth", [0.1, 0.2, 0.8])
def test_the_blur_of_a_point_is_the_thin_lens_disc(depth: float) -> None:
    optics = Optics(blur=1.0, focus=0.4, aperture=0.003)
    image = numpy.zeros((101, 101), numpy.uint8)
    image[:, 50:] = 200
    edge = numpy.diff(blur_lens(image, optics, 500.0, depth, 0.0)[50].astype(float)) / 200.0
    disc = 500.0 * 0.003 * max(0.0, 1.0 / depth - 1.0 / 0.4)
    spread = sqrt(edge @ (numpy.arange(100) - edge @ numpy.arange(100)) ** 2)
    assert spread == pytest.approx(sqrt(1.0 + (disc / 4.0) ** 2), rel=0.05)


def test_noise_grows_with_the_light_as_asked() -> None:
    optics = Optics(brightness=0.8, read_noise=2.0, shot_noise=5.0)
    noise = ImageNoise(200, 300, numpy.random.default_rng(1))
    for light in (60, 150, 255):
        grey = 0.8 * light
        drawn = noise.expose(numpy.full((200, 300), light, numpy.uint8), optics).astype(float)
        assert drawn.mean() == pytest.approx(grey, abs=0.1)
        expected = sqrt(4.0 + 25.0 * grey / 255.0 + 1.0 / 12.0)  # the last is by rounding
        assert drawn.std() == pytest.approx(expected, rel=0.03)


def test_too_much_light_is_white_and_none_is_black() -> None:
    noise = ImageNoise(20, 30, numpy.random.default_rng(1))
    optics = Optics(brightness=2.0, read_noise=0.0, shot_noise=0.0)
    assert (noise.expose(numpy.full((20, 30), 200, numpy.uint8), optics) == 255).all()
    assert (noise.expose(numpy.zeros((20, 30), numpy.uint8), optics) == 0).all()
