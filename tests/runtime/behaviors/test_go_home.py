"""go_home: up to a safe height, level above home, done there or when its patience is over."""

import pytest
from part_bench import SITE, entry, fly, ideal, worst_mismatch

from kybflow.core.errors import Refused
from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import Done
from kybflow.parts import MOVING
from kybflow.runtime.behaviors.go_home import GoHome, GoHomeParams
from kybflow.world.shapes import Box
from kybflow.world.vehicle_context import VehicleContext


def flight_home(where: Vec3, velocity: Vec3 = ZERO, context: VehicleContext = SITE, **more: object):
    behavior = GoHome(GoHomeParams(**more), entry(where, velocity, context=context))
    return fly(behavior, ideal(where, velocity))


def test_low_it_climbs_first_and_then_flies_level() -> None:
    samples = flight_home((1.0, 0.5, 0.3)).samples
    low = [s.setpoint.position for s in samples if s.setpoint.position[2] < 0.999]
    assert low
    assert all((x, y) == (1.0, 0.5) for x, y, _ in low)
    assert samples[-1].setpoint.position == (0.0, 0.0, 1.0)


def test_high_it_keeps_its_height_but_stays_below_the_fences_top() -> None:
    assert {s.setpoint.position[2] for s in flight_home((1.0, 0.0, 1.6)).samples} == {1.6}
    low = SITE._replace(fence=Box((-3.0, -3.0, 0.0), (3.0, 3.0, 1.1)))
    assert flight_home((1.0, 0.0, 0.3), context=low).samples[-1].setpoint.position[
        2
    ] == pytest.approx(0.8)


def test_home_may_be_elsewhere() -> None:
    end = flight_home((1.0, 0.0, 1.2), context=SITE._replace(home=(-1.0, 0.5, 0.0)))
    assert isinstance(end.end, Done)
    assert end.samples[-1].setpoint.position == (-1.0, 0.5, 1.2)


def test_the_setpoint_is_smooth_whatever_it_was_doing() -> None:
    samples = flight_home((1.0, 0.0, 0.4), (0.6, -0.3, 0.2)).samples
    assert worst_mismatch(samples, "position", "velocity") < 3e-3
    assert worst_mismatch(samples, "velocity", "acceleration") < 0.1


def test_it_is_done_after_its_patience_where_the_vehicle_does_not_follow() -> None:
    behavior = GoHome(GoHomeParams(patience=1.0), entry((1.0, 0.0, 1.0), flight=MOVING))
    stuck = fly(behavior, lambda setpoint: ((1.0, 0.0, 1.0), ZERO))
    assert isinstance(stuck.end, Done)


def test_it_refuses_when_an_obstacle_is_in_the_way() -> None:
    wall = SITE._replace(obstacles={"wall": Box((0.4, -1.0, 0.0), (0.5, 1.0, 2.0))})
    with pytest.raises(Refused, match="the obstacle `wall` is in the way home"):
        flight_home((1.0, 0.0, 1.0), context=wall)
    assert isinstance(flight_home((1.0, 2.0, 1.0), context=SITE).end, Done)
