"""The pose from corners: right, with an honest covariance, and even where tags are misplaced."""

from __future__ import annotations

from math import degrees

import pytest

pytest.importorskip("cv2")

import numpy
from hypothesis import given, settings
from hypothesis import strategies as st
from tag_floors import CAMERA, grid, lively, misplaced, moved, off, pad, still, truth_at

from kybflow.core.geometry import LEVEL, conjugate, from_euler, integrate, multiply, sub
from kybflow.vision.locating.locate import BodyMotion, TagView, locate
from kybflow.vision.projection import project
from kybflow.world.tags import Tag

GLOBAL = CAMERA._replace(row_time=0.0)
OVER = (0.95, 0.95, 1.2)


def seen(body, tags, generator=None, noise=0.0, camera=GLOBAL):
    """The view of the tags that are wholly in the image."""
    corners, inside = [], []
    for tag in tags:
        pixels, visible = project(camera, body.position, body.attitude, numpy.array(tag.corners()))
        within = (pixels >= 0) & (pixels <= (639, 479))
        if visible.all() and within.all():
            corners.append(pixels)
            inside.append(tag)
    corners = numpy.array(corners).reshape(-1, 4, 2)
    if generator is not None:
        corners = corners + generator.normal(0.0, noise, corners.shape)
    return TagView(camera, inside, corners)


small = st.floats(-0.25, 0.25)


@given(
    position=st.tuples(st.floats(0.7, 1.2), st.floats(0.7, 1.2), st.floats(0.6, 2.0)),
    turn=st.tuples(small, small, st.floats(-3.1, 3.1)),
)
@settings(max_examples=25)
def test_without_noise_the_pose_is_exact_wherever_it_starts(position, turn):
    body = still(position, from_euler(*turn))
    view = seen(body, grid())
    guess = moved(body, (0.1, -0.05, 0.1), (0.05, -0.05, 0.1))
    for start in (None, guess):
        located = locate([view], start)
        assert off(located.position, located.attitude, body) == pytest.approx((0, 0), abs=1e-5)
        assert len(located.used) == len(view.tags)


@pytest.mark.thorough
def test_the_covariance_is_that_of_the_errors():
    """The mean of the squared normalised error is the number of dimensions (chi-squared)."""
    generator = numpy.random.default_rng(2)
    body = still(OVER, from_euler(0.05, -0.1, 1.0))
    squares = []
    for _ in range(100):
        located = locate([seen(body, grid(), generator, 0.3)], moved(body, (0.01, 0.0, 0.0)))
        turn = multiply(conjugate(body.attitude), located.attitude)
        sign = 2.0 if turn[0] > 0.0 else -2.0
        error = (*sub(located.position, body.position), *(sign * x for x in turn[1:]))
        squares.append(error @ numpy.linalg.solve(located.covariance, error))
    assert 5.0 < numpy.mean(squares) < 7.0


@pytest.mark.parametrize(
    ("start", "by"),
    [
        (True, 0.3),
        pytest.param(False, 0.02, marks=pytest.mark.thorough),
        pytest.param(True, 0.02, marks=pytest.mark.thorough),
        pytest.param(False, 0.3, marks=pytest.mark.thorough),
    ],
)
def test_tags_that_are_wrong_in_the_map_are_left_out(by, start):
    """30 % of them: the error stays within twice that of a right map."""
    generator = numpy.random.default_rng(3)
    clean, wrong = [], []
    for _ in range(15):
        body = still((*generator.uniform(0.7, 1.2, 2).tolist(), 1.2), from_euler(0.1, 0.0, 2.0))
        view = seen(body, grid(), generator, 0.3)
        tags, ids = misplaced(list(view.tags), 0.3, generator, by)
        guess = moved(body, (0.02, 0.0, -0.01), (0.01, 0.01, 0.02)) if start else None
        clean.append(off(*locate([view], guess)[:2], body)[0])
        located = locate([view._replace(tags=tags)], guess)
        wrong.append(off(*located[:2], body)[0])
        assert len(ids & {key[1] for key in located.used}) <= (0 if by > 0.1 else 2)
    assert numpy.mean(wrong) <= 2.0 * numpy.mean(clean)


