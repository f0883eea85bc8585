"""hold: comes to rest, flies back and blends, without a step."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from part_bench import DT, at_rest, entry

from kybflow.core.geometry import ZERO, Vec3, add, distance, norm, scale, sub
from kybflow.core.signals import NS, Setpoint, SetpointKind
from kybflow.runtime.vehicle.hold import Hold, SetpointBlend

HERE = (0.0, 0.0, 1.0)
STEP = round(DT * NS)
speeds = st.floats(-1.0, 1.0)


def moving(time: float, velocity: Vec3) -> Setpoint:
    """A behavior that flies straight on."""
    return at_rest(add(HERE, scale(velocity, time)), velocity)


def resumed(velocity: Vec3, held: float, push: Vec3 = ZERO) -> list[Setpoint]:
    """What is followed from the hold on until the blend is over; the vehicle is pushed away when
    the hold begins."""
    begun = entry(add(HERE, push), velocity, setpoint=moving(0.0, velocity))
    hold = Hold({"pause"}, begun, moving(0.0, velocity), grounded=False)
    now, samples = STEP, []
    while (setpoint := hold.update(now)) is not None:
        if now >= held * NS and hold.lasts:
            hold.leave("pause", now)
        samples.append(setpoint)
        now += STEP
    resumed_at, blend = now, SetpointBlend(now, samples[-1], moving(DT, velocity))
    blended: Setpoint | None = None
    while (blended := blend.added(moving((now - resumed_at) / NS + DT, velocity), now)) is not None:
        samples.append(blended)
        now += STEP
    return [*samples, moving((now - resumed_at) / NS + DT, velocity)]


@settings(max_examples=25, deadline=None)
@given(st.tuples(speeds, speeds, speeds))
def test_from_the_pause_to_the_end_of_the_blend_there_is_no_step(velocity: Vec3):
    samples = resumed(velocity, 1.5)
    for before, after in pairwise(samples):
        mean = scale(add(before.velocity, after.velocity), 0.5 * DT)
        assert distance(after.position, add(before.position, mean)) < 2e-4
        assert norm(sub(after.velocity, before.velocity)) <= 2.2 * DT
        assert norm(after.velocity) <= max(norm(velocity), 0.5) + 0.02


def test_a_vehicle_that_was_pushed_away_is_flown_back_to_where_it_was():
    samples = resumed(ZERO, 1.0, push=(0.8, 0.0, 0.0))
    assert samples[0].position == pytest.approx((0.8, 0.0, 1.0))
    assert samples[-1].position == HERE
    assert max(norm(s.velocity) for s in samples) <= 0.5 + 1e-9


def test_a_velocity_is_blended_in_too():
    asked = Setpoint(SetpointKind.VELOCITY, None, (0.5, 0.0, 0.0), ZERO, ZERO, 0.0)
    blend = SetpointBlend(0, at_rest(HERE), asked)
    speeds = [blend.added(asked, round(t * NS)) for t in (0.0, 0.2, 0.4)]
    east = [s.velocity[0] for s in speeds]
    assert east[0] == pytest.approx(0.0)
    assert east == sorted(east)
    assert blend.added(asked, NS) is None


def test_the_last_holder_that_leaves_lets_go():
    hold = Hold({"pause"}, entry(HERE), at_rest(HERE), grounded=False)
    hold.holders.add("brake")
    hold.leave("pause", NS)
    assert hold.lasts
    assert hold.update(NS) is not None
    hold.leave("brake", 2 * NS)
    assert not hold.lasts
    assert hold.update(2 * NS) is None
