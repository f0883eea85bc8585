"""What the fusion believes, what it refuses, and when it begins anew."""

from __future__ import annotations

from math import inf, nan

import pytest
from figure_eight_flight import DT, SKY, TICK, Instant, World, bent, figure, fusion, last, moments
from hypothesis import given, settings
from hypothesis import strategies as st

from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, add, distance, sub
from kybflow.core.signals import NS, Battery, Estimate, Imu, Measurement, Pose, Position
from kybflow.runtime.finite import checked_estimate


def test_a_jump_is_refused_and_the_age_tells() -> None:
    part = fusion()
    jumped = []
    for truth, estimate in moments(
        part, bent(World(6, 6.0), (1.0, 0.0, 0.0), since=4.0, until=4.6)
    ):
        if truth.time > 3 * NS:
            assert estimate is not None
            assert distance(estimate.position, truth.position) < 0.3
        if 4.3 * NS < truth.time < 4.6 * NS:
            jumped.append(estimate)
    ages = [estimate.age for estimate in jumped if estimate]
    assert min(ages) > 0.25
    final = part.filter.state
    assert final is not None
    assert final.doubted is None


def test_a_swapped_body_is_never_followed_and_it_says_so() -> None:
    part = fusion()
    for truth, estimate in moments(part, bent(World(7, 9.0), (0.0, 1.0, 0.0), since=4.0)):
        if truth.time > 5 * NS:
            assert estimate is not None
            assert estimate.spread > 0.5
            assert distance(estimate.position, truth.position) < 1.5 * estimate.spread


def test_after_a_small_step_it_begins_anew() -> None:
    """The frame of the motion capture was moved, or the filter was wrong: no body is exchanged
    with one so near."""
    part = fusion()
    offset = (0.25, 0.0, 0.0)
    estimate = last(part, bent(World(8, 6.0), offset, since=4.0))
    assert distance(estimate.position, add(figure(6.0)[-1].position, offset)) < 0.1
    assert estimate.spread < 0.03


def test_the_estimate_that_is_flown_on_decides_who_is_right() -> None:
    """Both ways: it keeps a swapped body out from the start, and calls a lost filter back."""
    there = (0.0, 1.0, 0.0)
    lost = fusion()
    kept_out = fusion()
    for truth, arriving in bent(World(9, 6.0), there, since=0.0):
        own = arriving
        if truth.time > 3 * NS:
            own = [
                m._replace(position=sub(m.position, there)) if isinstance(m, Pose) else m
                for m in arriving
            ]
            lost.anchor(told(truth))
        kept_out.anchor(told(truth))
        estimate = lost.update(own, truth.time)
        assert kept_out.update(arriving, truth.time) is None
        if NS < truth.time < 3 * NS:
            assert estimate is not None
            assert distance(estimate.position, truth.position) > 0.9
    assert estimate is not None
    assert distance(estimate.position, truth.position) < 0.1


def told(truth: Instant) -> Estimate:
    """What another estimator tells."""
    return Estimate(
        truth.time, truth.position, truth.velocity, truth.attitude, ZERO, "tags", 0.02, 0.005
    )


def test_carried_elsewhere_on_the_ground_it_settles_there() -> None:
    part = fusion(settled=2.0)
    estimates = []
    for i in range(1, 1000):
        now = i * TICK
        position = (0.0, 0.0, 0.0) if i < 300 else (3.0, 0.0, 0.0)
        arriving: list[Measurement] = [Imu(now, DT, (0.0, 0.0, GRAVITY), ZERO)]
        if i % 10 == 0:
            arriving.append(Pose(now, position, LEVEL))
        estimates.append(part.update(arriving, now))
    held, moved = estimates[700], estimates[-1]
    assert held is not None
    assert distance(held.position, ZERO) < 0.5 < held.spread
    assert moved is not None
    assert moved.position == pytest.approx((3.0, 0.0, 0.0), abs=0.02)


def test_a_wrong_pose_at_the_start_keeps_nobody_out() -> None:
    part = fusion()
    ticks = bent(World(1, 3.0), (2.0, 0.0, 0.0), since=0.0, until=0.13)
    estimate = last(part, ticks)
    assert distance(estimate.position, figure(3.0)[-1].position) < 0.1


def test_positions_alone_begin_only_at_rest() -> None:
    part = fusion(source="position")
    ticks = [tick for tick in World(2, 5.0, **SKY).flight() if tick[0].time > 2.5 * NS]
    assert all(estimate is None for _, estimate in moments(part, ticks))


def test_without_an_imu_there_is_no_estimate_and_afterwards_there_is() -> None:
    part = fusion()
    for truth, arriving in World(5, 6.0).flight():
        silent = 4.0 < truth.time / NS < 4.4
        heard = [m for m in arriving if not (silent and isinstance(m, Imu))]
        estimate = part.update(heard, truth.time)
        if 4.11 < truth.time / NS < 4.4:
            assert estimate is None
        elif truth.time > 4.4 * NS:
            assert estimate is not None
            assert distance(estimate.position, truth.position) < 4.0 * estimate.spread + 0.05


number = st.one_of(
    st.floats(-3.0, 3.0), st.sampled_from([nan, inf, -inf, 1e300, -1e300, 1e-300, 1e5, 0.0])
)
vector = st.tuples(number, number, number)
rotation = st.one_of(st.just(LEVEL), st.tuples(number, number, number, number))
moment = st.one_of(st.integers(-NS, NS // 2), st.integers(0, 50).map(lambda i: i * TICK))
nonsense = st.one_of(
    st.builds(Pose, moment, vector, rotation),
    st.builds(Position, moment, vector, vector),
    st.builds(Imu, moment, number, vector, vector),
    st.builds(Battery, moment, number, number, st.none()),
)


@pytest.mark.thorough
@given(
    source=st.sampled_from(["mocap", "position"]),
    batches=st.lists(st.lists(nonsense, max_size=3), max_size=40),
)
@settings(max_examples=30, deadline=None, derandomize=True)
def test_nonsense_gives_no_estimate_or_a_finite_one(
    source: str, batches: list[list[Measurement]]
) -> None:
    part = fusion(source=source)
    heard = 0
    for i, batch in enumerate([[], *batches, *([[]] * 160)]):
        now = i * TICK
        good: list[Measurement] = [
            Imu(now, DT, (0.0, 0.0, GRAVITY), ZERO),
            Pose(now - TICK, ZERO, LEVEL) if source == "mocap" else Position(now, ZERO, (0.1,) * 3),
        ]
        estimate = part.update([*batch, *(good if i % 2 else ())], now)
        if estimate is not None:
            heard += 1
            checked_estimate(estimate)
    assert heard > 0
