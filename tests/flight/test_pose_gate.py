"""Which poses the gate lets through, and when it opens for those that it refused."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import pytest

from kybflow.core.geometry import LEVEL, ZERO, Quat, Vec3, from_heading, scale
from kybflow.core.signals import NS, Estimate, Pose
from kybflow.flight.pose_gate import (
    AGREEING_POSES,
    Bounds,
    PoseGate,
    PoseTrack,
    Reference,
    unexplained,
)

RATE = 100
BOUNDS = Bounds(gate=0.1, widest=0.5, settled=20.0)
STARTED = 1.0
"""Until then the poses are where the vehicle is."""
Where = Callable[[float], Vec3 | None]
"""Where poses show the vehicle at a time; None where none comes."""


def offset(by: Vec3, begin: float, end: float = 1e9) -> Where:
    return lambda t: by if begin <= t < end else ZERO


def unseen(where: Where, begin: float, end: float) -> Where:
    return lambda t: None if begin <= t < end else where(t)


class Watched:
    """A gate whose vehicle stands at zero, flown by dead reckoning that is `drift` m/s wrong from
    `STARTED` on, or by nothing else where that is None. opened: when, at what velocity. taken:
    the times of the poses that passed."""

    def __init__(self, drift: Vec3 | None = None) -> None:
        self.gate, self._drift = PoseGate(), drift
        self.opened: list[tuple[float, Vec3]] = []
        self.taken: list[float] = []
        self.refused: list[tuple[float, str]] = []

    def fly(self, where: Where, until: float, attitude: Quat = LEVEL) -> Watched:
        for i in range(round(until * RATE)):
            t = i / RATE
            place = where(t)
            if self._drift is not None and t > STARTED:
                away = scale(self._drift, t - STARTED)
                self.gate.flown = Estimate(
                    round(t * NS), away, self._drift, LEVEL, ZERO, "inertial", 0.0, 0.02
                )
            if place is not None:
                turned = attitude if place != ZERO else LEVEL
                self._see(Pose(round(t * NS), place, turned))
        return self

    def _see(self, pose: Pose) -> None:
        gate, t = self.gate, pose.time / NS
        last = round(self.taken[-1] * NS) if self.taken else pose.time
        own = Reference(last, ZERO, LEVEL, 0.001, 0.0)
        flown = gate.current(pose.time)
        reference = own
        if flown is not None:
            reference = Reference(pose.time, flown.position, LEVEL, flown.spread, 0.0)
        if gate.passes(pose, reference, BOUNDS):
            self.taken.append(t)
            gate.passed(pose.time)
            return
        velocity = gate.opened(pose, reference, own, BOUNDS)
        if velocity is not None:
            self.opened.append((t, velocity))
            self.taken.append(t)
        elif gate.refusal is not None and (not self.refused or self.refused[-1][1] == ""):
            self.refused.append((t, gate.refusal.reason))


def test_true_poses_are_believed_again_though_dead_reckoning_drifted() -> None:
    """It drifted 2.4 m off while nothing was seen."""
    watched = Watched((1.5, 0.0, 0.0)).fly(unseen(offset(ZERO, 0.0), 1.0, 2.6), 4.0)
    [(when, velocity)] = watched.opened
    assert when == pytest.approx(2.6 + 0.3, abs=0.011)
    assert velocity == pytest.approx(ZERO, abs=1e-9)
    assert [t for t in watched.taken if t > STARTED] == [i / RATE for i in range(290, 400)]


def test_what_is_refused_is_told_with_its_reason_and_it_ends_when_the_gate_opens() -> None:
    watched = Watched((1.5, 0.0, 0.0)).fly(unseen(offset(ZERO, 0.0), 1.0, 2.6), 2.8)
    [(when, reason)] = watched.refused
    assert when == pytest.approx(2.62)
    assert reason == "2.43 m from the estimate, 0.18 m allowed"
    watched.fly(unseen(offset(ZERO, 0.0), 1.0, 2.6), 3.0)
    assert watched.gate.refusal is None


@pytest.mark.parametrize("drift", [None, (0.0, 0.0, 0.0)])
def test_poses_that_jumped_where_no_flight_leads_stay_out(drift: Vec3 | None) -> None:
    watched = Watched(drift).fly(offset((1.0, 0.0, 0.0), 2.0), 15.0)
    assert watched.opened == []
    assert max(watched.taken) < 2.0


def test_nor_are_they_taken_after_a_gap() -> None:
    jumped = offset((1.0, 0.0, 0.0), 2.0)
    watched = Watched(ZERO).fly(unseen(jumped, 3.0, 4.0), 8.0)
    assert watched.opened == []


def test_where_they_jump_back_they_pass_at_once_or_agree_for_a_second_first() -> None:
    there_and_back = offset((0.0, 3.0, 0.0), STARTED, 4.0)
    known = Watched(ZERO).fly(there_and_back, 8.0)
    assert known.opened == []
    assert min(t for t in known.taken if t >= STARTED) == 4.0
    drifted = Watched((1.0, 0.0, 0.0)).fly(there_and_back, 8.0)
    [(when, _)] = drifted.opened
    assert when == pytest.approx(4.0 + 1.0, abs=0.011)


def test_poses_that_go_on_jumping_never_agree() -> None:
    def about(t: float) -> Vec3:
        return (3.0 + 2.0 * (int(t * 2) % 2), 0.0, 0.0) if t > STARTED else ZERO

    assert Watched((1.0, 0.0, 0.0)).fly(about, 15.0).opened == []


def test_a_single_reflection_begins_nothing() -> None:
    flashes = {200, 201, 350, 420}
    watched = Watched().fly(lambda t: (2.0, 0.0, 0.0) if round(t * RATE) in flashes else ZERO, 6.0)
    assert (watched.opened, watched.refused) == ([], [])
    assert len(watched.taken) == 600 - len(flashes)


def test_a_body_that_is_turned_at_a_stroke_stays_out() -> None:
    there = offset((0.01, 0.0, 0.0), 2.0)
    watched = Watched(ZERO).fly(there, 6.0, from_heading(3.0))
    assert watched.opened == []
    assert watched.refused[0][1] == "turned by more than 45 deg from the estimated attitude"


def test_they_settle_where_nothing_else_is_flown_on() -> None:
    watched = Watched().fly(offset((0.0, 3.0, 0.0), 2.0), 25.0)
    assert [t for t, _ in watched.opened] == pytest.approx([22.0], abs=0.011)


def moving(speed: float, begin: float) -> Where:
    return lambda t: (speed * max(t - STARTED, 0.0), 0.0, 0.0) if t < STARTED or t > begin else None


def test_it_opens_at_the_velocity_at_which_the_poses_moved() -> None:
    watched = Watched((0.0, 1.5, 0.0)).fly(moving(0.5, 2.5), 4.0)
    [(_, velocity)] = watched.opened
    assert velocity == pytest.approx((0.5, 0.0, 0.0), abs=1e-6)


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
    there = [pose(1 + i, (2.0, 0.0, 1.0)) for i in range(AGREEING_POSES)]
    assert [track.follow(p) for p in there] == [None, None, there[0]]
    assert (track.first, track.last) == (there[0], there[-1])


def test_poses_that_lie_about_are_no_jump() -> None:
    track = PoseTrack()
    track.follow(pose(0))
    for i in range(1, 20):
        assert track.follow(pose(i, (2.0 * (1 + i % 3), 0.0, 1.0))) is None
    assert track.last == pose(0)
