"""What a formation's places must slow down for: what is far from all is left out, and nothing that
is near any."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from part_bench import SITE

from kybflow.core.geometry import Vec3, add
from kybflow.flight.avoidance.clearance import reach_of, walls
from kybflow.flight.formation.frame import MovingFrame
from kybflow.flight.formation.places import NEAR_PLACES, places_of, seen_from
from kybflow.runtime.behaviors.formation.room import FormationRoom, FormationRoomParams
from kybflow.world.shapes import Box, Sphere

PARAMS, SPEED = FormationRoomParams(), 1.0
SPHERES = (Sphere((1.0, 2.0, 1.0), 0.4), Sphere((-2.5, 0.0, 2.0), 0.2))
level = st.floats(-3.0, 3.0)
centres = st.tuples(level, level, st.floats(0.4, 2.6))


@given(centres, st.floats(-3.0, 3.0))
def test_all_that_is_near_a_place_is_found(centre: Vec3, heading: float) -> None:
    context = SITE._replace(fence=Box((-3.5, -3.5, 0.0), (3.5, 3.5, 3.0)))
    taken = seen_from(places_of("triangle", 0.9, 6), 0, range(6))
    frame, room = MovingFrame(centre, heading=heading), FormationRoom(context, ())
    found = room.near(frame, taken, SPHERES, SPEED, PARAMS)
    box, keep = room.box(PARAMS), context.airframe.arm + PARAMS.clearance
    assert box is not None
    wanted: set[tuple[Vec3, Vec3]] = set()
    vertical: list[tuple[float, Vec3]] = []
    for offset in frame.all_turned(taken.places):
        place = add(centre, offset)
        *sides, floor, ceiling = walls(place, box)
        rooms = [(one.room, one.normal) for one in sides]
        rooms += [(s.distance(place) - keep, s.outward(place)) for s in SPHERES]
        wanted |= {(offset, out) for left, out in rooms if left < reach_of(SPEED) - 1e-9}
        vertical += [(one.room, one.normal) for one in (floor, ceiling)]
    assert wanted <= {(offset, surface.normal) for offset, surface in found}
    for normal in {normal for _, normal in vertical}:
        least = min(left for left, out in vertical if out == normal)
        told = [surface.room for _, surface in found if surface.normal == normal]
        assert not told or abs(min(told) - least) < 1e-9
        assert told or least > reach_of(SPEED) - 1e-9


def test_the_nearest_of_the_taken_places_are_judged() -> None:
    taken = seen_from(places_of("line", 1.0, 20), 0, range(1, 20))
    assert [place for place, _ in taken.near] == list(range(1, NEAR_PLACES + 1))
    assert [round(far, 9) for _, far in taken.near] == [float(i) for i in range(1, NEAR_PLACES + 1)]
    assert len(seen_from(places_of("line", 1.0, 20), 3, {0, 5, 40}).places) == 3
