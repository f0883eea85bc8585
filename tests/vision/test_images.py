"""A frame as a picture for people."""

from __future__ import annotations

import pytest

pytest.importorskip("cv2")

import cv2
import numpy
from tag_floors import CAMERA, grid

from kybflow.vision.images import MAX_PICTURE, marked
from kybflow.vision.locating.locate import TagView


def square(x, y, side=100.0):
    return [(x, y), (x + side, y), (x + side, y + side), (x, y + side)]


def colour(picture, x, y):
    """The strongest of blue, green and red around a pixel, None for grey."""
    level = picture[y - 1 : y + 2, x - 1 : x + 2].reshape(-1, 3).mean(axis=0)
    return "bgr"[int(level.argmax())] if numpy.ptp(level) > 50.0 else None


def test_used_tags_are_green_and_others_red():
    first, second, third = grid(3, 1)
    outside = square(500.0, 300.0)
    outside[2:] = [(numpy.nan, numpy.nan)] * 2
    corners = numpy.array([square(50.0, 50.0), square(250.0, 50.0), outside])
    view = TagView(CAMERA, [first, second, third], corners)
    image = numpy.full((480, 640), 128, numpy.uint8)

    data = marked(image, view, {(first.family, first.id), (third.family, third.id)})

    picture = cv2.imdecode(numpy.frombuffer(data, numpy.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (480, 640, 3)
    assert (colour(picture, 50, 80), colour(picture, 350, 80)) == ("g", "r")
    assert (colour(picture, 550, 300), colour(picture, 550, 400)) == ("g", None)
    assert colour(picture, 450, 250) is None


def test_without_a_pose_nothing_is_drawn_and_a_wide_picture_becomes_smaller():
    image = numpy.full((1000, 2000), 90, numpy.uint8)
    picture = cv2.imdecode(numpy.frombuffer(marked(image, None, ()), numpy.uint8), 1)
    assert picture.shape == (400, MAX_PICTURE, 3)
    assert numpy.abs(picture.astype(int) - 90).max() <= 1
