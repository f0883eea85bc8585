"""The law by which vehicles move an object: on a bar that is a rigid body with dry friction, and
vehicles whose forces come late."""

from __future__ import annotations

from collections import deque
from math import copysign, radians

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kybflow.flight.manipulation.object_law import Aim, ObjectLaw, Pusher
from kybflow.world.freedoms import Freedom

DT, LATE_S = 0.008, 0.25
TURN = Freedom("bar", "yaw", (0.0, 0.0, 1.0), True, 0.07, 0.01)
SLIDE = Freedom("car", "position", (1.0, 0.0, 0.0), False, 1.5, 0.4)
PUSHERS = {"left": Pusher((-0.45, 1.0), 0.42, 0.9), "right": Pusher((0.45, 1.0), 0.42, 0.9)}


class Bar:
    """A bar on a car. friction: that of the rail, N."""

    def __init__(self, yaw: float, friction: float = 0.4) -> None:
        self.yaw, self.car, self.turning, self.speed = yaw, 0.0, 0.0, 0.0
        self._friction = friction
        self._late = deque([(0.1, 0.1)] * round(LATE_S / DT))
        self.modes: list[str] = []
        self.crept = 0.0

    def fly(self, law: ObjectLaw, seconds: float, goal: float | None = 1.0) -> None:
        for _ in range(round(seconds / DT)):
            error = None if goal is None else goal - self.car
            aims = (
                Aim(TURN, -self.yaw, self.turning, radians(3.0), 0.2),
                Aim(SLIDE, error, self.speed, 0.02, 0.12),
            )
            out = law.update(aims, PUSHERS, DT)
            if not self.modes or self.modes[-1] != out.mode:
                self.modes.append(out.mode)
            self._late.append((out.forces["left"], out.forces["right"]))
            self._move(*self._late.popleft())
            if out.mode != "push":
                self.crept += self.speed * DT

    def _move(self, left: float, right: float) -> None:
        def after(rate: float, force: float, inertia: float, friction: float) -> float:
            rate += force / inertia * DT
            return copysign(max(0.0, abs(rate) - friction / inertia * DT), rate)

        self.turning = after(self.turning, 0.45 * (right - left), 0.24, 0.01)
        self.speed = after(self.speed, left + right, 2.3, self._friction)
        self.yaw += self.turning * DT
        self.car += self.speed * DT


@pytest.mark.parametrize("yaw", [-25.0, 20.0])
def test_it_aligns_then_pushes_then_holds(yaw: float) -> None:
    bar, law = Bar(radians(yaw)), ObjectLaw(0.1)
    bar.fly(law, 60.0)
    assert bar.modes == ["align", "push", "hold"]
    assert bar.car == pytest.approx(1.0, abs=0.03)
    assert abs(bar.yaw) < radians(3.0)
    assert bar.crept < 0.02


def test_a_rail_rougher_than_declared_is_overcome() -> None:
    bar, law = Bar(0.0, friction=0.6), ObjectLaw(0.1)
    bar.fly(law, 60.0)
    assert bar.car == pytest.approx(1.0, abs=0.03)


def test_an_object_beyond_its_goal_is_told_and_not_pushed_on() -> None:
    bar, law = Bar(0.0), ObjectLaw(0.1)
    bar.car = 1.1
    bar.fly(law, 5.0)
    aims = (Aim(TURN, 0.0, 0.0, 0.05, 0.2), Aim(SLIDE, 1.0 - bar.car, 0.0, 0.02, 0.12))
    out = law.update(aims, PUSHERS, DT)
    assert out.mode == "hold"
    assert "`car.position` needs more than 0.4 N towards its goal" in out.short
    assert bar.car == pytest.approx(1.1, abs=0.01)


def test_without_a_goal_for_its_slide_the_object_stays() -> None:
    bar, law = Bar(radians(20.0)), ObjectLaw(0.1)
    bar.fly(law, 20.0, goal=None)
    assert bar.modes == ["align", "hold"]
    assert abs(bar.car) < 0.02


@settings(max_examples=50, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(-3.0, 3.0), st.floats(-2.0, 2.0), st.floats(-5.0, 5.0)),
        min_size=1, max_size=20,
    )
)  # fmt: skip
def test_forces_only_push_and_stay_within_the_tilt(seen: list[tuple[float, float, float]]) -> None:
    law = ObjectLaw(0.1)
    for yaw, rate, car in seen:
        aims = (Aim(TURN, yaw, rate, 0.05, 0.2), Aim(SLIDE, car, rate, 0.02, 0.12))
        forces = law.update(aims, PUSHERS, 0.1).forces
        assert all(0.0 <= force <= 0.9 + 1e-9 for force in forces.values())
        if law.mode != "push":
            assert sum(forces.values()) <= 0.4
