"""Positions as of GPS: when they come, how far they are off, and that they disturb nothing."""

from __future__ import annotations

import statistics
from dataclasses import replace

import pytest
from sim_worlds import PERIOD, QUIET, STOPPED, in_flight, opened, push, seat, thrust, world

from kybflow.core.geometry import sub
from kybflow.core.signals import NS, Imu, Position
from kybflow.drivers.sim import SimParams

WANTED = frozenset({Position})


def positions(params: SimParams = QUIET, seconds: float = 10.0, seed: int = 1) -> list[Position]:
    """The positions of a vehicle that stands at the origin."""
    session = world(seat(params=params), seed=seed)
    session.links["a"].subscribe(WANTED)
    measured, _ = push(session, session.links["a"], seconds, STOPPED)
    return [m for m in measured if isinstance(m, Position)]


def test_they_come_at_their_rate_late_and_only_where_they_are_wanted():
    session, link = opened()
    measured, now = push(session, link, 1.0, STOPPED)
    assert not any(isinstance(m, Position) for m in measured)
    link.subscribe(WANTED)
    for _ in range(500):
        now += PERIOD
        session.advance(now)
        for measurement in link.read(now):
            if isinstance(measurement, Position):
                assert 0 <= now - measurement.time - 120_000_000 < PERIOD
                measured.append(measurement)
    times = [m.time for m in measured if isinstance(m, Position)]
    assert times == [NS + i * NS // 5 for i in range(len(times))]
    assert len(times) == 10


def test_what_a_tick_reads_is_in_order():
    session, link = opened(seat(params=replace(QUIET, position_latency=0.12)))
    link.subscribe(WANTED | {Imu})
    now = 0
    for _ in range(250):
        now += PERIOD
        session.advance(now)
        times = [m.time for m in link.read(now)]
        assert times == sorted(times)


@pytest.mark.thorough
def test_they_are_off_as_they_say_and_half_of_that_wanders_slowly():
    errors = [[], [], []]
    pairs = []
    for seed in range(12):
        row = positions(replace(QUIET, position_rate=20.0), seconds=40.0, seed=seed)
        assert row[0].spread == (0.3, 0.3, 0.5)
        for axis in range(3):
            errors[axis] += [p.position[axis] for p in row]
        near = zip(row, row[4:], strict=False)
        pairs += [a.position[0] * b.position[0] for a, b in near]
    deviations = [statistics.pstdev(axis) for axis in errors]
    assert deviations == pytest.approx([0.3, 0.3, 0.5], rel=0.25)
    assert statistics.mean(pairs) / deviations[0] ** 2 == pytest.approx(0.5, abs=0.2)


def test_without_noise_they_are_the_truth_of_their_time():
    exact = replace(QUIET, position_noise=0.0, position_noise_up=0.0, position_latency=0.0)
    session, link, now = in_flight(exact)
    link.subscribe(WANTED)
    for _ in range(100):
        link.send(thrust(12.0), now)
        now += PERIOD
        session.advance(now)
        for measurement in link.read(now):
            if isinstance(measurement, Position):
                off = sub(measurement.position, link.truth().position)
                assert max(map(abs, off)) < 0.002 * 15


def test_nothing_else_changes_where_they_are_wanted():
    def flight(kinds):
        session, link, now = in_flight(SimParams(gust=0.5), seconds=2.0)
        link.subscribe(kinds | {Imu})
        measured, _ = push(session, link, 1.0, thrust(11.0), now)
        return [m for m in measured if not isinstance(m, Position)], link.truth()

    alone, truth = flight(frozenset())
    assert any(isinstance(m, Imu) for m in alone)
    assert flight(WANTED) == (alone, truth)
