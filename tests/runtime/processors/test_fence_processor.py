"""fence (processor): the setpoint stays inside, whatever it was; take-off and landing pass."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from part_bench import DT, FENCE, SITE, at_rest, entry, estimate, fly, point_mass, tick

from kybflow.core.geometry import ZERO, Vec3, add, scale
from kybflow.core.signals import Done, Setpoint, SetpointKind
from kybflow.runtime.behaviors.land import Land, LandParams
from kybflow.runtime.processors.fence import FenceProcessor, FenceProcessorParams
from kybflow.world.shapes import Box

numbers = st.floats(-50.0, 50.0)
MIDDLE = estimate((0.0, 0.0, 1.0))
INSIDE = Box((-2.8, -2.8, 0.0), (2.8, 2.8, 2.3))


def fence(margin: float = 0.2) -> FenceProcessor:
    return FenceProcessor(FenceProcessorParams(margin=margin), SITE)


def settled(processor: FenceProcessor, asked: Setpoint, last: Setpoint) -> Setpoint:
    """The setpoint after 4 s in which the same is asked."""
    for i in range(1000):
        last = processor(asked, tick((i + 1) * DT, MIDDLE, last))
    return last


@given(st.tuples(numbers, numbers, numbers), st.tuples(numbers, numbers, numbers))
def test_whatever_is_asked_what_comes_out_is_inside(position: Vec3, velocity: Vec3) -> None:
    processor, bent = fence(), None
    for i in range(3):
        bent = processor(at_rest(position, velocity), tick((i + 1) * DT, MIDDLE, bent))
        assert INSIDE.grown((1e-9, 1e-9, 1e-9)).contains(bent.position)


@given(st.tuples(numbers, numbers, numbers))
def test_what_rests_inside_passes(position: Vec3) -> None:
    asked = at_rest(position)
    assert (fence()(asked, tick(known=MIDDLE)) is asked) == INSIDE.contains(position)


def test_outside_it_goes_to_the_nearest_point() -> None:
    bent = settled(fence(), at_rest((4.0, 1.0, 1.0)), at_rest((2.0, 0.5, 1.0)))
    assert bent.position == pytest.approx((2.8, 1.0, 1.0), abs=1e-3)
    assert bent.velocity == pytest.approx(ZERO, abs=1e-3)


def test_what_comes_back_is_followed_again() -> None:
    processor, last = fence(), at_rest((2.0, 0.0, 1.0))
    last = settled(processor, at_rest((4.0, 0.0, 1.0)), last)
    back = at_rest((2.0, 0.0, 1.0))
    for i in range(1000, 2500):
        last = processor(back, tick((i + 1) * DT, MIDDLE, last))
    assert last is back


def test_a_margin_without_room_leaves_the_middle() -> None:
    bent = settled(fence(margin=9.0), at_rest((2.0, 2.0, 2.0)), at_rest((0.0, 1.0, 1.0)))
    assert bent.position[:2] == pytest.approx((0.0, 0.0), abs=1e-3)
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


@pytest.mark.parametrize("east", [0.0, 2.0, 2.7])
def test_a_velocity_stops_before_the_face(east: float) -> None:
    """Of a vehicle that follows at once."""
    asked = Setpoint(SetpointKind.VELOCITY, None, (1.0, 0.2, 0.0), ZERO, ZERO)
    processor, place, last = fence(), (east, 0.0, 1.0), asked._replace(velocity=ZERO)
    for i in range(1500):
        known = estimate(place, last.velocity)
        last = processor(asked, tick((i + 1) * DT, known, last))
        place = add(place, scale(last.velocity, DT))
        assert place[0] < 2.8 + 1e-3
    assert place[0] > 2.75
    assert last.velocity[0] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("kind", [SetpointKind.POSITION, SetpointKind.VELOCITY])
def test_beyond_the_face_it_leads_back_slowly(kind: SetpointKind) -> None:
    """As when an option moves the face."""
    places = kind is SetpointKind.POSITION
    place = (2.9, 0.0, 1.0)
    asked = Setpoint(kind, place if places else None, ZERO, ZERO, ZERO, 0.0)
    processor, last = fence(), asked
    for i in range(1000):
        last = processor(asked, tick((i + 1) * DT, estimate(place, last.velocity), last))
        assert -0.31 < last.velocity[0] < 1e-3
        place = last.position or add(place, scale(last.velocity, DT))
    assert place[0] == pytest.approx(2.8, abs=5e-3)


def test_along_a_face_it_may_go_as_it_likes() -> None:
    along = Setpoint(SetpointKind.VELOCITY, None, (0.0, 0.7, 0.0), ZERO)
    assert fence()(along, tick(known=estimate((2.79, 0.0, 1.0)))) is along
