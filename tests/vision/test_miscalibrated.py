"""Cameras over a floor as they are in a lab: drawn from the seed, with the deviations declared."""

from __future__ import annotations

from dataclasses import fields, replace

import pytest

pytest.importorskip("cv2")

import numpy

from kybflow.core.geometry import LEVEL, heading_of
from kybflow.vision.projection import rotation
from kybflow.vision.rendering.miscalibrated import Setup, miscalibrated
from kybflow.world.cameras import CalibrationErrors, Camera, Lens
from kybflow.world.tags import Tag, TagMap

LAB = CalibrationErrors()
EXACT = replace(LAB, **dict.fromkeys((field.name for field in fields(LAB)), 0.0))
CAMERA = Camera("down", Lens(640, 480, 457.0, 457.0, 319.5, 239.5), (0.11, 0.0, 0.15))
FLOOR = TagMap(Tag("36h11", i, 0.2, (0.2 * i, 0.0, 0.0), LEVEL) for i in range(300))
BELIEVED = Setup(FLOOR, (CAMERA,), 0.0)


def test_the_same_seed_gives_the_same_lab_and_another_another() -> None:
    assert miscalibrated(BELIEVED, LAB, 3) == miscalibrated(BELIEVED, LAB, 3)
    first, second = miscalibrated(BELIEVED, LAB, 3), miscalibrated(BELIEVED, LAB, 4)
    assert first.cameras[0].lens.fx != second.cameras[0].lens.fx
    assert first.tags != second.tags
    assert first.stamps != second.stamps


def test_without_errors_everything_is_as_believed() -> None:
    there = miscalibrated(BELIEVED, EXACT, 3)
    assert there.tags == FLOOR
    assert there.stamps == 0.0
    assert there.cameras[0].lens == CAMERA.lens
    assert there.cameras[0].position == CAMERA.position
    turn = rotation(there.cameras[0].attitude)
    assert turn == pytest.approx(rotation(CAMERA.attitude))


def test_tags_lie_elsewhere_by_what_is_declared() -> None:
    laid = miscalibrated(BELIEVED, LAB, 5).tags
    moved = numpy.array(
        [numpy.subtract(a.position, b.position) for a, b in zip(laid, FLOOR, strict=True)]
    )
    assert moved.std(axis=0) == pytest.approx((0.005, 0.005, 0.002), rel=0.15)
    assert numpy.std([heading_of(tag.attitude) for tag in laid]) == pytest.approx(
        LAB.survey_turn, rel=0.15
    )


def test_a_small_tag_is_on_a_sheet_and_errs_less() -> None:
    small = TagMap(tag._replace(size=0.05) for tag in FLOOR)
    for tag, large in zip(
        miscalibrated(BELIEVED._replace(tags=small), LAB, 5).tags,
        miscalibrated(BELIEVED, LAB, 5).tags,
        strict=True,
    ):
        assert tag.position[2] == pytest.approx(0.25 * large.position[2])


@pytest.mark.thorough
def test_cameras_differ_by_what_is_declared() -> None:
    found = [miscalibrated(BELIEVED, LAB, seed) for seed in range(300)]
    cameras = [there.cameras[0] for there in found]
    share = [camera.lens.fx / CAMERA.lens.fx - 1.0 for camera in cameras]
    assert numpy.std(share) == pytest.approx(0.01, rel=0.15)
    assert numpy.std([camera.lens.distortion[0] for camera in cameras]) == pytest.approx(
        0.03, rel=0.15
    )
    off = [numpy.subtract(camera.position, CAMERA.position) for camera in cameras]
    assert numpy.std(off) == pytest.approx(0.003, rel=0.15)
    straight = rotation(CAMERA.attitude)
    turned = [rotation(camera.attitude) @ straight.T for camera in cameras]
    about_z = [turn[1, 0] for turn in turned]
    assert numpy.std(about_z) == pytest.approx(LAB.mount_misalignment, rel=0.15)
    assert numpy.std([there.stamps for there in found]) == pytest.approx(0.003, rel=0.15)
