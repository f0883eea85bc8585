"""The camera: a recorded video plays by its own times, a device by when its frames arrive."""

from __future__ import annotations

import queue
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from part_bench import SITE
from waiting import until

from kybflow.core.errors import DriverError
from kybflow.core.files import File, FilePath
from kybflow.core.signals import NS, Frame, Time
from kybflow.parts.base import Objection
from kybflow.sensors.camera import CameraSensor, CameraSensorParams, Captured, Device, Grabber
from kybflow.world.cameras import Camera, Lens

cv2 = pytest.importorskip("cv2")
numpy = pytest.importorskip("numpy")

WIDTH, HEIGHT, RATE, FRAMES = 64, 48, 20.0, 10
DOWN = Camera("down", Lens(WIDTH, HEIGHT, 60.0, 60.0, 31.5, 23.5), (0.0, 0.0, 0.0))
TWO = {"down": DOWN, "front": DOWN._replace(name="front")}
TICK = NS // 250


@pytest.fixture
def video(tmp_path: Path) -> str:
    """Ten frames at 20 Hz, each a little brighter than the one before."""
    path = str(tmp_path / "flight.avi")
    writer = cv2.VideoWriter(path, cv2.VideoWriter_fourcc(*"MJPG"), RATE, (WIDTH, HEIGHT))
    for i in range(FRAMES):
        writer.write(numpy.full((HEIGHT, WIDTH, 3), 20 * i, numpy.uint8))
    writer.release()
    return path


def opened(camera: Camera = DOWN, **params: Any) -> Any:
    context = SITE._replace(cameras={"down": camera})
    link: Any = None
    return CameraSensor.open(CameraSensorParams(**params), context, link, random.Random(0))


def played(video: str, latency: float) -> list[tuple[Time, Frame]]:
    """(the tick in which it arrived, the frame) of the whole video."""
    stream = opened(video=video, latency=latency)
    found: list[tuple[Time, Frame]] = []
    for tick in range(0, NS, TICK):
        if len(found) < FRAMES:
            found += [(tick, frame) for frame in stream.read(tick)]
    stream.close()
    return found


def test_a_video_plays_by_the_times_of_its_frames(video: str) -> None:
    frames = played(video, latency=0.03)
    assert [round(i * NS / RATE) for i in range(FRAMES)] == [frame.time for _, frame in frames]
    for now, frame in frames:
        assert 0 <= now - (frame.time + 0.03 * NS) < TICK, "in the first tick after its arrival"
        assert (frame.camera, frame.image.shape) == ("down", (HEIGHT, WIDTH))
    levels = [float(frame.image.mean()) for _, frame in frames]
    assert levels == pytest.approx([20 * i for i in range(FRAMES)], abs=3.0)


def test_it_plays_the_same_every_time(video: str) -> None:
    first, second = played(video, 0.05), played(video, 0.05)
    assert [now for now, _ in first] == [now for now, _ in second]
    assert all((a.image == b.image).all() for (_, a), (_, b) in zip(first, second, strict=True))


def test_its_end_is_told(video: str) -> None:
    stream = opened(video=video, latency=0.0)
    assert len(stream.read(NS)) == FRAMES
    with pytest.raises(DriverError, match="the video has ended"):
        stream.read(NS + TICK)


def test_frames_of_another_size_than_the_lens_are_refused(video: str) -> None:
    other = DOWN._replace(lens=DOWN.lens._replace(width=640, height=480))
    stream = opened(other, video=video, latency=0.0)
    with pytest.raises(DriverError, match=r"64 x 48, but the lens of `down` .* for 640 x 480"):
        stream.read(0)


def test_what_is_no_video_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DriverError, match=r"`no\.avi` no longer exists"):
        opened(video="no.avi")
    (tmp_path / "text.avi").write_text("no video")
    with pytest.raises(DriverError, match=r"text\.avi` can't be opened"):
        opened(video=str(tmp_path / "text.avi"))


