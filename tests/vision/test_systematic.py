"""How a pose errs with what is wrong with lens, mount, map and stamps, against poses that do."""

from __future__ import annotations

from dataclasses import fields, replace
from math import hypot

import pytest

pytest.importorskip("cv2")

import numpy

from kybflow.core.geometry import Quat, Vec3, conjugate, from_euler, multiply, sub
from kybflow.flight.fusion.covariance import WANDERERS
from kybflow.vision.locating.locate import AT_REST, BodyMotion, Located, TagView, locate
from kybflow.vision.locating.systematic import systematic
from kybflow.vision.projection import project
from kybflow.vision.rendering.miscalibrated import Setup, miscalibrated
from kybflow.world.cameras import CalibrationErrors, Camera, Lens
from kybflow.world.tags import Tag, TagMap

ALL = CalibrationErrors()
NONE = replace(ALL, **dict.fromkeys((field.name for field in fields(ALL)), 0.0))
LENS = Lens(640, 480, 457.0, 457.0, 319.5, 239.5)
DOWN = Camera("down", LENS, (0.11, 0.0, 0.15))
REAR = DOWN._replace(name="rear", position=(-0.15, 0.02, 0.1))
FLOOR = TagMap(
    Tag("36h11", 12 * i + j, 0.195, (0.2077 * (i - 4), 0.2077 * (j - 5), 0.0), (1.0, 0.0, 0.0, 0.0))
    for i in range(9)
    for j in range(12)
)
AT: Vec3 = (0.1, -0.05, 1.2)
TURN: Quat = from_euler(0.08, -0.05, 0.7)


def seen(there: Setup, cameras: tuple[Camera, ...] = (DOWN,)) -> Located:
    """The pose of a body at AT from what it truly sees, by what is believed."""
    views = []
    for camera, true in zip(cameras, there.cameras, strict=True):
        tags = list(there.tags)
        pixels, before = project(true, AT, TURN, numpy.array([tag.corners() for tag in tags]))
        inside = before & (pixels > 0.0).all(axis=2) & (pixels < (639.0, 479.0)).all(axis=2)
        whole = numpy.flatnonzero(inside.all(axis=1))
        believed = [FLOOR.get(tags[i].family, tags[i].id) for i in whole]
        views.append(TagView(camera, [tag for tag in believed if tag], pixels[whole]))
    located = locate(views, (AT, TURN), AT_REST, ALL.survey_error)
    assert located is not None
    return located


def off(located: Located) -> list[float]:
    """By how much a pose is off: position in the world, rotation in the body."""
    _, *turned = multiply(conjugate(TURN), located.attitude)
    return [*sub(located.position, AT), *(2.0 * part for part in turned)]


@pytest.mark.parametrize(
    "kinds",
    [
        ("focal_error",),
        *(
            pytest.param(kinds, marks=pytest.mark.thorough)
            for kinds in (("mount_misalignment",), ("survey_error", "height_error", "survey_turn"))
        ),
        *(
            pytest.param(kinds, marks=pytest.mark.slow)
            for kinds in (("k1_error",), ("mount_error",))
        ),
    ],
)
def test_poses_err_as_the_slopes_say(kinds: tuple[str, ...]) -> None:
    errors = replace(NONE, **{kind: 0.2 * getattr(ALL, kind) for kind in kinds})
    believed = Setup(FLOOR, (DOWN,), 0.0)
    errs = numpy.array([off(seen(miscalibrated(believed, errors, s))) for s in range(120)])
    slopes = systematic(seen(believed), ["down"], AT_REST, errors).slopes
    expected = slopes @ slopes.T
    found = errs.T @ errs / len(errs)
    most = numpy.sqrt(numpy.outer(expected.diagonal(), expected.diagonal()))
    assert found == pytest.approx(expected, abs=0.45 * float(most.max()))
    squares = numpy.einsum("ki,ij,kj->k", errs, numpy.linalg.pinv(expected, 1e-6), errs)
    rank = numpy.linalg.matrix_rank(expected, tol=1e-6 * float(most.max()))
    assert squares.mean() == pytest.approx(rank, rel=0.5)


def test_stamps_that_are_late_tell_where_the_body_was() -> None:
    motion = BodyMotion((0.6, 0.0, -0.2), (0.0, 0.5, 0.0))
    slopes = systematic(seen(Setup(FLOOR, (DOWN,), 0.0)), ["down"], motion, ALL).slopes
    assert slopes[:, -1] == pytest.approx(numpy.array((-0.6, 0.0, 0.2, 0.0, -0.5, 0.0)) * 0.003)


def test_two_cameras_share_what_their_mounts_do_to_a_pose() -> None:
    both = seen(Setup(FLOOR, (DOWN, REAR), 0.0), (DOWN, REAR))
    slopes = systematic(both, ["down", "rear"], AT_REST, ALL).slopes
    assert slopes.shape == (6, WANDERERS + 17)
    mounts = slopes[:, WANDERERS + 2 : WANDERERS + 8], slopes[:, WANDERERS + 10 : WANDERERS + 16]
    turned = sum(part[3:, 3:] for part in mounts)
    assert turned == pytest.approx(ALL.mount_misalignment * numpy.eye(3), abs=1e-3)
    assert all(hypot(*part[:3, :3].ravel()) > 1e-3 for part in mounts)


def test_only_the_tags_that_hold_the_pose_count() -> None:
    whole = seen(Setup(FLOOR, (DOWN,), 0.0))
    few = whole._replace(used=whole.used[:6])
    wide, narrow = (systematic(pose, ["down"], AT_REST, ALL) for pose in (whole, few))
    spread = [float((part.slopes[:3, :WANDERERS] ** 2).sum()) for part in (wide, narrow)]
    assert spread[1] > 2.0 * spread[0]
    assert narrow.extent < wide.extent
