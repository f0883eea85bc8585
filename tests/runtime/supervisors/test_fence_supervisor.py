"""fence (supervisor): heard outside, in the air, with hysteresis."""

import pytest
from part_bench import FENCE, SITE, estimate, tick

from kybflow.core.geometry import Vec3
from kybflow.core.signals import Alarm, Reaction, Setpoint, SetpointKind
from kybflow.runtime.supervisors.fence import FenceSupervisor, FenceSupervisorParams
from kybflow.world.shapes import Box


def fence(**more: object) -> FenceSupervisor:
    return FenceSupervisor(FenceSupervisorParams(**more), SITE)


def at(*position: float):
    return tick(known=estimate(position))


def test_outside_by_more_than_the_margin_it_asks_to_land() -> None:
    expected = Alarm(
        "fence_breached", Reaction.LAND, "0.50 m beyond the fence, 0.1 m allowed", 0.5, 0.1
    )
    assert expected == fence().check(at(3.5, 0.0, 1.0), off_ground=True)


@pytest.mark.parametrize("position", [(3.05, 0.0, 1.0), (0.0, 0.0, 2.55), (0.0, 0.0, -0.05)])
def test_within_the_margin_it_is_silent(position: Vec3) -> None:
    assert fence().check(at(*position), off_ground=True) is None


def test_an_alarm_lasts_until_the_vehicle_is_well_inside_again() -> None:
    supervisor = fence()
    heard = [
        supervisor.check(at(east, 0.0, 1.0), off_ground=True) is not None
        for east in (3.05, 3.2, 3.05, 2.97, 2.9, 3.05)
    ]
    assert heard == [False, True, True, True, False, False]


def test_on_the_ground_and_without_an_estimate_there_is_nothing_to_report() -> None:
    assert fence().check(at(9.0, 0.0, 0.0), off_ground=False) is None
    assert fence().check(tick(), off_ground=True) is None


def test_take_off_and_landing_cross_a_floor_above_the_ground() -> None:
    high = SITE._replace(fence=Box((-3.0, -3.0, 0.8), FENCE.high))
    assert (
        FenceSupervisor(FenceSupervisorParams(), high).check(at(0.0, 0.0, 0.05), off_ground=True)
        is None
    )


def judged(position: Vec3, setpoint: Setpoint | None) -> bool:
    """Whether a vehicle there is outside, at the second look too."""
    supervisor, seen = fence(), tick(known=estimate(position))._replace(setpoint=setpoint)
    return [supervisor.check(seen, off_ground=True) is not None for _ in range(2)] == [True, True]


LANDING = Setpoint(SetpointKind.POSITION, (0.0, 0.0, -0.45), (0.0, 0.0, -0.2))
SINKING = Setpoint(SetpointKind.VELOCITY, velocity=(0.0, 0.0, -0.2))
ABOVE = Setpoint(SetpointKind.POSITION, (0.0, 0.0, 0.3), (0.0, 0.0, -0.2))
CLIMBING = Setpoint(SetpointKind.VELOCITY, velocity=(0.0, 0.0, 0.2))


@pytest.mark.parametrize("setpoint", [LANDING, SINKING, None])
def test_a_landing_on_lower_ground_is_no_breach(setpoint: Setpoint | None) -> None:
    assert not judged((0.0, 0.0, -0.2), setpoint)
    assert judged((3.5, 0.0, -0.2), setpoint)


@pytest.mark.parametrize("setpoint", [ABOVE, CLIMBING])
def test_below_the_floor_without_being_made_to_land_is_a_breach(setpoint: Setpoint) -> None:
    assert judged((0.0, 0.0, -0.2), setpoint)


def test_without_a_fence_it_is_silent() -> None:
    free = FenceSupervisor(FenceSupervisorParams(), SITE._replace(fence=None))
    assert free.check(at(99.0, 0.0, 1.0), off_ground=True) is None


def test_its_reaction_can_be_chosen() -> None:
    alarm = fence(reaction="brake").check(at(9.0, 0.0, 1.0), off_ground=True)
    assert alarm.reaction is Reaction.BRAKE
