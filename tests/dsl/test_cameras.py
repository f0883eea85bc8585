"""Cameras of an airframe: where they look, what they see, and calibration files."""

from __future__ import annotations

from math import pi

import pytest
from toolchain import compiled

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.core.geometry import rotate
from kybflow.dsl.calibration_file import read_calibration
from kybflow.dsl.expanding.vehicles import FACING, pinhole
from kybflow.world.cameras import DOWN, Lens

MISSION = """\
kybflow: 1
mission: m
import: {std: kybflow/airframes}
world: {fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}}
vehicles:
  a:
    like: std.courier_quad
    airframe: {like: std.courier_quad, cameras: {down: CAMERA}}
    behaviors: {up: {do: take_off, height: 1 m, then: down}, down: {do: land}}
"""
ROS = """\
image_width: 640
image_height: 480
camera_name: down
camera_matrix:
  rows: 3
  cols: 3
  data: [457.5, 0.0, 320.5, 0.0, 458.5, 239.5, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.2, 0.05, 0.001, -0.002, 0.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [457.5, 0, 320.5, 0, 0, 458.5, 239.5, 0, 0, 0, 1, 0]
"""
LENS = Lens(640, 480, 457.5, 458.5, 320.5, 239.5, (-0.2, 0.05, 0.001, -0.002, 0.0))
OPENCV = """\
%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 4.575e+02, 0., 320.5, 0., 4.585e+02, 239.5, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.2, 0.05, 0.001, -0.002, 0. ]
"""


@pytest.mark.parametrize(
    ("facing", "out", "right"),
    [
        ("down", (0, 0, -1), (0, -1, 0)),
        ("up", (0, 0, 1), (0, 1, 0)),
        ("forward", (1, 0, 0), (0, -1, 0)),
        ("backward", (-1, 0, 0), (0, 1, 0)),
        ("left", (0, 1, 0), (1, 0, 0)),
        ("right", (0, -1, 0), (-1, 0, 0)),
    ],
)
def test_where_it_looks_and_what_is_to_its_right(facing: str, out: object, right: object) -> None:
    assert rotate(FACING[facing], (0.0, 0.0, 1.0)) == pytest.approx(out, abs=1e-12)
    assert rotate(FACING[facing], (1.0, 0.0, 0.0)) == pytest.approx(right, abs=1e-12)


def test_down_has_the_upper_edge_forward() -> None:
    assert FACING["down"] is DOWN
    assert rotate(DOWN, (0.0, -1.0, 0.0)) == pytest.approx((1, 0, 0), abs=1e-12)


def test_the_field_of_view_is_from_edge_to_edge() -> None:
    lens = pinhole(640, 480, pi / 2)
    assert (lens.fx, lens.cx, lens.cy) == pytest.approx((320.0, 319.5, 239.5))
    assert (-0.5 - lens.cx) / lens.fx == pytest.approx(-1.0), "the left edge, 45 degrees off"


def camera(tmp_path, text: str):
    plan = compiled(tmp_path / "m.yaml", MISSION.replace("CAMERA", text))
    return plan.vehicles[0].cameras["down"]


def test_a_trim_turns_it_about_the_bodys_axes(tmp_path) -> None:
    turned = camera(tmp_path, "{pitch: -30 deg, rate: 20 Hz}")
    assert rotate(turned.attitude, (0.0, 0.0, 1.0)) == pytest.approx((0.5, 0.0, -(3**0.5) / 2))
    assert (turned.name, turned.rate, turned.position) == ("down", 20.0, (0.11, 0.0, 0.15))


def test_the_time_of_a_row_is_the_cameras(tmp_path) -> None:
    assert camera(tmp_path, "{rate: 20 Hz}").row_time == pytest.approx(3e-5), "of the library"
    assert camera(tmp_path, "{row_time: 0.05 ms}").row_time == pytest.approx(5e-5)


def test_a_calibration_replaces_what_like_brings(tmp_path) -> None:
    (tmp_path / "cam.yaml").write_text(ROS)
    assert camera(tmp_path, "{calibration: cam.yaml}").lens == LENS
    none = "width: null, height: null, field_of_view: null"
    assert camera(tmp_path, f"{{calibration: cam.yaml, {none}}}").lens == LENS


NESTED = """\
airframes:
  known: {like: std.courier_quad, cameras: {down: {calibration: cam.yaml}}}
  wide: {like: known, cameras: {down: {field_of_view: 90 deg}}}
  again: {like: wide, cameras: {down: {calibration: cam.yaml}}}
  faster: {like: again, cameras: {down: {rate: 60 Hz}}}
"""


@pytest.mark.parametrize(
    ("name", "lens"),
    [("known", LENS), ("wide", pinhole(640, 480, pi / 2)), ("again", LENS), ("faster", LENS)],
)
def test_the_lens_that_is_nearer_counts(name: str, lens: Lens, tmp_path) -> None:
    (tmp_path / "cam.yaml").write_text(ROS)
    airframe = "airframe: {like: std.courier_quad, cameras: {down: CAMERA}}"
    plan = compiled(tmp_path / "m.yaml", NESTED + MISSION.replace(airframe, f"airframe: {name}"))
    assert plan.vehicles[0].cameras["down"].lens == lens


@pytest.mark.parametrize("text", [ROS, OPENCV])
def test_a_calibration_of_ros_or_opencv(text: str) -> None:
    assert read_calibration(File("cam.yaml", "", text)) == LENS


@pytest.mark.parametrize(
    ("before", "after", "line", "message"),
    [
        (ROS, "", 1, "`cam.yaml` is empty"),
        (ROS, "- 1\n", 0, "a calibration is a mapping, but this is a list"),
        (ROS, "a: [1\n", 1, "this `[` is never closed"),
        ("image_width: 640\n", "", 0, "`image_width` is missing"),
        ("640", "6.4e2x", 1, "`6.4e2x` in `image_width` is not a number"),
        ("640", "-1", 1, "`image_width` must be a number of pixels"),
        ("  data: [457.5, 0.0, 320.5", "  data: [457.5, 320.5", 7, None),
        ("457.5, 0.0, 320.5", "-457.5, 0.0, 320.5", 7, None),
        ("457.5, 0.0, 320.5", "457.5, 0.1, 320.5", 7, None),
        ("320.5, 0.0, 458.5", "920.5, 0.0, 458.5", 7, None),
        ("320.5, 0.0, 458.5", ".nan, 0.0, 458.5", 7, "`.nan` in `camera_matrix` is not a number"),
        ("plumb_bob", "equidistant", 8, "the distortion model `equidistant` is not known"),
        ("-0.002, 0.0]", "-0.002, 0.0, 0.1]", 12, "6 coefficients of distortion; 5 are known"),
    ],
)
def test_what_is_wrong_with_a_calibration(before, after, line, message) -> None:
    text = ROS.replace(before, after, 1)
    with pytest.raises(FileError) as caught:
        read_calibration(File("cam.yaml", "", text))
    assert message is None or str(caught.value) == message
    assert caught.value.line == line


def test_a_hostile_calibration_is_an_error_and_nothing_else() -> None:
    for text in ("[" * 5000, "a: &a [*a]", "a: *b", "image_width: " + "9" * 5000, "\x00"):
        with pytest.raises(FileError):
            read_calibration(File("cam.yaml", "", text))
