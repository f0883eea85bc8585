"""land: down to the ground wherever it is, noticed there and nowhere else."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from part_bench import (
    DT,
    SITE,
    Body,
    Flown,
    entry,
    estimate,
    fly,
    point_mass,
    tick,
    worst_mismatch,
)

from kybflow.core.geometry import ZERO, Vec3, distance, norm
from kybflow.core.signals import Done, Failed, Setpoint, SetpointKind
from kybflow.parts import GROUND, MOVING
from kybflow.runtime.behaviors.land import Land, LandParams
from kybflow.world.shapes import Box

IDLE = Setpoint(SetpointKind.IDLE)
START = (0.3, 0.4, 1.5)


def traced(body: Body) -> tuple[Body, list[float]]:
    """The body, and the list of its heights."""
    heights: list[float] = []

    def watched(setpoint: Setpoint | None) -> tuple[Vec3, Vec3]:
        position, velocity = body(setpoint)
        heights.append(position[2])
        return position, velocity

    return watched, heights


@settings(max_examples=12)
@given(st.floats(-2.0, 1.2))
def test_it_comes_down_whatever_the_height_of_the_ground(ground: float) -> None:
    body = point_mass(START, ground)
    flown = fly(Land(LandParams(), entry(START)), body)
    assert flown.end == Done(IDLE)
    position, _ = body(None)
    assert position[2] == ground


def test_it_descends_fast_and_then_slowly() -> None:
    flown = fly(Land(LandParams(), entry(START)), point_mass(START, ground=0.0))
    high = [s.setpoint.velocity[2] for s in flown.moving if s.setpoint.position[2] > 0.8]
    low = [s.setpoint.velocity[2] for s in flown.moving if s.setpoint.position[2] < 0.39]
    assert min(high) == pytest.approx(-0.5)
    assert low == pytest.approx([-0.2] * len(low), abs=0.02)


def test_it_notices_the_ground_soon_and_asks_for_little_more() -> None:
    watched, heights = traced(point_mass(START, ground=0.0))
    flown = fly(Land(LandParams(), entry(START)), watched)
    touched = next(i for i, z in enumerate(heights) if z == 0.0) * DT
    assert flown.duration - touched < 1.5
    assert min(s.setpoint.position[2] for s in flown.moving) >= -0.3


def test_a_vehicle_that_is_far_lower_than_its_setpoint_waits_for_nothing() -> None:
    behavior, low = Land(LandParams(), entry((0.3, 0.4, 9.0))), estimate((0.3, 0.4, 1.5))
    for step in range(round(1.2 / DT)):
        setpoint = behavior.update(tick(step * DT, low))
    assert isinstance(setpoint, Setpoint)
    assert setpoint.position is not None
    assert setpoint.position[2] < 1.5


@pytest.mark.parametrize("noise", [0.05, 0.1])
def test_it_notices_the_ground_by_a_noisy_height_and_nothing_else(noise: float) -> None:
    (body, heights), chance = traced(point_mass(START, ground=0.0)), random.Random(4)
    wander = [0.0]

    def noisy(setpoint: Setpoint | None):
        (x, y, z), velocity = body(setpoint)
        wander[0] += DT / 0.05 * (chance.gauss(0.0, noise * (2 * 0.05 / DT) ** 0.5) - wander[0])
        return (x, y, z + wander[0]), velocity

    flown = fly(Land(LandParams(), entry(START)), noisy)
    assert flown.end == Done(IDLE)
    assert heights[-1] == 0.0
    assert flown.duration < 15.0


def test_one_that_comes_no_lower_fails() -> None:
    """Held up by a hand, and shaken."""
    chance = random.Random(4)

    def held(setpoint: Setpoint | None):
        return (0.3, 0.4, 1.5 + chance.choice((-0.3, 0.3))), ZERO

    flown = fly(Land(LandParams(), entry(START)), held)
    assert isinstance(flown.end, Failed)
    assert "no lower for 10 s" in flown.end.reason


@pytest.mark.parametrize("push", [1.0, 3.0])
def test_an_updraught_is_no_ground(push: float) -> None:
    watched, heights = traced(point_mass(START, ground=0.0, push=(0.0, 0.0, push)))
    flown = fly(Land(LandParams(), entry(START)), watched)
    assert flown.end == Done(IDLE)
    assert min(heights) == 0.0


def test_noise_in_the_height_does_not_hide_the_ground() -> None:
    generator = random.Random(1)
    body = point_mass(START, ground=0.0)

    def noisy(setpoint: Setpoint | None):
        (x, y, z), (vx, vy, vz) = body(setpoint)
        return (x, y, z + generator.gauss(0.0, 0.003)), (vx, vy, vz + generator.gauss(0.0, 0.2))

    flown = fly(Land(LandParams(), entry(START)), noisy, seconds=20.0)
    assert flown.end == Done(IDLE)


def test_on_the_ground_it_is_done_at_once() -> None:
    assert Land(LandParams(), entry(ZERO, flight=GROUND)).update(tick()) == Done(IDLE)


def test_a_lost_setpoint_in_the_air_is_no_ground() -> None:
    body = point_mass(START, ground=0.0)
    flown = fly(Land(LandParams(), entry(START, flight=MOVING)), body)
    assert flown.duration > 3.0
    assert body(None)[0][2] == 0.0


def test_it_sheds_the_velocity_of_entry_and_stays_where_that_ends() -> None:
    behavior = Land(LandParams(), entry(START, (0.6, 0.0, 0.0)))
    flown = fly(behavior, point_mass(START, ground=0.0))
    first, last = flown.moving[0].setpoint, flown.moving[-1].setpoint
    assert first.velocity[:2] == (0.6, 0.0)
    assert last.velocity[:2] == (0.0, 0.0)
    assert distance(last.position, (last.position[0], START[1], last.position[2])) == 0.0


def test_a_descent_that_was_broken_off_goes_on_as_fast_as_it_was() -> None:
    behavior = Land(LandParams(), entry(START, (0.0, 0.0, -0.4)))
    first = fly(behavior, point_mass(START, ground=0.0)).moving[0].setpoint
    assert first.velocity[2] == pytest.approx(-0.4, abs=0.01)


def test_after_a_hang_the_descent_goes_on_from_where_the_vehicle_is() -> None:
    behavior, low = Land(LandParams(), entry(START, (0.0, 0.0, -0.4))), (0.3, 0.4, 0.2)
    before = behavior.update(tick(0.0, estimate(START, (0.0, 0.0, -0.4))))
    after = behavior.update(tick(1.0, estimate(low, (0.0, 0.0, -0.1)), before)._replace(dt=1.0))
    assert isinstance(after, Setpoint)
    assert after.position is not None
    assert low[2] - 0.06 < after.position[2] < low[2]
    assert after.velocity is not None
    assert -0.3 < after.velocity[2] < 0.0


POINT = (1.0, -0.2, 0.0)


def on(position: Vec3 = POINT, **more: float) -> Land:
    return Land(LandParams(position=position, **more), entry(START))


def test_on_a_point_it_first_flies_above_it_and_then_comes_down_there() -> None:
    body = point_mass(START, ground=0.0)
    flown = fly(on(), body)
    assert flown.end == Done(IDLE)
    assert body(None)[0] == pytest.approx(POINT, abs=0.01)
    high = [s.setpoint for s in flown.moving if s.setpoint.position[:2] != POINT[:2]]
    assert {s.position[2] for s in high} == {START[2]}
    assert max(norm(s.velocity) for s in high) <= 0.5 + 1e-9
    assert worst_mismatch(flown.moving, "position", "velocity") < 1e-2


def test_on_a_platform_it_slows_down_above_that() -> None:
    flown = fly(on((1.0, -0.2, 0.6)), point_mass(START, ground=0.6))
    slow = [s.setpoint for s in flown.moving if 0.61 < s.setpoint.position[2] < 0.95]
    assert [s.velocity[2] for s in slow] == pytest.approx([-0.2] * len(slow), abs=0.05)
    assert flown.end == Done(IDLE)


def test_it_does_not_descend_before_it_is_above_the_point() -> None:
    flown = fly(on(patience=2.0), lambda _: (START, ZERO))
    assert isinstance(flown.end, Failed)
    assert "from above the point" in flown.end.reason
    assert {s.setpoint.position[2] for s in flown.samples} == {START[2]}


def test_while_it_is_blown_off_the_descent_waits_but_not_for_ever() -> None:
    body = point_mass(START, ground=0.0)

    def blown(setpoint: Setpoint | None):
        (x, y, z), velocity = body(setpoint)
        return (x + 0.3 if z < 1.0 else x, y, z), velocity

    flown = fly(on(patience=3.0), blown)
    assert flown.end == Done(IDLE)
    waiting = [s for s in flown.moving if s.setpoint.velocity[2] == 0.0]
    held = [s for s in waiting if s.setpoint.position[2] < 1.1]
    assert len(held) * DT == pytest.approx(3.0, abs=0.8)


def test_its_footprint_leads_over_the_point() -> None:
    footprint = Land.footprint(LandParams(position=POINT), START)
    assert footprint.path == (START, (1.0, -0.2, START[2]), POINT)
    assert footprint.exit == POINT
    assert Land.footprint(LandParams(position=POINT), None).exit == POINT
    assert Land.footprint(LandParams(), START).points == (START, (*START[:2], 0.0))
    assert Land.footprint(LandParams(), None) is None


def test_an_estimate_that_stands_still_while_nothing_is_heard_is_no_ground() -> None:
    landing = Land(LandParams(), entry(START))
    frozen = estimate(START)
    for i in range(1, 2000):
        silent = tick(i * DT, frozen._replace(age=0.31))._replace(link_age=0.31)
        assert landing.update(silent) != Done(IDLE), i * DT
    heard = [landing.update(tick((2000 + i) * DT, frozen)) for i in range(300)]
    assert Done(IDLE) in heard


def test_poses_from_elsewhere_show_the_ground_while_the_link_is_silent() -> None:
    landing = Land(LandParams(), entry(START))
    ends = [
        landing.update(tick(i * DT, estimate(START))._replace(link_age=3.0)) for i in range(1, 2000)
    ]
    assert Done(IDLE) in ends


AT_AN_EDGE = (0.3, 0.4, 1.5)
TABLE = SITE._replace(
    start=(-1.5, 0.0, 0.0), obstacles={"table": Box((0.25, -0.6, 0.0), (1.5, 1.0, 0.6))}
)


def said(behavior: Land, body: Body) -> tuple[Vec3, set[str | None], Flown]:
    """Where the body ends, and what the behavior waited for on the way."""
    waits: set[str | None] = set()

    def watched(setpoint: Setpoint | None) -> tuple[Vec3, Vec3]:
        waits.add(behavior.waits_for)
        return body(setpoint)

    flown = fly(behavior, watched)
    return body(None)[0], waits, flown


@pytest.mark.parametrize("height", [1.5, 0.75])
def test_it_does_not_land_on_the_edge_of_an_obstacle_but_beside_it(height: float) -> None:
    over = (*AT_AN_EDGE[:2], height)
    behavior = Land(LandParams(), entry(over, context=TABLE))
    (x, _, z), waits, flown = said(behavior, point_mass(over, ground=0.0))
    assert flown.end == Done(IDLE)
    assert (z, waits) == (0.0, {None, "an edge of `table` is below"})
    assert x < 0.25 - 0.5 * SITE.airframe.diameter - 0.15


def test_where_there_is_no_place_beside_the_edge_it_says_so_and_lands_in_the_end() -> None:
    narrow = TABLE._replace(fence=Box((-0.05, 0.0, 0.0), (0.6, 0.8, 2.0)))
    behavior = Land(LandParams(patience=2.0), entry(AT_AN_EDGE, context=narrow))
    _, waits, flown = said(behavior, point_mass(AT_AN_EDGE, ground=0.6))
    assert "an edge of `table` is below, and no place beside it is free" in waits
    assert flown.end == Done(IDLE)
    assert flown.duration > 2.0


def test_on_the_point_of_a_landing_the_author_may_have_an_edge() -> None:
    position = (*AT_AN_EDGE[:2], 0.6)
    behavior = Land(LandParams(position=position), entry(AT_AN_EDGE, context=TABLE))
    ended, waits, _ = said(behavior, point_mass(AT_AN_EDGE, ground=0.6))
    assert distance(ended, position) < 0.05
    assert waits == {None}
