"""A force against a surface is no motion: processors bend the motion and leave the force alone."""

from __future__ import annotations

from typing import Any

import pytest
from part_bench import DT, SITE, estimate, tick
from plans import part, plan, state, vehicle

from kybflow.core.geometry import Vec3
from kybflow.core.signals import NS, Setpoint, SetpointKind
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.control import Control

FORWARD: Vec3 = (1.0, 0.0, 0.0)
PUSH = 0.7


class Unheard:
    """Hears of alarms and clamps."""

    def alarm(self, *_: Any) -> bool:
        return False

    def clamped(self, _: str) -> None:
        pass


def followed(speeds: list[float], *processors: Any) -> list[Setpoint]:
    """What the tracker follows while a vehicle in mid air, whose surface moves with these speeds,
    presses with `PUSH`."""
    hover = state("hover", part("behaviors", "hover"))
    made = plan(vehicle("nano", [hover], processors=processors)).vehicles[0]
    params = {one.label: one.params for one in (*made.processors, made.tracker)}
    control = Control(made, SITE, params, lambda *_: None, Events())
    control.select(frozenset(), in_air=True)
    given, last = list[Setpoint](), None
    for i, speed in enumerate(speeds):
        velocity = (speed, 0.0, 0.0)
        asked = Setpoint(
            SetpointKind.VELOCITY, None, velocity, (PUSH, 0.0, 0.0), heading=0.0, presses=FORWARD
        )
        now = tick(i * DT, estimate((0.0, 0.0, 1.0), velocity, now=round(i * DT * NS)), last)
        control.follow(asked, now, Unheard(), off_ground=True)
        last = control.followed
        assert last is not None
        given.append(last)
    return given


@pytest.mark.parametrize("name", ["limit_speed", "limit_acceleration", "fence", "obstacle_guard"])
def test_it_presses_with_the_same_force_after_the_surface_has_jumped(name: str) -> None:
    last = followed([0.4] * 20 + [0.1] * 150, part("processors", name))[-1]
    assert last.velocity == pytest.approx((0.1, 0.0, 0.0), abs=1e-3)
    assert last.acceleration == pytest.approx((PUSH, 0.0, 0.0), abs=5e-3)


def test_it_no_longer_presses_where_a_processor_holds_it_back() -> None:
    [*_, last] = followed([0.6] * 200, part("processors", "limit_speed", speed=0.2))
    assert last.velocity == pytest.approx((0.2, 0.0, 0.0), abs=1e-3)
    assert last.acceleration == pytest.approx((0.0, 0.0, 0.0), abs=5e-3)
