"""Video is decoded and comes as frames of the airframe's camera; a recorded flight of a real drone
too."""

from __future__ import annotations

import random
import socket
import threading

import pytest

pytest.importorskip("av", reason="PyAV is not installed")
pytest.importorskip("cv2")

import cv2
import numpy
from ardrone_recordings import recording
from part_bench import SITE
from served_drones import free_host
from waiting import until

from kybflow.core.errors import DriverError
from kybflow.sensors.ardrone_camera import PORT, ArdroneCamera, ArdroneCameraParams
from kybflow.vision.tags import dictionary
from kybflow.vision.video.codec import FrameDecoder, FrameEncoder
from kybflow.vision.video.pave import FrameCutter, write_frame
from kybflow.world.cameras import Camera, Lens

CAMERA = Camera("front", Lens(640, 360, 560.0, 560.0, 319.5, 179.5), (0.0, 0.0, 0.0))
TAG = 7


def stream_of(images):
    encoder = FrameEncoder(640, 360, 30)
    frames = [f for n, image in enumerate(images) for f in encoder.encode(image, 33 * n)]
    return b"".join(map(write_frame, frames))


def pictures(count):
    """A tag that moves to the right over grey."""
    marker = cv2.aruco.generateImageMarker(dictionary("36h11"), TAG, 120)
    for number in range(count):
        image = numpy.full((360, 640), 200, numpy.uint8)
        image[100:220, 100 + 10 * number : 220 + 10 * number] = marker
        yield image


def test_the_recorded_video_of_a_real_drone_is_decoded():
    decoder = FrameDecoder()
    frames = FrameCutter().take(recording("pave.bin"))
    images = [image for frame in frames for image in decoder.decode(frame)]
    assert len(frames) == 20
    first = next(number for number, frame in enumerate(frames) if frame.is_key)
    assert len(images) == 20 - first == 17  # the recording begins within a group of pictures
    assert {image.shape for image in images} == {(360, 640)}
    assert all(image.std() > 5 for image in images)  # a picture, not one shade
    assert decoder.broken == 0


def test_nothing_is_decoded_before_a_key_frame_and_garbage_is_counted():
    decoder = FrameDecoder()
    first, second = FrameCutter().take(stream_of(list(pictures(2))))
    assert decoder.decode(second._replace(kind=3)) == []
    assert decoder.decode(first._replace(payload=b"\0\0\1garbage")) == []
    assert len(decoder.decode(first)) == 1
    assert decoder.decode(second._replace(codec=2)) == []


class Played:
    """A drone's video port: every client is sent the stream and then nothing."""

    def __init__(self, host, data):
        self._data, self._clients = data, []
        self._listener = socket.create_server((host, PORT))
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        try:
            while True:
                client, _ = self._listener.accept()
                self._clients.append(client)
                client.sendall(self._data)
        except OSError:
            return

    def hang_up(self):
        for client in self._clients:
            client.close()

    def close(self):
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self.hang_up()
        self._thread.join()


@pytest.fixture
def played():
    host = free_host()
    server = Played(host, stream_of(list(pictures(10))))
    yield host, server
    server.close()


def opened(host):
    context = SITE._replace(cameras={"front": CAMERA})
    params = ArdroneCameraParams(host=host)
    return ArdroneCamera.open(params, context, None, random.Random(0))


@pytest.mark.thorough
def test_a_tag_is_seen_in_what_arrives(played):
    host, _ = played
    stream, frames = opened(host), []
    try:
        until(lambda: frames.extend(stream.read(10**9)) or len(frames) > 3, "frames")
    finally:
        stream.close()
    detector = cv2.aruco.ArucoDetector(dictionary("36h11"))
    for frame in frames:
        assert (frame.camera, frame.image.shape) == ("front", (360, 640))
        _, found, _ = detector.detectMarkers(frame.image)
        assert found.ravel().tolist() == [TAG]


@pytest.mark.thorough
def test_a_stream_that_is_lost_is_told_and_opened_again(played):
    host, server = played
    stream, frames, told = opened(host), [], []

    def reading():
        try:
            frames.extend(stream.read(10**9))
        except DriverError as error:
            told.append(str(error))

    try:
        until(lambda: reading() or frames, "frames")
        server.hang_up()
        until(lambda: reading() or told, "the loss")
        frames.clear()
        until(lambda: reading() or frames, "frames again")
    finally:
        stream.close()
    assert told[0] == "the camera was lost"


def test_a_drone_that_is_not_there_is_told():
    with pytest.raises(DriverError, match="no video from the drone at 127"):
        opened(free_host())