def test_it_says_which_camera_it_can_not_be() -> None:
    def objection(**params: Any) -> Objection | None:
        return CameraSensor.objection(CameraSensorParams(**params), TWO)

    missing = "`camera` is missing; the airframe has `down`, `front`"
    unknown = "the airframe has no camera `dwon`; it has `down`, `front`"
    assert objection(camera="front") is None
    assert objection() == Objection("camera", missing, "write `camera: down`")
    assert objection(camera="dwon") == Objection("camera", unknown, "did you mean `down`?")


def test_what_it_gives_is_the_frames_of_its_camera() -> None:
    assert CameraSensor.claims(CameraSensorParams(camera="front"), TWO) == ["frames of `front`"]
    assert CameraSensor.claims(CameraSensorParams(), {"down": DOWN}) == ["frames of `down`"]


def test_a_device_goes_by_the_wall_clock_and_a_video_does_not() -> None:
    assert CameraSensor.real_time(CameraSensorParams())
    assert not CameraSensor.real_time(CameraSensorParams(video=FilePath("a.avi")))


def test_its_own_calibration_replaces_the_airframes_lens() -> None:
    text = (
        "image_width: 640\nimage_height: 480\n"
        "camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 501, 240, 0, 0, 1]}\n"
        "distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.01, 0, 0, 0]}\n"
    )
    params = CameraSensorParams(camera="front", calibration=File("cam.yaml", "", text))
    seen = CameraSensor.seen_by(params, TWO)
    assert seen["down"] == DOWN
    assert seen["front"].lens == Lens(640, 480, 500, 501, 320, 240, (-0.1, 0.01, 0.0, 0.0, 0.0))


class Stick:
    """A device that gives what the test puts in: an image, or None when it is pulled out."""

    def __init__(self) -> None:
        self.images: queue.Queue[Any] = queue.Queue()
        self.released = False

    def read(self) -> tuple[bool, Any]:
        image = self.images.get()
        self.images.task_done()
        if isinstance(image, Exception):
            raise image
        return image is not None, image

    def release(self) -> None:
        self.released = True


def acted_on(stick: Stick, holds: Callable[[], bool]) -> None:
    """Wait for the thread to take everything out of the queue, and to act on it."""
    stick.images.join()
    until(holds, "the grabber")


@pytest.mark.parametrize("end", [None, RuntimeError("unplugged")])
def test_a_lost_device_is_told_and_opened_again(end: Exception | None) -> None:
    sticks = [Stick(), Stick()]
    first, second = sticks
    grabber = Grabber(iter(sticks).__next__, again=0.0)
    first.images.put("a")
    first.images.put(end)
    acted_on(first, lambda: grabber.error is not None)
    assert grabber.error == "the camera was lost"
    assert [one.image for one in grabber.taken()] == ["a"]
    second.images.put("b")
    acted_on(second, lambda: grabber.error is None)
    assert first.released
    assert [one.image for one in grabber.taken()] == ["b"]
    grabber._stop.set()
    second.images.put("c")
    grabber.close()
    assert second.released


class Ages:
    """A grabber that gives what the test says."""

    def __init__(self, found: Iterator[list[Captured]]) -> None:
        self.error: str | None = None
        self._found = found

    def taken(self) -> list[Captured]:
        return next(self._found)

    def close(self) -> None: ...


def test_a_frame_of_a_device_was_taken_before_it_arrived() -> None:
    image = numpy.zeros((HEIGHT, WIDTH), numpy.uint8)
    grabber: Any = Ages(iter([[Captured(image, 5_000_000)], [], []]))
    device = Device(grabber, DOWN, latency=30_000_000)
    (frame,) = device.read(NS)
    assert frame.time == NS - 35_000_000
    assert device.read(NS + TICK) == []
    with pytest.raises(DriverError, match=r"no frame for 1\.1 s"):
        device.read(2 * NS + 100_000_000)


def test_what_is_wrong_with_a_device_is_told() -> None:
    grabber: Any = Ages(iter([[]]))
    grabber.error = "the camera was lost"
    with pytest.raises(DriverError, match="the camera was lost"):
        Device(grabber, DOWN, latency=0).read(0)