def test_a_lone_tag_has_the_pose_that_is_nearer_to_the_start():
    tag = Tag("36h11", 0, 0.195, (0.0, 0.0, 0.0), LEVEL)
    for turn in ((0.3, 0.1, 0.5), (-0.25, 0.2, -2.0)):
        body = still((-0.2, 0.1, 1.5), from_euler(*turn))
        view = seen(body, [tag])
        located = locate([view], moved(body, (0.02, 0.02, 0.02), (0.03, 0.0, 0.03)))
        assert off(*located[:2], body) == pytest.approx((0, 0), abs=1e-4)


def test_two_cameras_that_see_a_tag_each_tell_more_than_one():
    generator = numpy.random.default_rng(4)
    body = still((0.0, 0.0, 1.0), from_euler(0.05, 0.1, 0.3))
    left = GLOBAL._replace(name="left", position=(0.0, 0.3, 0.0))
    right = GLOBAL._replace(name="right", position=(0.0, -0.3, 0.0))
    tags = pad(size=0.1, pitch=0.45)
    views = [seen(body, tags, generator, 0.3, camera) for camera in (left, right)]
    views = [view._replace(tags=view.tags[:1], corners=view.corners[:1]) for view in views]
    both, one = locate(views), locate(views[:1], moved(body))
    assert off(*both[:2], body)[0] < 0.02
    assert numpy.trace(both.covariance) < 0.5 * numpy.trace(one.covariance)


def test_what_a_rolling_shutter_does_is_taken_off():
    pose_at, t = lively(radius=0.4, period=3.0), 0.4
    body = truth_at(pose_at, t)
    rolling = CAMERA._replace(row_time=3e-5)
    tags = [tag for tag in grid() if len(seen(body, [tag]).tags)]
    corners = numpy.zeros((len(tags), 4, 2))
    for _ in range(4):  # a corner is seen by the row in which it is seen
        for i, tag in enumerate(tags):
            for j, corner in enumerate(tag.corners()):
                late = (corners[i, j, 1] - 239.5) * rolling.row_time
                pixels, _ = project(rolling, *pose_at(t + late), numpy.array([corner]))
                corners[i, j] = pixels[0]
    view = TagView(rolling, tags, corners)
    aware = locate([view], moved(body), BodyMotion(body.velocity, body.angular_velocity))
    naive = locate([view], moved(body))
    assert off(*aware[:2], body)[0] < 0.0005
    assert off(*naive[:2], body)[0] > 0.002
    assert degrees(off(*aware[:2], body)[1]) < 0.02


def test_what_tells_no_pose_gives_none():
    generator = numpy.random.default_rng(5)
    body = still(OVER)
    view = seen(body, grid())
    assert locate([]) is None
    assert locate([TagView(GLOBAL, (), numpy.empty((0, 4, 2)))]) is None
    nonsense = view._replace(corners=generator.uniform(0.0, 480.0, view.corners.shape))
    assert locate([nonsense]) is None
    assert locate([nonsense], moved(body)) is None


@pytest.mark.parametrize("spread", [0.0, 30.0])
def test_corners_that_tell_no_pose_give_none(spread):
    """All in one place, or in a line: OpenCV's solver refuses them with an error of its own."""
    corners = numpy.full((4, 4, 2), 240.0)
    corners[..., 0] += spread * numpy.arange(16).reshape(4, 4)
    assert locate([TagView(GLOBAL, grid()[:4], corners)]) is None


def test_rates_that_are_in_doubt_are_solved_for():
    """A rolling shutter stretches the image where the body turns, which looks like a tilt."""
    rolling, turns = CAMERA._replace(row_time=3e-5), (0.6, -1.0, 0.2)
    body = still(OVER, from_euler(0.05, -0.04, 0.3))
    view = seen(body, grid())
    corners = view.corners.copy()
    for j, tag in enumerate(view.tags):
        for _ in range(4):  # each row when it is exposed
            late = (corners[j, :, 1] - 239.5) * rolling.row_time
            for i, t in enumerate(late):
                then = body._replace(attitude=integrate(body.attitude, turns, float(t)))
                corners[j, i] = seen_corner(then, tag, i)
    view = TagView(rolling, view.tags, corners)
    for motion, least, most in (
        (BodyMotion(), 0.5, 90.0),
        (BodyMotion(doubt=0.5), 0.0, 0.2),
        (BodyMotion(rates=turns), 0.0, 0.01),
    ):
        located = locate([view], (body.position, body.attitude), motion)
        turned = degrees(off(located.position, located.attitude, body)[1])
        assert least <= turned <= most, motion


def seen_corner(body, tag, i):
    corner = numpy.array(tag.corners())[i : i + 1]
    return project(CAMERA, body.position, body.attitude, corner)[0][0]
