"""What a flight explains of a body's poses, and when a body has jumped."""

from __future__ import annotations

from math import pi

import pytest

from kybflow.core.geometry import LEVEL, Quat, Vec3, from_heading
from kybflow.core.signals import NS, Pose
from kybflow.flight.pose_gate import CONFIRMED, PoseTrack, unexplained

EVERY = NS // 100


def pose(i: int, position: Vec3 = (0.0, 0.0, 1.0), attitude: Quat = LEVEL) -> Pose:
    return Pose(i * EVERY, position, attitude)


def test_what_a_vehicle_can_fly_is_explained_and_what_it_can_not_is_not() -> None:
    last = pose(0)
    assert unexplained(last, pose(10, (0.54, 0.0, 1.0))) is None
    found = unexplained(last, pose(10, (0.6, 0.0, 1.0)))
    assert found == (pytest.approx(0.6), pytest.approx(0.15 + 4.0 * 0.1))


def test_it_may_be_anywhere_within_reach_after_a_long_gap() -> None:
    assert unexplained(pose(0), pose(1000, (30.0, 0.0, 1.0), from_heading(pi))) is None


def test_a_turn_at_a_stroke_is_told_in_radians() -> None:
    found = unexplained(pose(0), pose(1, attitude=from_heading(2.0)))
    assert found == (pytest.approx(2.0), pytest.approx(0.8 + 12.0 * 0.01))


def test_a_single_pose_elsewhere_leaves_the_track_where_it_was() -> None:
    track = PoseTrack()
    assert [track.follow(pose(i)) for i in range(3)] == [None] * 3
    assert track.follow(pose(3, (2.0, 0.0, 1.0))) is None
    assert track.follow(pose(4)) is None
    assert (track.first, track.last) == (pose(0), pose(4))


def test_poses_that_go_on_elsewhere_begin_it_anew_at_the_first_of_them() -> None:
    track = PoseTrack()
    track.follow(pose(0))
    there = [pose(1 + i, (2.0, 0.0, 1.0)) for i in range(CONFIRMED)]
    assert [track.follow(p) for p in there] == [None, None, there[0]]
    assert (track.first, track.last) == (there[0], there[-1])


def test_poses_that_lie_about_are_no_jump() -> None:
    track = PoseTrack()
    track.follow(pose(0))
    for i in range(1, 20):
        assert track.follow(pose(i, (2.0 * (1 + i % 3), 0.0, 1.0))) is None
    assert track.last == pose(0)
