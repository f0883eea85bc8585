"""Tags in drawn images, and the pose from them: searched, searched widely, and in whole images."""

from __future__ import annotations

import pytest

pytest.importorskip("cv2")

import numpy
from tag_floors import CAMERA, frame, grid, lively, misplaced, moved, off, room, still, truth_at

from kybflow.core.geometry import LEVEL, from_euler
from kybflow.vision.locating.locate import BodyMotion
from kybflow.vision.locating.locator import Detector, Locator, Prediction, WideSearch
from kybflow.vision.locating.search import Search, Shapes
from kybflow.vision.projection import project
from kybflow.world.tags import Tag, TagMap

TAGS = grid()
BODY = still((0.9, 1.0, 1.2), from_euler(0.06, -0.08, 0.7))


def whole(tags, body=BODY, camera=CAMERA, margin=3.0):
    """The tags that are wholly in the image."""
    pixels, _ = project(
        camera, body.position, body.attitude, numpy.array([t.corners() for t in tags])
    )
    inside = ((pixels >= margin) & (pixels <= (639 - margin, 479 - margin))).all(axis=(1, 2))
    return [tag for tag, is_in in zip(tags, inside, strict=True) if is_in], pixels[inside]


def predicted(body, by=(0.0, 0.0, 0.0), turned=(0.0, 0.0, 0.0), spread=0.01, turn=0.01):
    return Prediction(
        *moved(body, by, turned), BodyMotion(body.velocity, body.angular_velocity), spread, turn
    )


def test_the_search_finds_what_the_detector_finds_and_its_corners_are_right():
    image = frame(room(TAGS), BODY).image
    expected, corners = whole(TAGS)
    guess = moved(BODY, (0.005, -0.005, 0.01), (0.005, 0.003, -0.005))
    view, count = Search(Shapes()).find(image, CAMERA, guess, TAGS, off=10.0)
    assert count >= len(view.tags) == len(expected) > 20
    order = [view.tags.index(tag) for tag in expected]
    errors = view.corners[order] - corners
    assert numpy.sqrt((errors**2).mean()) < 0.08
    assert numpy.abs(errors.mean(axis=(0, 1))).max() < 0.02
    found = {tag.id: tag.corners for tag in Detector(["36h11"]).find(image)}
    assert {tag.id for tag in expected} <= set(found)
    for tag, seen in zip(view.tags, view.corners, strict=True):
        assert numpy.abs(found[tag.id] - seen).max() < 3.0


def test_a_tag_of_another_pattern_or_covered_or_missing_is_not_taken_for_the_predicted_one():
    image = frame(room(TAGS, covered=0.3, missing=0.2), BODY).image
    search = Search(Shapes())
    view, count = search.find(image, CAMERA, moved(BODY), TAGS, off=4.0)
    assert 0.4 * count < len(view.tags) < 0.9 * count
    exchanged = [tag._replace(id=tag.id + 300) for tag in TAGS]
    assert search.find(image, CAMERA, moved(BODY), exchanged, off=4.0)[0].tags == []
    turned = [tag._replace(attitude=from_euler(0.0, 0.0, 1.5708)) for tag in TAGS]
    assert Search(Shapes()).find(image, CAMERA, moved(BODY), turned, off=4.0)[0].tags == []


def test_where_there_are_no_tags_none_is_found():
    generator = numpy.random.default_rng(1)
    noise = generator.integers(0, 256, (480, 640), numpy.uint8)
    for image in (noise, numpy.zeros_like(noise), numpy.full_like(noise, 255)):
        assert Search(Shapes()).find(image, CAMERA, moved(BODY), TAGS, off=10.0)[0].tags == []
        assert WideSearch(Shapes()).find(image, CAMERA, moved(BODY), TAGS, off=40.0).tags == []
        assert Detector(["36h11"]).find(image) == []


LIGHT = [
    pytest.param({}, 0.001, id="default"),
    pytest.param({"brightness": 0.12}, 0.001, id="dim", marks=pytest.mark.thorough),
    pytest.param({"brightness": 2.0}, 0.004, id="overexposed", marks=pytest.mark.thorough),
    pytest.param(
        {"read_noise": 8.0, "shot_noise": 6.0}, 0.001, id="noisy", marks=pytest.mark.thorough
    ),
    pytest.param({"blur": 2.5}, 0.006, id="out of focus"),
    pytest.param({"exposure": 0.015}, 0.008, id="moving"),
    pytest.param({"covered": 0.3}, 0.001, id="covered", marks=pytest.mark.thorough),
]


@pytest.mark.thorough
@pytest.mark.parametrize(("optics", "metres"), LIGHT)
def test_the_pose_is_right_in_every_light_though_the_prediction_is_wrong(optics, metres):
    locator = Locator(TagMap(TAGS), {"down": CAMERA})
    drawn, generator = room(TAGS, **optics), numpy.random.default_rng(6)
    for t in (0.3, 1.9, 3.1):
        body = truth_at(lively(), t)
        by, turned = generator.normal(0.0, 0.02, 3), generator.normal(0.0, 0.02, 3)
        guess = predicted(body, by.tolist(), turned.tolist(), 0.02, 0.02)
        located = locator.locate([frame(drawn, body, t)], guess)
        apart, angle = off(*located[:2], body)
        assert apart < metres
        assert angle < 3.0 * metres
        assert len(located.used) > 10


