"""A walk over the tags tells what is wrong with lens, mount and map, and how sure that is."""

from __future__ import annotations

from dataclasses import replace

import numpy
import pytest

pytest.importorskip("cv2")

from tag_floors import room, still, truth_at
from walks import (
    CAMERA,
    Scene,
    aligned,
    bodies,
    lens_errors,
    mount_errors,
    pose_at,
    scene,
    track,
    walk,
)

from kybflow.cli.printing.calibration import calibration_lines
from kybflow.core.errors import CalibrationFailed
from kybflow.vision.calibration.adjust import BELIEVED, adjust
from kybflow.vision.calibration.model import LENS, MOUNT, TAGS, KnownPoses, blocks, mounting
from kybflow.vision.calibration.track import rough_offset
from kybflow.vision.calibration.walk import Standing, WalkCalibration, WalkFrame, calibrated
from kybflow.world.tags import TagMap


def found_in(made: Scene, count: int, seed: int, known: bool = True) -> WalkCalibration:
    seen = walk(made, count, seed, known=known)
    return WalkCalibration(seen, adjust(seen, numpy.zeros(seen.size)))


def standing_frames(made: Scene, count: int, **optics: float) -> list[WalkFrame]:
    lit = room(made.tags, **optics)
    return [WalkFrame(0.5 * i, lit.draw(CAMERA, body)) for i, body in enumerate(bodies(count))]


def test_residuals_slope_as_the_jacobian_says() -> None:
    made = scene(3, 3)
    camera = made.believed._replace(row_time=3e-5)
    seen = replace(walk(made, 4, 3), camera=camera)
    generator = numpy.random.default_rng(3)
    position, mount = mounting(camera, numpy.zeros(TAGS))
    body = seen.turn @ mount.T
    at = seen.at - body @ position
    moved = 0.3 * generator.standard_normal((2, 4, 3))
    seen = replace(seen, reference=KnownPoses(numpy.arange(4), at, body, *moved))
    ones = dict.fromkeys(BELIEVED, 1.0)
    step = 1e-6 * generator.standard_normal(seen.size)
    x = numpy.zeros(seen.size)
    after, before = (list(blocks(seen, x + sign * step, ones)) for sign in (0.5, -0.5))
    for block, high, low in zip(blocks(seen, x, ones), after, before, strict=True):
        told = (block.slopes @ step[block.columns][:, :, None])[:, :, 0]
        assert numpy.allclose(told, high.values - low.values, rtol=1e-5, atol=1e-9), block.kind


@pytest.mark.thorough
def test_a_known_body_tells_lens_mount_and_map() -> None:
    made = scene(1, 4)
    found = found_in(made, 30, 1)
    assert abs(found.shifts - made.errors)[:, :3].max() < 0.002
    off = mount_errors(found)
    assert numpy.linalg.norm(off[:3]) < 0.002
    assert numpy.rad2deg(numpy.linalg.norm(off[3:])) < 0.1
    assert (abs(lens_errors(found)) < (0.001, 1.0, 1.0, 0.002)).all()
    assert found.adjusted.sigma["corners"] == pytest.approx(0.2, rel=0.05)


@pytest.mark.thorough
def test_frames_alone_tell_lens_and_map_but_no_mount() -> None:
    made = scene(2, 4)
    found = found_in(made, 30, 2, known=False)
    off = found.shifts[:, :3] - made.errors[:, :3]
    assert abs(aligned(off, made.tags)).max() < 0.002
    assert (abs(lens_errors(found)) < 3.0 * found.spreads[:LENS]).all()
    assert (found.spreads[:LENS] < (0.002, 1.0, 1.0, 0.001)).all()
    assert numpy.allclose(found.adjusted.x[LENS : LENS + MOUNT], 0.0, atol=1e-9)
    assert not found.is_determined(found.spreads[LENS], "mount position")
    lines = "\n".join(calibration_lines(found, 30, 30))
    assert "mount of `down`: not observable from frames alone; give the body's poses" in lines


@pytest.mark.thorough
@pytest.mark.parametrize("known", [True, False])
def test_spreads_are_honest(known: bool) -> None:
    shares: dict[str, list[numpy.ndarray]] = {"map": [], "lens": [], "mount": []}
    for seed in range(20):
        made = scene(seed, 4)
        found = found_in(made, 20, seed, known)
        spreads = found.spreads
        tags = spreads[TAGS : found.walk.frames].reshape(-1, 4)
        shares["map"].append((found.shifts - made.errors) / tags)
        shares["lens"].append(lens_errors(found) / spreads[:LENS])
        shares["mount"].append(mount_errors(found) / spreads[LENS : LENS + MOUNT])
    for what, values in shares.items():
        if known or what != "mount":
            assert 0.75 < numpy.sqrt(numpy.mean(numpy.square(values))) < 1.3, what


