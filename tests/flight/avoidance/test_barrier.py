"""Barriers: nothing is hit, the least is changed, and a solver is never asked about what is not
finite."""

import itertools

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from kybflow.core.geometry import ZERO, Vec3, add, distance, dot, norm, scale
from kybflow.flight.avoidance.barrier import (
    Demand,
    braked,
    demand,
    filtered,
    least_bad,
    reach_of,
    stoppable,
    stopped,
)
from kybflow.flight.avoidance.surroundings import Hazard

BRAKING, STRONGEST = 2.0, 3.0
numbers = st.floats(-3.0, 3.0)
vectors = st.tuples(numbers, numbers, numbers)
normals = vectors.filter(lambda v: norm(v) > 0.1).map(lambda v: scale(v, 1.0 / norm(v)))
demands = st.lists(st.builds(Demand, normals, st.floats(-3.0, 2.7)), max_size=6)


@given(st.floats(0.3, 5.0), st.floats(0.0, 5.0))
def test_the_allowed_speed_stops_in_the_room(braking: float, room: float) -> None:
    speed, slope = stoppable(room, braking)
    assert 0.0 <= speed * slope <= braking + 1e-9
    assert speed <= (2.0 * braking * room) ** 0.5 + 1e-9
    ahead, _ = stoppable(room + 1e-6, braking)
    assert (ahead - speed) / 1e-6 == pytest.approx(slope, abs=1e-2)


@given(vectors, demands)
def test_what_fulfils_every_demand_is_left_alone(wanted: Vec3, asked: list[Demand]) -> None:
    assume(all(d.holds(wanted) for d in asked))
    assert filtered(wanted, asked, STRONGEST) == wanted
    assert stopped(wanted, ZERO, asked, STRONGEST, 0.01) == wanted


@given(vectors, demands)
def test_what_is_given_is_allowed_and_no_other_is_nearer(wanted: Vec3, asked: list[Demand]) -> None:
    given = filtered(wanted, asked, STRONGEST)
    if given is None or given is wanted:
        return
    assert all(dot(d.normal, given) >= d.least - 1e-6 for d in asked)
    assert max(map(abs, given)) <= STRONGEST + 1e-6
    for step in itertools.product((-0.01, 0.0, 0.01), repeat=3):
        other = add(given, step)
        allowed = all(d.holds(other) for d in asked) and max(map(abs, other)) <= STRONGEST
        assert not allowed or distance(other, wanted) >= distance(given, wanted) - 1e-6


def test_what_contradicts_itself_has_no_answer() -> None:
    asked = [Demand((1.0, 0.0, 0.0), 1.0), Demand((-1.0, 0.0, 0.0), 1.0)]
    assert filtered(ZERO, asked, STRONGEST) is None
    assert stopped(ZERO, ZERO, asked, STRONGEST, 0.01) is None


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_solver_is_not_asked_about_what_is_not_finite(bad: float) -> None:
    asked = [Demand((1.0, 0.0, 0.0), 1.0), Demand((0.0, 1.0, 0.0), 1.0)]
    with pytest.raises(ValueError, match="not finite"):
        filtered((-1.0, bad, 0.0), [*asked, Demand((0.0, bad, 1.0), 1.0)], STRONGEST)


@given(st.floats(0.0, 3.0), st.floats(-1.0, 1.0))
def test_beyond_reach_nothing_is_demanded(speed: float, across: float) -> None:
    room = reach_of(speed, BRAKING, STRONGEST) + 1e-6
    hazard = Hazard("wall", room, (-1.0, 0.0, 0.0))
    asked = demand(hazard, 0.0, (speed, across, 0.0), BRAKING, STRONGEST)
    assert asked.holds((STRONGEST, 0.0, 0.0))


def rooms_of(wanted: Vec3, speed: float, wall: float, keep: float, dt: float = 0.01) -> list[float]:
    """The rooms of a point mass that flies east at `speed` and always wants more."""
    x, v, rooms = 0.0, speed, []
    for _ in range(round(6.0 / dt)):
        hazard = Hazard("wall", wall - x, (-1.0, 0.0, 0.0))
        asked = demand(hazard, keep, (v, 0.0, 0.0), BRAKING, STRONGEST)
        given = filtered(wanted, [asked], STRONGEST) or braked((v, 0.0, 0.0), STRONGEST, dt)
        x, v = x + v * dt + 0.5 * given[0] * dt * dt, v + given[0] * dt
        rooms.append(wall - x - keep)
    return rooms


@given(st.floats(0.0, 2.0), st.floats(0.05, 0.5), st.floats(0.0, 3.0))
def test_a_wall_is_never_touched_by_whom_could_stop(push: float, keep: float, more: float) -> None:
    speed = 1.5
    room = speed * speed / (2.0 * BRAKING) + 0.3 + more
    rooms = rooms_of((push, 0.0, 0.0), speed, room + keep, keep)
    assert min(rooms) > -2e-3


def test_who_heads_for_something_stops_and_does_not_slide() -> None:
    wall = Demand(scale((-1.0, 0.1, 0.0), 1.0 / norm((-1.0, 0.1, 0.0))), 1.0)
    velocity = (0.5, 0.0, 0.0)
    assert stopped(ZERO, velocity, [wall], STRONGEST, 0.01)[1] == 0.0
    assert filtered(ZERO, [wall], STRONGEST)[1] != 0.0


def test_who_passes_by_slides_along() -> None:
    wall = Demand((0.0, 1.0, 0.0), 0.5)
    assert stopped(ZERO, (0.5, -0.1, 0.0), [wall], STRONGEST, 0.01) == (0.0, 0.5, 0.0)


def test_vehicles_share_what_is_allowed_and_each_does_what_is_demanded() -> None:
    free = Hazard("b", 2.0, (-1.0, 0.0, 0.0), is_vehicle=True)
    alone = free._replace(is_vehicle=False)
    shared = demand(free, 0.0, ZERO, BRAKING, STRONGEST).least
    assert shared == pytest.approx(0.5 * demand(alone, 0.0, ZERO, BRAKING, STRONGEST).least)
    fast = (3.0, 0.0, 0.0)
    near, lone = (h._replace(room=0.5) for h in (free, alone))
    asked = demand(near, 0.0, fast, BRAKING, STRONGEST)
    assert asked.least > 0.0
    assert asked == demand(lone, 0.0, fast, BRAKING, STRONGEST)


def test_where_there_is_no_way_what_is_missed_is_shared() -> None:
    asked = [Demand((1.0, 0.0, 0.0), 1.0), Demand((-1.0, 0.0, 0.0), 0.5)]
    found = least_bad((0.0, 1.0, 0.0), asked, STRONGEST)
    assert found == pytest.approx((0.25, 1.0, 0.0), abs=1e-2)
