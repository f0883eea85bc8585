"""Simulated motion capture: poses at their exact times, late, noisy, from a truth of any rate."""

from __future__ import annotations

import random
from collections.abc import Iterable
from statistics import fmean, stdev
from typing import Any

import pytest
from part_bench import SITE

from kybflow.core.geometry import LEVEL, ZERO, add, from_heading, heading_of, rotate
from kybflow.core.signals import NS, Pose, Truth
from kybflow.parts import ActiveFaults, Effect, Link
from kybflow.sensors.simulated_motion_capture import (
    SimulatedMotionCapture,
    SimulatedMotionCaptureParams,
)

TICK = NS // 250
SPEED, TURN = 0.5, 0.3
QUIET = SimulatedMotionCaptureParams(position_noise=0.0, attitude_noise=0.0)


class Passing(Link):
    """A vehicle that flies along x and turns; its truth is renewed every `step`, and known from
    `since` until `until`."""

    def __init__(self, step: int = TICK, since: int = 0, until: int = 1 << 60) -> None:
        self.now, self.step, self.since, self.until = 0, step, since, until
        self.faults = ActiveFaults("nano")

    def read(self, now: int) -> tuple[()]:
        return ()

    def send(self, command: Any, now: int) -> None: ...

    def truth(self) -> Truth | None:
        if not self.since <= self.now < self.until:
            return None
        t = (self.now // self.step * self.step) / NS
        return Truth((SPEED * t, 0.0, 1.0), (SPEED, 0.0, 0.0), from_heading(TURN * t),
                     (0.0, 0.0, TURN))  # fmt: skip


def poses(
    link: Passing,
    times: Iterable[int] = range(0, NS, TICK),
    params: SimulatedMotionCaptureParams = QUIET,
    seed: int = 1,
) -> list[tuple[int, Pose]]:
    """What arrives, and when."""
    stream = SimulatedMotionCapture.open(params, SITE, link, random.Random(seed))
    arrived = []
    for now in times:
        link.now = now
        arrived += [(now, pose) for pose in stream.read(now)]
    stream.close()
    return arrived


def test_poses_have_the_exact_times_of_their_rate_and_arrive_late() -> None:
    params = SimulatedMotionCaptureParams(
        rate=120.0, latency=0.03, position_noise=0.0, attitude_noise=0.0
    )
    arrived = poses(Passing(), params=params)
    assert [p.time for _, p in arrived] == [round(i * NS / 120) for i in range(len(arrived))]
    assert len(arrived) == 116
    assert all(0 <= now - p.time - 30_000_000 < TICK for now, p in arrived)


@pytest.mark.parametrize("step", [TICK, 44_000_000], ids=["every tick", "at 23 Hz"])
def test_between_two_states_the_vehicle_moves_on(step: int) -> None:
    arrived = poses(Passing(step))
    assert len(arrived) == 99
    for _, pose in arrived:
        t = pose.time / NS
        assert pose.position == pytest.approx((SPEED * t, 0.0, 1.0), abs=1e-9)
        assert heading_of(pose.attitude) == pytest.approx(TURN * t, abs=1e-6)


def test_a_truth_that_is_not_renewed_ends_where_nobody_knows_more() -> None:
    last = poses(Passing(step=10 * NS))[-1][1]
    assert last.time == NS // 10
    assert last.position == pytest.approx((SPEED * 0.1, 0.0, 1.0))


def test_what_was_missed_while_nobody_read_is_not_made_up_for() -> None:
    """The program hung for a second: where the vehicle was meanwhile, nobody knows."""
    arrived = poses(Passing(), (*range(0, NS, TICK), *range(2 * NS, 3 * NS, TICK)))
    assert [p.time for _, p in arrived if NS <= p.time < 19 * NS // 10] == []
    for _, pose in arrived:
        assert pose.position[0] == pytest.approx(SPEED * pose.time / NS, abs=1e-9)


def test_nothing_comes_while_no_truth_is_known_nor_is_it_made_up_for() -> None:
    arrived = poses(Passing(since=300_000_000, until=600_000_000))
    assert arrived[0][1].time == 300_000_000
    assert arrived[-1][1].time == 590_000_000


def test_while_no_truth_is_known_for_a_while_nothing_comes() -> None:
    class Hidden(Passing):
        def truth(self) -> Truth | None:
            return None if 200_000_000 <= self.now < 700_000_000 else super().truth()

    times = [pose.time for _, pose in poses(Hidden())]
    assert [t for t in times if 200_000_000 <= t < 700_000_000] == []
    assert times[-1] == 980_000_000


def test_its_noise_is_as_it_says_and_comes_with_the_seed() -> None:
    params = SimulatedMotionCaptureParams(rate=250.0, position_noise=0.01, attitude_noise=0.02)
    arrived = poses(Passing(), range(0, 20 * NS, TICK), params)
    off = [pose.position[1] for _, pose in arrived]
    assert fmean(off) == pytest.approx(0.0, abs=0.001)
    assert stdev(off) == pytest.approx(0.01, rel=0.05)
    lean = [rotate(pose.attitude, (0.0, 0.0, 1.0))[0] for _, pose in arrived]
    assert stdev(lean) == pytest.approx(0.02, rel=0.05)
    assert poses(Passing(), params=params) == poses(Passing(), params=params)
    assert poses(Passing(), params=params) != poses(Passing(), params=params, seed=2)


def test_poses_pass_the_filters_of_the_rig() -> None:
    link = Passing()
    link.faults.begin(Effect(filter=lambda pose: None), 0)
    assert poses(link) == []
    moved = Passing()
    moved.faults.begin(
        Effect(filter=lambda p: p._replace(position=add(p.position, (0, 0.3, 0)))), 0
    )
    assert {round(pose.position[1], 6) for _, pose in poses(moved)} == {0.3}


def test_level_at_rest_it_is_exact() -> None:
    class Still(Passing):
        def truth(self) -> Truth:
            return Truth((0.1, 0.2, 0.0), ZERO, LEVEL, ZERO)

    assert {pose[1:] for _, pose in poses(Still())} == {((0.1, 0.2, 0.0), LEVEL)}
