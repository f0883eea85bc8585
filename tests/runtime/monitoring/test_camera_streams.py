"""CameraStreams are told apart by the times and images of their frames alone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy
import pytest

from kybflow.core.events import VehicleEvent
from kybflow.core.signals import NS, Frame, Time
from kybflow.parts.events import CameraFroze, CameraLostEvent, CameraRecovered
from kybflow.runtime.monitoring.bodies import AGREEING_POSES
from kybflow.runtime.monitoring.cameras import CameraStreams
from kybflow.world.cameras import Camera, Lens

LENS = Lens(320, 240, 200.0, 200.0, 159.5, 119.5)
RATE = 20.0
STEP = round(NS / RATE)
MS = NS // 1000


def cameras(rate: float = RATE, *names: str) -> CameraStreams:
    return CameraStreams(
        {n: Camera(n, LENS, (0.0, 0.0, 0.0), rate=rate) for n in names or ("down",)}
    )


def noise(seed: int) -> Any:
    return numpy.random.default_rng(seed).integers(90, 110, (240, 320), numpy.uint8)


def found_in(
    judge: CameraStreams, images: list[Any], begin: int = 0, airborne: bool = True
) -> list[VehicleEvent]:
    """What is found in frames that come one after another; None where one doesn't."""

    def found() -> Iterator[VehicleEvent]:
        for k, image in enumerate(images, begin):
            frames = [] if image is None else [Frame(k * STEP - 40 * MS, "down", image)]
            yield from judge.judge(frames, k * STEP, airborne)

    return list(found())


def test_nothing_is_said_of_a_camera_that_works() -> None:
    judge = cameras()
    assert found_in(judge, [noise(k) for k in range(50)]) == []
    assert judge.wrong == {}


def test_nor_of_one_that_has_given_nothing_yet() -> None:
    assert found_in(cameras(), [None] * 50) == []


@pytest.mark.parametrize(("rate", "bound"), [(100.0, 0.15), (20.0, 0.15), (10.0, 0.3), (4.0, 0.75)])
def test_it_is_lost_when_it_is_silent_for_longer_than_its_rate_explains(
    rate: float, bound: float
) -> None:
    judge = cameras(rate)
    assert judge.judge([Frame(0, "down", noise(0))], 0, True) == []
    assert judge.due == round(bound * NS)
    assert judge.judge([], judge.due, True) == []
    (found,) = judge.judge([], judge.due + 4 * MS, True)
    assert found == CameraLostEvent(camera="down", value=pytest.approx(bound + 0.004), bound=bound)
    assert judge.judge([], 10 * NS, True) == [], "once"
    assert judge.due > 10 * NS


def test_it_recovers_after_a_few_frames() -> None:
    judge = cameras()
    found_in(judge, [noise(0), *[None] * 10])
    assert {camera: event.name for camera, event in judge.wrong.items()} == {"down": "camera_lost"}
    assert found_in(judge, [noise(k) for k in range(1, AGREEING_POSES)], 11) == []
    assert found_in(judge, [noise(AGREEING_POSES)], 10 + AGREEING_POSES) == [
        CameraRecovered(camera="down")
    ]
    assert judge.wrong == {}


def test_it_froze_when_images_are_the_same_in_the_air() -> None:
    judge = cameras()
    kept = noise(9)
    (found,) = found_in(judge, [noise(0), *[kept] * 20])
    assert found == CameraFroze(camera="down", value=pytest.approx(3 / RATE), bound=0.1)
    assert found_in(judge, [kept, *(noise(k) for k in range(AGREEING_POSES))], 21) == [
        CameraRecovered(camera="down")
    ]


def test_one_image_twice_is_no_finding() -> None:
    assert found_in(cameras(), [noise(k // 2) for k in range(20)]) == []


def test_nor_is_a_still_image_on_the_ground() -> None:
    judge = cameras()
    assert found_in(judge, [noise(0)] * 20, airborne=False) == []
    assert found_in(judge, [noise(0)] * 2, 20) == [], "its time counts from the take-off"
    (found,) = found_in(judge, [noise(0)], 22)
    assert found.name == "camera_froze"


def test_nor_is_an_image_in_which_nothing_is_to_be_seen() -> None:
    dark = numpy.zeros((240, 320), numpy.uint8)
    assert found_in(cameras(), [dark] * 20) == []
    (found,) = found_in(cameras(), [numpy.where(noise(1) > 100, 1, dark)] * 20)
    assert found.name == "camera_froze", "noise and nothing else must change too"


def test_an_image_that_is_written_over_is_compared_with_what_it_was() -> None:
    buffer, judge = noise(0), cameras()
    for k in range(20):
        buffer[:] = noise(k)
        assert judge.judge([Frame(k * STEP, "down", buffer)], k * STEP, True) == []


def test_one_that_freezes_and_then_falls_silent_is_told_twice() -> None:
    judge = cameras()
    found = found_in(judge, [noise(0)] * 6 + [None] * 10)
    assert [f.name for f in found] == ["camera_froze", "camera_lost"]


def test_cameras_are_judged_each_for_itself() -> None:
    judge = cameras(RATE, "down", "front")

    def frames(k: int) -> Iterator[Frame]:
        time: Time = k * STEP
        yield Frame(time, "down", noise(0))
        yield Frame(time, "front", noise(k))

    found = [f for k in range(20) for f in judge.judge(list(frames(k)), k * STEP, True)]
    assert [(f.name, f.camera) for f in found] == [("camera_froze", "down")]
