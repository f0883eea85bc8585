"""follow_path: every corner is reached and rested at, in order."""

import pytest
from part_bench import entry, fastest, fly, hardest, ideal, worst_mismatch

from kybflow.core.errors import Refused
from kybflow.core.geometry import ZERO, distance
from kybflow.core.signals import Done, Failed
from kybflow.runtime.behaviors.follow_path import FollowPath, FollowPathParams

START = (0.0, 0.0, 1.0)
PATH = ((1.0, 0.0, 1.0), (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), (0.0, 1.0, 1.5))


def test_it_rests_at_every_corner_and_ends_at_the_last() -> None:
    flown = fly(FollowPath(FollowPathParams(path=PATH), entry(START)), ideal(START))
    at_corners = [s.setpoint.position for s in flown.samples if s.setpoint.velocity == ZERO]
    visited = list(dict.fromkeys(at_corners))
    assert visited == [START, PATH[0], PATH[1], PATH[3]]
    assert isinstance(flown.end, Done)
    assert flown.end.setpoint.position == PATH[-1]


def test_it_keeps_its_limits_and_has_no_step() -> None:
    params = FollowPathParams(path=PATH, speed=0.6, acceleration=0.5)
    flown = fly(FollowPath(params, entry(START, (0.0, 0.3, 0.0))), ideal(START))
    assert fastest(flown.samples) <= 0.6 + 1e-9
    assert hardest(flown.samples) <= 0.5 + 1.5
    assert worst_mismatch(flown.samples, "position", "velocity") < 1e-3
    assert worst_mismatch(flown.samples, "velocity", "acceleration") < 3e-2


def test_it_does_not_leave_a_corner_that_the_vehicle_has_not_reached() -> None:
    params = FollowPathParams(path=PATH, tolerance=0.05, patience=2.0)
    flown = fly(FollowPath(params, entry(START)), lambda setpoint: ((0.9, 0.0, 1.0), ZERO))
    assert flown.end == Failed(flown.end.setpoint, "still 0.100 m from corner 1")
    assert max(distance(s.setpoint.position, START) for s in flown.samples) <= 1.0


def test_an_empty_path_is_refused() -> None:
    with pytest.raises(Refused, match="no corner"):
        FollowPath(FollowPathParams(path=()), entry(START))


def test_it_turns_on_the_first_leg_and_keeps_the_heading_on_the_others() -> None:
    params = FollowPathParams(path=PATH, heading=-1.0, turn_rate=0.2)
    flown = fly(FollowPath(params, entry(START)), ideal(START))
    headings = [s.setpoint.heading for s in flown.samples]
    turned = next(s.time for s in flown.samples if s.setpoint.heading == -1.0)
    left = next(s.time for s in flown.samples if s.setpoint.position[1] > 0.0)
    assert headings == sorted(headings, reverse=True)
    assert 5.0 < turned < left
    assert worst_mismatch(flown.samples, "position", "velocity") < 1e-3


def test_a_corner_at_which_it_looks_elsewhere_is_not_reached() -> None:
    params = FollowPathParams(path=PATH, heading=0.5, heading_tolerance=0.1, patience=1.0)
    flown = fly(FollowPath(params, entry(START)), ideal(START))  # its attitude stays level, east
    reason = "still 0.000 m from corner 1 and 28.6 deg from the heading"
    assert flown.end == Failed(flown.end.setpoint, reason)
