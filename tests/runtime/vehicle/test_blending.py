"""The offset at a change of estimators begins without a step, moves as it says, and ends."""

from __future__ import annotations

from math import exp

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core.geometry import ZERO, add, distance, from_heading, heading_of, norm, scale, sub
from kybflow.core.signals import NS, Estimate
from kybflow.runtime.vehicle.estimation import DECAY, OVER, EstimateBlend

TICK = NS // 250


def at(now, position, velocity=ZERO, heading=0.0, source="a"):
    attitude = from_heading(heading)
    return Estimate(now, position, velocity, attitude, ZERO, source, 0.0, 0.001)


def small(most):
    return st.tuples(*[st.floats(-most, most)] * 3)


@given(small(0.15), small(0.25), st.floats(-0.3, 0.3))
def test_the_output_goes_on_where_and_as_fast_as_the_last_one(position, velocity, heading):
    last = at(0, (1.0, 2.0, 1.0), (0.1, 0.0, 0.2), 0.4)
    new = at(TICK, sub(last.position, position), sub(last.velocity, velocity), 0.4 - heading)
    _, blend = EstimateBlend.between(last, new)
    out = blend.applied(new)
    assert out.position == pytest.approx(add(last.position, scale(last.velocity, TICK / NS)))
    assert out.velocity == pytest.approx(last.velocity)
    assert heading_of(out.attitude) == pytest.approx(0.4)
    assert (out.source, out.age, out.spread) == (new.source, new.age, new.spread)


@given(small(0.15), small(0.25))
def test_its_velocity_is_the_derivative_of_its_position_and_it_ends(position, velocity):
    _, blend = EstimateBlend.between(at(0, position, velocity), at(0, ZERO))
    for now in range(0, 6 * NS, NS // 4):
        before, here, after = (
            blend.applied(at(t, ZERO)) for t in (now, now + TICK, now + 2 * TICK)
        )
        slope = scale(sub(after.position, before.position), 0.5 * NS / TICK)
        assert here.velocity == pytest.approx(slope, abs=1e-4)
    end = round(OVER * NS)
    assert norm(blend.applied(at(end, ZERO)).position) < 5e-5
    assert not blend.is_over(end - 1)
    assert blend.is_over(end + TICK)


def test_it_never_moves_faster_than_its_page_says():
    _, blend = EstimateBlend.between(at(0, (0.3, 0.0, 0.0)), at(0, ZERO))
    speeds = [norm(blend.applied(at(t, ZERO)).velocity) for t in range(0, 8 * NS, TICK)]
    assert max(speeds) == pytest.approx(0.3 * DECAY / exp(1.0), rel=1e-3)


@pytest.mark.parametrize(
    "last", [at(0, (0.31, 0.0, 0.0)), at(0, (0.1, 0.0, 0.0), heading=0.4)], ids=["far", "turned"]
)
def test_an_output_that_was_wrong_is_left_at_once(last):
    offset, blend = EstimateBlend.between(last, at(TICK, ZERO))
    assert blend is None
    assert offset == pytest.approx(distance(last.position, ZERO))


def test_a_velocity_that_was_noise_counts_no_more():
    _, blend = EstimateBlend.between(at(0, (0.1, 0.0, 0.0), (0.9, 0.0, 0.0)), at(0, ZERO))
    out = blend.applied(at(0, ZERO))
    assert out.position == pytest.approx((0.1, 0.0, 0.0))
    assert out.velocity == pytest.approx(ZERO)


def test_the_tracking_of_the_largest_offset_is_never_two_centimetres_off():
    """TeleKyb's law (9.0, 7.5) on a point mass that believes the blended estimate."""
    _, blend = EstimateBlend.between(at(0, (0.3, 0.0, 0.0)), at(0, ZERO))
    x = v = worst = 0.0
    for now in range(0, 8 * NS, TICK):
        told = blend.applied(at(now, (x - 0.3, 0.0, 0.0), (v, 0.0, 0.0)))
        error = -told.position[0]
        worst = max(worst, abs(error))
        v += (9.0 * error - 7.5 * told.velocity[0]) * TICK / NS
        x += v * TICK / NS
    assert worst < 0.02
    assert x == pytest.approx(0.3, abs=0.005)
