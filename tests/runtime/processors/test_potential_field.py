"""potential_field: TeleKyb's values, whatever the order; it comes back to what was asked."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st
from part_bench import DT, SITE, at_rest, estimate, tick

from kybflow.core.geometry import ZERO, distance, norm
from kybflow.core.signals import Setpoint, SetpointKind
from kybflow.flight.avoidance.surroundings import Hazard
from kybflow.runtime.processors.potential_field import (
    Potential,
    PotentialField,
    PotentialFieldParams,
    push,
    repulsion,
)
from kybflow.world.shapes import Cylinder, Plane

TELEKYB = Potential(0.4, 0.4, 0.2, 0.5, 100.0, 4.0)
WALL = SITE._replace(obstacles={"wall": Plane((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0))})


def test_it_has_telekybs_values() -> None:
    assert repulsion(0.5, TELEKYB) == 0.0
    assert repulsion(0.2, TELEKYB) == repulsion(-1.0, TELEKYB) == 4.0
    assert repulsion(0.445, TELEKYB) == 4.0
    assert 3.5 < repulsion(0.4475, TELEKYB) < 4.0
    assert repulsion(0.49, TELEKYB) == pytest.approx(0.03, abs=0.03)


@given(st.floats(-1.0, 1.0), st.floats(0.0, 0.5))
def test_it_falls_with_the_distance(near: float, more: float) -> None:
    assert repulsion(near, TELEKYB) >= repulsion(near + more, TELEKYB) >= 0.0


def test_the_order_does_not_count() -> None:
    hazards = [
        Hazard("a", 0.86, (1.0, 0.0, 0.0)),
        Hazard("b", 3.0, (0.0, 1.0, 0.0)),
        Hazard("c", 0.87, (0.0, 0.0, 1.0)),
        Hazard("d", 3.0, (0.0, -1.0, 0.0)),
    ]
    first = push(hazards, TELEKYB)
    assert norm(first) > 0.5
    for other in itertools.permutations(hazards):
        assert push(other, TELEKYB) == pytest.approx(first)


def test_above_and_below_it_reaches_less_far() -> None:
    flat = TELEKYB._replace(above=0.15)
    assert push([Hazard("a", 0.7, (0.0, 0.0, 1.0))], flat) is ZERO
    assert push([Hazard("a", 0.7, (1.0, 0.0, 0.0))], flat) != ZERO


def test_with_nothing_in_reach_setpoints_pass() -> None:
    part, asked = PotentialField(PotentialFieldParams(), WALL), at_rest((0.0, 0.0, 1.0))
    assert all(part(asked, tick(i * DT, estimate((0.0, 0.0, 1.0)))) is asked for i in range(50))


def test_a_velocity_gets_at_most_half_a_metre_a_second() -> None:
    part = PotentialField(PotentialFieldParams(), WALL)
    asked = Setpoint(SetpointKind.VELOCITY, velocity=(0.3, 0.2, 0.0), heading=0.0)
    near = estimate((0.8, 0.0, 1.0))
    bent = [part(asked, tick((i + 1) * DT, near, asked)) for i in range(500)]
    given = bent[-1]
    assert given.velocity == pytest.approx((-0.2, 0.2, 0.0))


def test_a_position_is_shifted_and_comes_back() -> None:
    pillar = SITE._replace(obstacles={"pillar": Cylinder((1.0, 0.0, 0.0), 0.1, 2.5)})
    part, last = PotentialField(PotentialFieldParams(), pillar), None
    near, far = at_rest((0.4, 0.0, 1.0)), at_rest((-0.5, 0.0, 1.0))
    for i in range(2000):
        known = estimate(near.position if last is None else last.position)
        last = part(near, tick(i * DT, known, last))
        assert norm(last.velocity or ZERO) <= 1.0 + 1e-9
    assert distance(last.position, near.position) > 0.2
    for i in range(2000, 5000):
        last = part(far, tick(i * DT, estimate(last.position), last))
    assert last is far