def test_without_a_prediction_and_with_a_wrong_one_the_whole_image_is_searched():
    drawn = room(TAGS)
    lost = predicted(BODY, (0.8, 0.3, 0.2), (0.2, 0.1, 1.5))
    for guess in (None, lost):
        locator = Locator(TagMap(TAGS), {"down": CAMERA})
        located = locator.locate([frame(drawn, BODY)], guess)
        assert off(*located[:2], BODY)[0] < 0.001


def test_tags_that_are_wrong_in_the_map_are_left_out():
    tags, wrong = misplaced(TAGS, 0.3, numpy.random.default_rng(7))
    locator = Locator(TagMap(tags), {"down": CAMERA})
    for guess in (predicted(BODY), None):
        located = locator.locate([frame(room(TAGS), BODY)], guess)
        assert off(*located[:2], BODY)[0] < 0.001
        assert not wrong & {key[1] for key in located.used}


@pytest.mark.thorough
def test_tags_that_lie_in_each_others_places_are_left_out():
    clean, mixed, generator = room(TAGS), room(TAGS, misplaced=0.3), numpy.random.default_rng(3)
    locators = [Locator(TagMap(TAGS), {"down": CAMERA}) for _ in range(2)]
    errors, used = ([], []), ([], [])
    for t in numpy.arange(0.0, 7.0, 0.5).tolist():
        body = truth_at(lively(), t)
        guess = predicted(body, generator.normal(0.0, 0.006, 3).tolist())
        for i, drawn in enumerate((clean, mixed)):
            located = locators[i].locate([frame(drawn, body, t)], guess)
            errors[i].append(off(*located[:2], body)[0])
            used[i].append(len(located.used))
    assert 0.55 < numpy.sum(used[1]) / numpy.sum(used[0]) < 0.85
    assert numpy.mean(errors[1]) <= 2.0 * numpy.mean(errors[0])


@pytest.mark.thorough
def test_tags_in_each_others_places_are_left_out_without_a_prediction():
    for seed in range(6):
        locator = Locator(TagMap(TAGS), {"down": CAMERA})
        located = locator.locate([frame(room(TAGS, seed, misplaced=0.3), BODY)], None)
        assert off(*located[:2], BODY)[0] < 0.001


@pytest.mark.thorough
def test_in_the_dark_there_is_no_pose_and_the_whole_image_is_searched_ever_more_rarely():
    locator, drawn = Locator(TagMap(TAGS), {"down": CAMERA}), room(TAGS)
    searched = []
    find = locator._detector.find
    for i in range(20):
        locator._detector.find = lambda image, i=i: searched.append(i) or find(image)
        assert locator.locate([frame(drawn, BODY, dark=True)], predicted(BODY)) is None
    assert searched == [0, 1, 3, 6, 10, 15]
    assert any(locator.locate([frame(drawn, BODY)], None) for _ in range(6))


@pytest.mark.thorough
def test_two_cameras_give_one_pose():
    back = CAMERA._replace(name="back", position=(-0.15, 0.02, -0.02))
    locator, drawn = Locator(TagMap(TAGS), {"down": CAMERA, "back": back}), room(TAGS)
    frames = [frame(drawn, BODY), frame(drawn, BODY, camera=back)]
    both = locator.locate(frames, predicted(BODY))
    one = locator.locate(frames[:1], predicted(BODY))
    assert off(*both[:2], BODY)[0] < 0.001
    assert numpy.trace(both.covariance) < numpy.trace(one.covariance)
    assert len(both.used) > len(set(both.used)) > len(one.used) // 2


@pytest.mark.thorough
@pytest.mark.parametrize("family", ["25h9", "aruco_4x4", "aruco_5x5"])
def test_other_families_are_found_as_well(family):
    tags = grid(5, 5, family=family)
    body = still((0.35, 0.4, 0.8), from_euler(0.05, 0.02, -0.4))
    locator = Locator(TagMap(tags), {"down": CAMERA})
    image = frame(room(tags), body)
    for guess in (predicted(body, (0.01, 0.01, 0.0)), None):
        assert off(*locator.locate([image], guess)[:2], body)[0] < 0.001


def test_tags_far_away_are_not_looked_at():
    far = [Tag("36h10", i, 0.195, (50.0 + i % 50, 50.0 + i // 50, 0.0), LEVEL) for i in range(2000)]
    locator = Locator(TagMap([*TAGS, *far]), {"down": CAMERA})
    (*_, near) = next(locator._seen([frame(room(TAGS), BODY)], moved(BODY)))
    assert {tag.family for tag in near} == {"36h11"}
    assert set(whole(TAGS)[0]) <= set(near)
