"""fence (processor): the setpoint stays inside, whatever it was; take-off and landing pass."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from part_bench import FENCE, SITE, at_rest, entry, estimate, fly, point_mass, tick

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import Done, Setpoint, SetpointKind
from kybflow.runtime.behaviors.land import Land, LandParams
from kybflow.runtime.processors.fence import FenceProcessor, FenceProcessorParams
from kybflow.world.shapes import Box

numbers = st.floats(-50.0, 50.0)
MIDDLE = estimate((0.0, 0.0, 1.0))
INSIDE = Box((-2.8, -2.8, 0.0), (2.8, 2.8, 2.3))


def fence(margin: float = 0.2) -> FenceProcessor:
    return FenceProcessor(FenceProcessorParams(margin=margin), SITE)


@given(st.tuples(numbers, numbers, numbers), st.tuples(numbers, numbers, numbers))
def test_whatever_is_asked_what_comes_out_is_inside(position: Vec3, velocity: Vec3) -> None:
    asked = at_rest(position, velocity)
    bent = fence()(asked, tick(known=MIDDLE))
    assert INSIDE.contains(bent.position)
    assert (bent is asked) == INSIDE.contains(position)


def test_outside_it_goes_to_the_nearest_point_and_no_further_out() -> None:
    asked = at_rest((4.0, 1.0, 1.0), (1.0, 0.5, 0.0))._replace(acceleration=(2.0, 1.0, 0.0))
    bent = fence()(asked, tick(known=MIDDLE))
    assert bent.position == pytest.approx((2.8, 1.0, 1.0))
    assert bent.velocity == (0.0, 0.5, 0.0)
    assert bent.acceleration == (0.0, 1.0, 0.0)


def test_outside_it_may_come_back() -> None:
    back = fence()(at_rest((4.0, 0.0, 1.0), (-1.0, 0.0, 0.0)), tick(known=MIDDLE))
    assert back.velocity == (-1.0, 0.0, 0.0)


def test_a_margin_without_room_leaves_the_middle() -> None:
    bent = fence(margin=9.0)(at_rest((2.0, 2.0, 2.0)), tick(known=MIDDLE))
    assert bent.position[:2] == (0.0, 0.0)
    assert bent.position[2] <= FENCE.high[2]


@pytest.mark.parametrize("floor", [0.0, 0.8])
def test_its_floor_stops_no_landing_and_no_take_off(floor: float) -> None:
    context = SITE._replace(fence=Box((-3.0, -3.0, floor), FENCE.high))
    processor = FenceProcessor(FenceProcessorParams(), context)
    start = (0.0, 0.0, 1.5)
    body = point_mass(start, ground=-0.5)

    def bent(setpoint: Setpoint | None):
        known = body(None)[0]
        if setpoint is None or setpoint.position is None:
            return body(setpoint)
        out = processor(setpoint, tick(known=estimate(known)))
        assert out is setpoint
        return body(out)

    assert isinstance(fly(Land(LandParams(), entry(start)), bent).end, Done)
    ground = at_rest((0.0, 0.0, 0.02))
    assert processor(ground, tick(known=estimate(ZERO))) is ground


def test_below_the_floor_it_is_bound_to_the_vehicle() -> None:
    bent = fence()(at_rest((0.0, 0.0, -5.0), (0.0, 0.0, -1.0)), tick(known=estimate(ZERO)))
    assert bent.position == (0.0, 0.0, -0.5)
    assert bent.velocity == ZERO


def test_without_a_fence_everything_passes() -> None:
    far = at_rest((99.0, 0.0, 1.0))
    assert (
        FenceProcessor(FenceProcessorParams(), SITE._replace(fence=None))(far, tick(known=MIDDLE))
        is far
    )


def push(east: float, known_speed: float = 0.0) -> Setpoint:
    """What is left of 1 m/s to the east there."""
    asked = Setpoint(SetpointKind.VELOCITY, None, (1.0, 0.2, 0.0), (0.5, 0.1, 0.0), ZERO)
    return fence()(asked, tick(known=estimate((east, 0.0, 1.0), (known_speed, 0.0, 0.0))))


@pytest.mark.parametrize(
    ("east", "allowed"),
    [(0.0, 1.0), (2.5, 0.6892), (2.7, 0.2), (2.8, 0.0), (2.85, -0.1), (5, -0.3)],
)
def test_a_velocity_is_cut_to_what_still_stops_in_time(east: float, allowed: float) -> None:
    assert push(east).velocity == pytest.approx((allowed, 0.2, 0.0), abs=1e-4)


def test_the_braking_that_a_cut_velocity_takes_is_fed_forward() -> None:
    assert push(0.0, 1.0).acceleration == (0.5, 0.1, 0.0)
    cut = push(2.5).velocity[0]
    assert push(2.5, cut).acceleration == pytest.approx((-1.0, 0.1, 0.0))
    assert push(2.7, 0.2).acceleration[0] == pytest.approx(-0.4)
    assert push(2.8, 0.0).acceleration[0] == 0.0


def test_along_a_face_it_may_go_as_it_likes() -> None:
    along = Setpoint(SetpointKind.VELOCITY, None, (0.0, 0.7, 0.0), ZERO)
    assert fence()(along, tick(known=estimate((2.79, 0.0, 1.0)))) is along