@pytest.mark.thorough
def test_wrong_tags_pull_nothing_and_are_told() -> None:
    """One lies elsewhere than surveyed, and one is taken for another once."""
    made = scene(4, 4)
    tag, off = made.survey[7], made.errors.copy()
    x, y, z = tag.position
    made.survey[7] = tag._replace(position=(x + 0.3, y - 0.2, z))
    off[7, :2] += (-0.3, 0.2)
    seen = walk(made, 20, 4)
    wrong = numpy.flatnonzero(seen.seen.frame == 3)[:4]
    seen.seen.tag[wrong] = (seen.seen.tag[wrong] + 6) % len(made.tags)
    found = WalkCalibration(seen, adjust(seen, numpy.zeros(seen.size)))
    left = numpy.flatnonzero(~found.adjusted.used["corners"])
    assert {*wrong} <= {*left}
    assert len(left) <= 8  # that tag itself is in the frame too
    assert numpy.flatnonzero(found.displaced).tolist() == [7]
    assert abs(found.shifts - off)[:, :3].max() < 0.002
    lines = list(calibration_lines(found, 20, 200))
    assert lines[2] == "left out: 1 sightings of tags that don't fit"
    (told,) = (line for line in lines if "lies elsewhere" in line)
    assert told.startswith("  36h11 7 ")


def test_clocks_are_brought_together() -> None:
    times = numpy.arange(0.0, 20.0, 0.5)
    positions = numpy.array([body.position for body in bodies(40)])
    assert rough_offset(track(20.0, 3.27), times, positions) == pytest.approx(3.27, abs=0.05)
    assert rough_offset(track(4.0, 0.0), times, positions) is None


@pytest.mark.thorough
@pytest.mark.parametrize("row_time", [0.0, 3e-5])
def test_a_drawn_walk_is_found_through_the_detector(row_time: float) -> None:
    camera = CAMERA._replace(row_time=row_time)
    made = scene(6, 6, camera)
    lit = room(made.tags, row_time=row_time)
    shown = [(t, truth_at(pose_at, t)) for t in numpy.arange(0.0, 30.0, 0.5).tolist()]
    frames = [WalkFrame(t, lit.draw(camera, body)) for t, body in shown]
    found = calibrated(frames, made.believed, TagMap(made.survey), track(30.0, 3.27))
    assert abs(found.shifts - made.errors)[:, :3].max() < 0.001
    off = mount_errors(found, camera)
    assert numpy.linalg.norm(off[:3]) < 0.001
    assert numpy.rad2deg(numpy.linalg.norm(off[3:])) < 0.05
    assert (abs(lens_errors(found, camera)) < (0.001, 0.5, 0.5, 0.001)).all()


@pytest.mark.thorough
def test_one_place_where_it_stands_tells_the_mount() -> None:
    made = scene(7, 6)
    frames = standing_frames(made, 30)
    x, y, _ = bodies(1)[0].position
    level = still((x, y, 0.7))
    frames[0] = WalkFrame(0.0, room(made.tags).draw(CAMERA, level))
    known = Standing(level.position, 0.0)
    found = calibrated(frames, made.believed, TagMap(made.survey), known)
    shares = mount_errors(found) / found.spreads[LENS : LENS + MOUNT]
    assert abs(shares).max() < 3.0
    assert found.is_determined(found.spreads[LENS], "mount position")


def test_frames_without_tags_say_so() -> None:
    dark = [WalkFrame(0.5 * i, numpy.zeros((480, 640), numpy.uint8)) for i in range(6)]
    with pytest.raises(CalibrationFailed, match="no tag of the map is found in 6 frames"):
        calibrated(dark, CAMERA, TagMap(scene(0, 2).survey))


def test_a_lone_tag_is_no_map() -> None:
    made = scene(0, 1)
    with pytest.raises(CalibrationFailed, match="only one tag is found, 0 of 36h11"):
        calibrated(standing_frames(made, 4), CAMERA, TagMap(made.survey))


def test_too_few_frames_are_refused() -> None:
    made = scene(0, 3)
    with pytest.raises(CalibrationFailed, match="frames show two tags or more; 5 are needed"):
        calibrated(standing_frames(made, 3), CAMERA, TagMap(made.survey))
