"""The estimator on printed tags: from drawn frames that come late to what the vehicle does now."""

from __future__ import annotations

from itertools import product
from math import cos, degrees, pi, sin

import pytest

numpy = pytest.importorskip("numpy")
pytest.importorskip("cv2")


from part_bench import SITE  # noqa: E402
from tag_floors import (  # noqa: E402
    CAMERA,
    frame,
    grid,
    lively,
    misplaced,
    off,
    pad,
    room,
    truth_at,
)

from kybflow.core.geometry import from_euler, heading_of, wrap  # noqa: E402
from kybflow.core.signals import NS, Frame  # noqa: E402
from kybflow.runtime.estimators.tag_camera import TagCamera, TagCameraParams  # noqa: E402
from kybflow.world.tags import TagMap  # noqa: E402

TAGS = grid()
RATE, LATENCY = 30, 0.04


def errors_of(pose_at, seconds, drawn, tags, begin=0.5, weakness=lambda t: {}, context=SITE):
    """Errors of every estimate from `begin` on: of position and height (metres), heading
    (radians); None for one that is missing. Then these estimates."""
    context = context._replace(tags=TagMap(tags), cameras={"down": CAMERA})
    estimator = TagCamera(TagCameraParams(), context)
    errors, estimates, taken = [], [], 0
    for tick in range(round(100 * seconds)):
        now, frames = tick / 100, []
        while taken / RATE + LATENCY <= now:
            t = taken / RATE
            frames.append(frame(drawn, truth_at(pose_at, t), t, **weakness(t)))
            taken += 1
        estimate = estimator.update(frames, round(now * NS))
        if now >= begin:
            errors.append(None if estimate is None else _wrong(estimate, truth_at(pose_at, now)))
            estimates.append(estimate)
    return errors, estimates


def _wrong(estimate, body):
    return (
        off(estimate.position, estimate.attitude, body)[0],
        abs(estimate.position[2] - body.position[2]),
        abs(wrap(heading_of(estimate.attitude) - heading_of(body.attitude))),
    )


def checked(errors):
    assert None not in errors
    places, _, headings = zip(*errors, strict=True)
    assert numpy.mean(places) <= 0.008
    assert numpy.quantile(places, 0.99) <= 0.025
    assert degrees(numpy.mean(headings)) <= 0.5


def test_it_needs_frames():
    assert TagCamera.needs == {Frame}


@pytest.fixture(scope="module")
def undisturbed():
    return errors_of(lively(), 3.0, room(TAGS), TAGS)


@pytest.mark.thorough
def test_in_flight_the_error_is_a_few_millimetres(undisturbed):
    errors, (*_, estimate) = undisturbed
    checked(errors)
    assert estimate.source == "tag_camera"
    assert 0.04 <= estimate.age <= 0.04 + 1.0 / RATE + 0.01
    assert 0.01 < estimate.spread < 0.02  # what calibration and survey leave open


@pytest.mark.slow
def test_over_a_minute_of_flight_the_error_is_a_few_millimetres():
    checked(errors_of(lively(), 60.0, room(TAGS), TAGS)[0])


@pytest.mark.thorough
def test_a_map_of_which_a_third_is_wrong_costs_nothing(undisturbed):
    wrong, _ = misplaced(TAGS, 0.3, numpy.random.default_rng(4))
    errors, _ = errors_of(lively(), 1.5, room(TAGS), wrong)
    assert None not in errors
    clean = undisturbed[0][: len(errors)]
    assert numpy.mean([e[0] for e in errors]) <= 2.0 * numpy.mean([e[0] for e in clean])


@pytest.mark.thorough
def test_in_the_dark_the_estimate_ages_and_afterwards_it_is_right_again():
    dark = {"weakness": lambda t: {"dark": 0.8 < t < 1.3}}
    errors, estimates = errors_of(lively(), 2.0, room(TAGS), TAGS, begin=0.0, **dark)
    assert None not in errors[-20:]
    assert max(e[0] for e in errors[-20:]) < 0.02
    assert estimates[119].age > 0.35


@pytest.mark.thorough
def test_where_the_vehicle_is_carried_off_there_is_no_estimate_and_then_the_right_one():
    def carried(t):
        (x, y, z), attitude = lively()(t)
        return (x + (0.6 if t > 0.62 else 0.0), y, z), attitude

    errors, _ = errors_of(carried, 1.3, room(TAGS), TAGS)
    missing = [i for i, error in enumerate(errors) if error is None]
    assert 10 <= len(missing) <= 20
    assert missing == list(range(missing[0], missing[-1] + 1))
    assert max(error[0] for error in errors[missing[-1] + 20 :]) < 0.01


HEIGHTS, LIGHTS = (0.1, 0.13, 0.17, 0.2, 0.25), (0.8, 0.15, 0.4, 1.0, 1.5)
QUICK = ((0.1, 0.8),)
THOROUGH = ((0.13, 0.15), (0.17, 0.4), (0.25, 1.5))


@pytest.mark.parametrize(
    ("height", "brightness"),
    [
        *QUICK,
        *(pytest.param(*case, marks=pytest.mark.thorough) for case in THOROUGH),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in product(HEIGHTS, LIGHTS)
            if case not in (*QUICK, *THOROUGH)
        ),
    ],
)
def test_it_takes_off_from_a_pad_of_small_tags(height, brightness):
    """The lowest ones see no tag as a whole."""

    def up(t):
        z = height + 0.15 * (1.0 - cos(pi * min(t, 1.5) / 1.5))
        return (0.0, 0.0, z), from_euler(0.01 * sin(3 * t), 0.01 * cos(2 * t), 0.02 * sin(t))

    tags = pad()
    context = SITE._replace(start=(0.0, 0.0, height))
    errors, _ = errors_of(up, 1.6, room(tags, brightness=brightness), tags, context=context)
    assert None not in errors
    assert max(error[1] for error in errors) <= 0.01


def test_a_frame_of_an_unknown_camera_says_so():
    context = SITE._replace(tags=TagMap(TAGS), cameras={"down": CAMERA})
    body = truth_at(lively(), 0.0)
    strange = frame(room(TAGS), body)._replace(camera="front")
    with pytest.raises(ValueError, match="no camera `front`"):
        TagCamera(TagCameraParams(), context).update([strange], 0)
