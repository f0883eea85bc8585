"""follow_trajectory: waits at the first point, then flies the file in its own time."""

import math

import pytest
from part_bench import DT, entry, estimate, fly, hardest, ideal, worst_mismatch

from kybflow.core.errors import Refused
from kybflow.core.files import File
from kybflow.core.geometry import ZERO, distance
from kybflow.core.signals import Done, Failed
from kybflow.runtime.behaviors.follow_trajectory import FollowTrajectory, FollowTrajectoryParams

FIRST = (0.2, 0.0, 1.0)
TEXT = """t, x, y, z, yaw [deg]
3, 0.2, 0.0, 1.0, 90
5, 0.8, 0.2, 1.0, 90
7, 0.8, 0.9, 1.3, 180
9, 0.2, 0.9, 1.0, 180
"""
FILE = File("way.csv", "a", TEXT)


def params(**more) -> FollowTrajectoryParams:
    return FollowTrajectoryParams(file=FILE, **more)


def test_at_its_first_point_it_waits_for_rest_and_then_keeps_the_time_of_the_file() -> None:
    flown = fly(FollowTrajectory(params(), entry(FIRST)), ideal(FIRST))
    assert isinstance(flown.end, Done)
    begun = flown.duration - 6.0
    assert begun == pytest.approx(math.pi / 2 + 15.0 / 8.0 + 0.3, abs=0.02)
    middle = flown.samples[round((begun + 4.0) / DT)].setpoint
    assert middle.position == pytest.approx((0.8, 0.9, 1.3), abs=1e-6)
    assert flown.end.setpoint.position == (0.2, 0.9, 1.0)
    assert abs(flown.end.setpoint.heading) == pytest.approx(math.pi)


def test_from_within_the_gate_it_flies_to_its_first_point() -> None:
    start = (0.0, 0.3, 1.0)
    flown = fly(FollowTrajectory(params(), entry(start)), ideal(start))
    assert flown.samples[0].setpoint.position == start
    assert isinstance(flown.end, Done)
    assert worst_mismatch(flown.samples, "position", "velocity") < 1e-3
    assert worst_mismatch(flown.samples, "velocity", "acceleration") < 2e-2
    assert hardest(flown.samples) < 2.0


def test_entered_in_motion_it_has_no_step() -> None:
    start = (0.1, 0.0, 1.0)
    flown = fly(FollowTrajectory(params(), entry(start, (0.0, 0.3, 0.0))), ideal(start))
    assert flown.samples[0].setpoint.velocity == pytest.approx((0.0, 0.3, 0.0))
    assert worst_mismatch(flown.samples, "position", "velocity") < 1e-3


def test_from_beyond_the_gate_it_refuses() -> None:
    with pytest.raises(Refused, match=r"0\.80 m from the first point of `way\.csv`, 0\.5 m"):
        FollowTrajectory(params(), entry((1.0, 0.0, 1.0)))
    FollowTrajectory(params(gate=1.0), entry((1.0, 0.0, 1.0)))


def test_the_clock_waits_for_a_vehicle_that_is_not_there_or_does_not_rest() -> None:
    for known in (estimate((0.3, 0.0, 1.0)), estimate(FIRST, (0.2, 0.0, 0.0))):
        behavior = FollowTrajectory(params(patience=2.0), entry(FIRST))
        flown = fly(behavior, lambda _, k=known: (k.position, k.velocity))
        assert isinstance(flown.end, Failed)
        assert "not at rest at the first point" in flown.end.reason
        assert {s.setpoint.position for s in flown.samples} == {FIRST}


def test_without_a_yaw_the_heading_is_kept() -> None:
    file = File("plain.csv", "b", "t,x,y,z\n0,0.2,0,1\n4,0.8,0,1\n")
    behavior = FollowTrajectory(FollowTrajectoryParams(file=file), entry(FIRST))
    flown = fly(behavior, ideal(FIRST))
    assert {s.setpoint.heading for s in flown.samples} == {0.0}


def test_its_footprint_is_its_path_and_names_the_lines() -> None:
    footprint = FollowTrajectory.footprint(params(), (0.0, 0.0, 1.0))
    flown = fly(FollowTrajectory(params(), entry((0.0, 0.0, 1.0))), ideal(ZERO)).samples
    for axis in range(3):
        bounds = [p[axis] for p in footprint.points]
        flown_axis = [s.setpoint.position[axis] for s in flown[1:]]
        assert min(bounds) - 0.01 <= min(flown_axis)
        assert max(flown_axis) <= max(bounds) + 0.01
    assert footprint.exit == (0.2, 0.9, 1.0)
    assert footprint.path[0] == (0.0, 0.0, 1.0)
    assert distance(footprint.path[1], FIRST) == 0.0
    assert footprint.origin.fastest == "way.csv:4"
    assert footprint.line_of((0.8, 0.9, 1.3)) == ("led there by way.csv:4",)
    assert FollowTrajectory.refusal(params(), (0.0, 0.0, 1.0)) is None
