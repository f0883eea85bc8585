"""Pictures of camera frames in the run folder: which are kept, and what becomes of them."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

numpy = pytest.importorskip("numpy")
pytest.importorskip("cv2")


from recorded_run import STARTED, make_plan  # noqa: E402
from tag_floors import CAMERA, grid  # noqa: E402

from kybflow.core.geometry import LEVEL, ZERO  # noqa: E402
from kybflow.core.signals import NS, Frame  # noqa: E402
from kybflow.recording.pictures import CHANGE_PICTURES, EVEN_PICTURES, Pictures  # noqa: E402
from kybflow.recording.run_folder import RunFolderError, create_run_folder  # noqa: E402
from kybflow.report.data import read_pictures  # noqa: E402
from kybflow.vision.locating.locate import Located, TagView  # noqa: E402
from kybflow.vision.locating.locator import Sighting  # noqa: E402

IMAGE = numpy.full((48, 64), 100, numpy.uint8)


def sighting(t, camera="down", located=None):
    return Sighting([Frame(round(t * NS), camera, IMAGE)], located)


class Looked:
    """A flight as the observer sees it: one vehicle with one estimator that sees tags."""

    def __init__(self, path):
        self.folder = create_run_folder(make_plan("mk"), path, STARTED)
        self.seer = SimpleNamespace(sighting=None)
        parts = {"tag_camera": self.seer, "mocap": SimpleNamespace(sighting=None)}
        self.vehicle = SimpleNamespace(
            name="mk", estimator="tag_camera", knowledge=SimpleNamespace(parts=lambda: parts)
        )
        self.engine = SimpleNamespace(flying=True, vehicles=[self.vehicle])
        self.observe = Pictures(self.folder)

    def at(self, t, **more):
        self.seer.sighting = sighting(t, **more)
        self.observe(self.engine)

    def kept(self):
        return [picture.time for picture in read_pictures(self.folder.path)]


@pytest.fixture
def looked(tmp_path):
    looked = Looked(tmp_path / "run")
    yield looked
    looked.folder.close()


def test_before_take_off_and_without_a_frame_there_is_none(looked):
    looked.observe(looked.engine)
    looked.engine.flying = False
    looked.at(1.0)
    assert looked.kept() == []
    assert not (looked.folder.path / "frames").exists()


@pytest.mark.parametrize("seconds", [5, 30, 400])
def test_however_long_the_flight_the_pictures_are_few_and_even(looked, seconds):
    for n in range(4 * seconds):
        looked.at(n / 4)
    kept = looked.kept()
    gaps = numpy.diff(kept)
    assert kept[0] == 0.0
    assert EVEN_PICTURES / 2 <= len(kept) <= EVEN_PICTURES
    assert set(gaps) == {gaps[0]}
    assert kept[-1] + gaps[0] >= seconds - 0.25


def test_one_frame_that_is_seen_again_is_one_picture(looked):
    for _ in range(5):
        looked.at(3.0)
    assert looked.kept() == [3.0]


def test_the_frame_of_a_change_stays_and_there_are_not_many_of_these(looked):
    changes = [2.25, 4.25, 6.25, 8.25, 10.25, 12.25]
    for n in range(4 * 100):
        if n / 4 in changes:
            looked.vehicle.estimator = "mocap" if looked.vehicle.estimator != "mocap" else None
        looked.at(n / 4)
    kept = looked.kept()
    assert [t for t in kept if t % 1.0] == changes[:CHANGE_PICTURES]
    assert len(kept) <= EVEN_PICTURES + CHANGE_PICTURES


def test_a_change_at_a_frame_that_is_kept_anyway_is_no_second_picture(looked):
    looked.at(0.0)
    looked.vehicle.estimator = "mocap"
    looked.at(1.0)
    for n in range(2, 40):
        looked.at(float(n))
    assert looked.kept().count(1.0) == 1  # an even one would have been thrown away by now


def test_a_picture_says_what_its_pose_rests_on(looked):
    tags = grid(3, 1)
    corners = numpy.full((3, 4, 2), 20.0)
    keys = tuple((tag.family, tag.id) for tag in tags[:2])
    front = TagView(CAMERA._replace(name="front"), (), corners[:0])
    views = [TagView(CAMERA, tags, corners), front]
    located = Located(ZERO, LEVEL, numpy.eye(6), keys, 0.1, views)
    looked.at(1.5, located=located)
    looked.at(3.0)
    looked.at(4.5, camera="front", located=located)

    found = read_pictures(looked.folder.path)

    assert [(p.vehicle, p.estimator, p.camera, p.time, p.used, p.rejected) for p in found] == [
        ("mk", "tag_camera", "down", 1.5, 2, 1),
        ("mk", "tag_camera", "down", 3.0, None, None),
        ("mk", "tag_camera", "front", 4.5, 0, 0),
    ]
    assert all(picture.data.startswith(b"\xff\xd8\xff") for picture in found)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_picture_that_cannot_be_written_is_told_and_no_half_of_it_stays(looked):
    place = looked.folder.path / "frames/mk/tag_camera/down"
    place.mkdir(parents=True)
    (place / f".0001.000s-no-pose.jpg.{os.getpid()}").symlink_to("/dev/full")
    said = r"0001\.000s-no-pose\.jpg` can't be written: No space"
    with pytest.raises(RunFolderError, match=said):
        looked.at(1.0)
    assert not list(place.iterdir())
