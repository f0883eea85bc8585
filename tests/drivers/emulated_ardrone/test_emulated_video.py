"""The video of an emulated drone over its socket, decoded by the camera of real ones: a tag is seen
in it."""

from __future__ import annotations

import random

import pytest

pytest.importorskip("av", reason="PyAV is not installed")
pytest.importorskip("cv2")

import cv2
from part_bench import SITE
from served_drones import served
from waiting import until

from kybflow.sensors.ardrone_camera import ArdroneCamera, ArdroneCameraParams
from kybflow.world.cameras import Camera, Lens

pytestmark = pytest.mark.thorough
MISSION = """kybflow: 1
mission: watched
import: {std: kybflow/airframes}
world:
  tags:
    sign: {tag: {family: 36h11, id: 7, size: 20 cm, at: [1, 0, 0.1], facing: west}}
vehicles:
  a:
    like: std.ardrone
    start: {at: [0, 0, 0]}
    behaviors:
      up: {do: take_off, height: 1 m, then: down}
      down: {do: land}
"""
CAMERA = Camera("front", Lens(640, 360, 355.0, 355.0, 319.5, 179.5), (0.0, 0.0, 0.0))


def test_a_tag_in_front_of_the_drone_is_seen_in_its_video(tmp_path):
    path = tmp_path / "watched.yaml"
    path.write_text(MISSION, encoding="utf-8")
    detector = cv2.aruco.ArucoDetector(
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    )
    with served("--mission", str(path), "--video") as drones:
        context = SITE._replace(cameras={"front": CAMERA})
        params = ArdroneCameraParams(host=drones.host)
        stream, frames = ArdroneCamera.open(params, context, None, random.Random(0)), []
        try:
            until(lambda: frames.extend(stream.read(10**9)) or len(frames) >= 5, "frames")
        finally:
            stream.close()
    for frame in frames:
        _, found, _ = detector.detectMarkers(frame.image)
        assert found is not None
        assert found.ravel().tolist() == [7]
