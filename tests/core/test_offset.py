"""Clocks that nobody synchronised."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core.clock_offset import Offset
from kybflow.core.signals import NS

MS = NS // 1000


def readings(seconds: float, rate: int = 100) -> list[int]:
    return [i * NS // rate for i in range(round(seconds * rate))]


def agreeing(seconds: float = 5) -> Offset:
    """The offset of two clocks that have agreed for so long."""
    offset = Offset()
    for there in readings(seconds):
        offset.of(there, there)
    return offset


def test_the_least_delay_counts() -> None:
    generator, offset = random.Random(1), Offset()
    errors = []
    for there in readings(20):
        delay = round(generator.expovariate(1 / (2 * MS)))
        errors.append(offset.of(there + 7 * NS + delay, there) - 7 * NS)
    assert all(0 <= error < 0.2 * MS for error in errors[200:])


@pytest.mark.parametrize("drift", [-1e-4, 1e-4])
def test_a_drift_is_followed(drift: float) -> None:
    generator, offset = random.Random(2), Offset()
    worst = 0
    for there in readings(100):
        here = there + round(there * drift)
        delay = round(generator.expovariate(1 / MS))
        found = offset.of(here + delay, there)
        if there >= NS:
            worst = max(worst, abs(found - (here - there)))
    assert worst < 2 * MS


@given(st.lists(st.tuples(st.integers(0, NS), st.integers(0, NS)), min_size=1, max_size=60))
def test_nothing_comes_from_the_future(steps: list[tuple[int, int]]) -> None:
    offset, there = Offset(), 0
    for step, delay in steps:
        there += step
        here = there + delay
        assert there + offset.of(here, there) <= here


def test_a_clock_that_is_set_ahead_is_noticed_at_once() -> None:
    assert agreeing().of(5 * NS, 65 * NS) == -60 * NS


def test_a_clock_that_is_set_back_is_noticed_after_two_seconds() -> None:
    offset = agreeing()
    found = [offset.of(5 * NS + t, 5 * NS + t - 60 * NS) for t in readings(3)]
    assert found[-1] == 60 * NS
    assert found.index(60 * NS) <= 200


def test_a_stall_is_no_step() -> None:
    """Half a second in which nothing comes, then all of it at once."""
    offset = agreeing()
    held = [offset.of(5 * NS + NS // 2, 5 * NS + t) for t in readings(0.5)]
    assert set(held) == {0}


def test_what_was_long_ago_is_forgotten() -> None:
    offset = Offset()
    offset.of(0, 0)
    assert offset.of(60 * NS + 5 * MS, 60 * NS) == 5 * MS


def known(offset: Offset, seconds: float = 5) -> int:
    """Readings of two clocks that agree; when the last one is."""
    times = readings(seconds)
    for there in times:
        offset.of(there + MS, there)
    assert offset.of(times[-1] + MS, times[-1]) == MS
    return times[-1]


@pytest.mark.parametrize("ahead", [60 * MS, 200 * MS, 2 * NS, 3600 * NS])
def test_one_stamp_that_is_ahead_changes_nothing(ahead: int) -> None:
    """It counts as sent when it came; the next ones as before."""
    offset = Offset()
    now = known(offset) + 10 * MS
    wrong = now + ahead
    assert wrong + offset.of(now + MS, wrong) == now + MS
    assert offset.is_doubted
    assert offset.of(now + 11 * MS, now + 10 * MS) == MS
    assert not offset.is_doubted


def test_nor_do_many_that_are_all_the_same_or_all_different() -> None:
    """As a frame with many bodies has it, and a server that is out of its mind now and then."""
    offset, generator = Offset(), random.Random(4)
    begin = known(offset)
    for there in readings(3):
        here = begin + there + MS
        assert offset.of(here, begin + there) == MS
        if there // (10 * MS) % 20 == 0:
            wrong = begin + there + round(generator.uniform(0.1, 100.0) * NS)
            assert [offset.of(here, wrong) for _ in range(10)] == [here - wrong] * 10


def test_a_first_stamp_that_is_ahead_is_no_standard() -> None:
    offset = Offset()
    offset.of(0, 2 * NS)
    found = [offset.of(there + MS, there) for there in readings(3)]
    assert set(found) == {MS}


def test_a_link_that_was_slow_at_first_is_noticed() -> None:
    offset = Offset()
    for there in readings(1):
        offset.of(there + 400 * MS, there)
    found = [offset.of(t + NS + 400 * MS + MS, t + NS + 400 * MS) for t in readings(1)]
    assert set(found) == {MS}
    assert not offset.is_doubted


@pytest.mark.parametrize("bodies", [1, 60])
def test_however_many_bodies_a_frame_has_the_clocks_agree(bodies: int) -> None:
    """One stamp for all; before anything is known, and after the clock was set ahead."""
    offset = Offset()
    for ahead in (0, 60 * NS):
        for there in readings(2):
            late = 3 * MS if there // (10 * MS) % 2 else 0
            for _ in range(bodies):
                found = offset.of(2 * bool(ahead) * NS + there + MS + late, there + ahead)
        assert found == 2 * bool(ahead) * NS + MS - ahead
