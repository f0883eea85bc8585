"""The frame of a formation: places move with it smoothly, copies of it come together, and it stops
in time."""

from __future__ import annotations

from math import dist, pi

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from kybflow.core.geometry import ZERO, Vec3, norm, sub
from kybflow.flight.avoidance.clearance import walls
from kybflow.flight.formation.frame import Asked, FrameLimits, MovingFrame, Shift, mean_frame, moved
from kybflow.flight.motion import Motion
from kybflow.world.shapes import Box

DT = 0.01
LIMITS = FrameLimits(0.5, 0.3, 0.8, 0.7)
numbers = st.floats(-2.0, 2.0)
vectors = st.tuples(numbers, numbers, numbers)
frames = st.builds(
    MovingFrame, vectors, vectors, vectors, st.floats(-pi, pi), st.floats(-1.0, 1.0), st.just(ZERO)
)


@given(frames, vectors, vectors)
def test_a_place_is_found_again(frame: MovingFrame, position: Vec3, velocity: Vec3) -> None:
    world = frame.motion(Motion(position, velocity))
    place = frame.place(world)
    assert place.position == pytest.approx(position, abs=1e-9)
    assert place.velocity == pytest.approx(velocity, abs=1e-9)


@given(frames, vectors)
def test_velocity_is_the_change_of_position(frame: MovingFrame, place: Vec3) -> None:
    step = 1e-6
    before, after = frame.motion(Motion(place)), frame.after(step).motion(Motion(place))
    change = tuple(x / step for x in sub(after.position, before.position))
    assert change == pytest.approx(before.velocity, abs=1e-4)


@pytest.mark.thorough
@given(st.floats(0.3, 1.5), st.floats(-1.0, 1.0))
def test_a_turn_begins_and_ends_as_gently_as_the_frame_moves(reach: float, rate: float) -> None:
    frame, place = MovingFrame(ZERO), Motion((reach, 0.0, 0.0))
    for step in range(300):
        before = frame.motion(place)
        frame = moved(frame, Asked(rate=rate if step < 150 else 0.0), LIMITS, DT, reach=reach)
        after = frame.motion(place)
        change = tuple(x / DT for x in sub(after.velocity, before.velocity))
        circling = LIMITS.speed**2 / reach
        assert norm(change) <= LIMITS.acceleration + circling + 1e-9
        assert after.acceleration == pytest.approx(change, abs=circling * 0.02 + 0.02)


@given(vectors, vectors, vectors)
def test_a_shift_starts_as_the_vehicle_moves_and_ends_in_place(
    position: Vec3, velocity: Vec3, place: Vec3
) -> None:
    shift = Shift(Motion(position, velocity), place, 4.0)
    start, end = shift.at(0.0), shift.at(shift.duration)
    assert start.position == pytest.approx(position, abs=1e-9)
    assert start.velocity == pytest.approx(velocity, abs=1e-9)
    assert end == Motion(place)


@settings(max_examples=8, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(st.lists(vectors, min_size=2, max_size=5))
def test_copies_of_a_frame_come_together(centres: list[Vec3]) -> None:
    copies = [MovingFrame(centre) for centre in centres]
    for _ in range(2000):
        mean = mean_frame(copies)
        copies = [moved(own, Asked(), LIMITS, DT, mean) for own in copies]
    middle = mean_frame(copies).centre
    assert all(dist(own.centre, middle) < 0.01 for own in copies)


@settings(max_examples=8, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(st.tuples(numbers, numbers, numbers), st.floats(-1.0, 1.0))
def test_no_place_leaves_the_room_however_it_is_pushed(asked: Vec3, rate: float) -> None:
    room = Box((-2.0, -2.0, 0.5), (2.0, 2.0, 2.0))
    places = ((0.8, 0.0, 0.0), (-0.4, 0.7, 0.0), (-0.4, -0.7, 0.3))
    frame, limits = MovingFrame((0.0, 0.0, 1.0)), LIMITS._replace(speed=1.0)
    for _ in range(600):
        offsets = [frame.turned(place) for place in places]
        near = [
            (offset, wall)
            for offset, place in zip(offsets, places, strict=True)
            for wall in walls(frame.motion(Motion(place)).position, room)
        ]
        before = frame
        frame = moved(frame, Asked(asked, rate), limits, DT, None, 0.81, near)
        assert norm(sub(frame.velocity, before.velocity)) <= 2.5 * DT + 1e-9
        outside = max(room.outside_by(frame.motion(Motion(p)).position) for p in places)
        assert outside < 0.03
