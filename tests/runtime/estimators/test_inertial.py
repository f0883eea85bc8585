"""The inertial estimator learns from the one flown on, goes on without it, and says how badly."""

from __future__ import annotations

import random
from math import cos, sin

import pytest

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    Quat,
    Vec3,
    add,
    conjugate,
    distance,
    from_euler,
    integrate,
    multiply,
    rotate,
)
from kybflow.core.signals import NS, Battery, Estimate, Imu, Pose
from kybflow.runtime.estimators.inertial import Inertial, InertialParams
from kybflow.world.vehicle_context import Airframe, VehicleContext

FRAME = Airframe(mass=1.0, diameter=0.5, inertia=(0.01, 0.01, 0.02), thrust=6.0, rotor_time=0.05)
PLACE = VehicleContext("a", FRAME, ZERO, 0.0, None, 0.004)
DT = 0.004
STEP = round(DT * NS)
NOISE, TURN_NOISE = 0.07, 0.0025
"""Of the average of two samples of the simulated IMU."""


class World:
    """A vehicle on a circle that rolls and pitches as it should, its IMU, and an estimate of it."""

    def __init__(self, seed: int = 0, bias: Vec3 = ZERO, turn_bias: Vec3 = ZERO) -> None:
        self._noise = random.Random(seed)
        self._bias, self._turn_bias = bias, turn_bias
        self.now = 0

    def _attitude(self, t: float) -> Quat:
        return from_euler(0.02 * sin(t), -0.05 * cos(t), 0.1 * t)

    def position(self) -> Vec3:
        t = self.now / NS
        return (0.5 * cos(t), 0.5 * sin(t), 1.0)

    def velocity(self) -> Vec3:
        t = self.now / NS
        return (-0.5 * sin(t), 0.5 * cos(t), 0.0)

    def imu(self) -> Imu:
        """What is felt over the next tick, which then is over."""
        t = (self.now + STEP // 2) / NS
        pull = (-0.5 * cos(t), -0.5 * sin(t), GRAVITY)
        before, after = self._attitude(t - DT / 2), self._attitude(t + DT / 2)
        _, x, y, z = multiply(conjugate(before), after)
        felt = rotate(conjugate(self._attitude(t)), pull)
        self.now += STEP
        return Imu(
            self.now,
            DT,
            add(add(felt, self._bias), self._vector(NOISE)),
            add(
                add((2 * x / DT, 2 * y / DT, 2 * z / DT), self._turn_bias), self._vector(TURN_NOISE)
            ),
        )

    def estimate(self, age: float = 0.01, spread: float = 0.001) -> Estimate:
        position = add(self.position(), self._vector(0.0005))
        attitude = self._attitude(self.now / NS)
        return Estimate(self.now, position, self.velocity(), attitude, ZERO, "mocap", age, spread)

    def _vector(self, deviation: float) -> Vec3:
        draw = self._noise.gauss
        return (draw(0.0, deviation), draw(0.0, deviation), draw(0.0, deviation))


def anchored(world: World, seconds: float) -> Inertial:
    """An estimator that has followed `world` for so long."""
    estimator = Inertial(InertialParams(), PLACE)
    for _ in range(round(seconds / DT)):
        estimator.update((world.imu(),), world.now)
        estimator.anchor(world.estimate())
    return estimator


def alone(estimator: Inertial, world: World, seconds: float) -> list[tuple[float, Estimate]]:
    """(metres off, estimate) of every tick without an anchor."""
    told = []
    for _ in range(round(seconds / DT)):
        estimate = estimator.update((world.imu(),), world.now)
        assert estimate is not None
        told.append((distance(estimate.position, world.position()), estimate))
    return told


BIASES = [
    pytest.param(ZERO, ZERO, id="none"),
    pytest.param((0.2, -0.1, 0.15), (0.01, -0.01, 0.005), id="biased"),
]


@pytest.mark.parametrize(("bias", "turn_bias"), BIASES)
@pytest.mark.parametrize("seed", range(3))
def test_two_seconds_alone_cost_less_than_a_decimetre_once_the_biases_are_learnt(
    seed, bias, turn_bias
):
    world = World(seed, bias, turn_bias)
    told = alone(anchored(world, 10.0), world, 2.0)
    assert max(off for off, _ in told) < 0.1
    assert all(off < 3.0 * estimate.spread for off, estimate in told)


def test_its_spread_grows_and_reaches_the_bound_that_missions_use():
    world = World()
    told = alone(anchored(world, 10.0), world, 5.0)
    spreads = [estimate.spread for _, estimate in told]
    assert spreads == sorted(spreads)
    assert spreads[0] < 0.002
    assert 2.0 < next(i for i, s in enumerate(spreads) if s > 0.3) * DT < 4.0


def test_before_anything_is_learnt_it_is_less_sure():
    new, old = World(), World()
    unsure = alone(anchored(new, 0.1), new, 1.0)[-1][1].spread
    assert unsure > 2.0 * alone(anchored(old, 10.0), old, 1.0)[-1][1].spread


def test_there_is_no_estimate_without_an_anchor():
    world, estimator = World(), Inertial(InertialParams(), PLACE)
    assert [estimator.update((world.imu(),), world.now) for _ in range(10)] == [None] * 10
    assert Inertial.needs == frozenset({Imu})


def test_an_estimate_that_is_stale_is_not_followed():
    world, estimator = World(), Inertial(InertialParams(fresh=0.05), PLACE)
    estimator.update((world.imu(),), world.now)
    estimator.anchor(world.estimate(age=0.06))
    assert estimator.update((world.imu(),), world.now) is None


def test_a_noisy_estimate_teaches_little():
    world = World(bias=(0.1, 0.1, 0.1))
    estimator = anchored(world, 10.0)
    for _ in range(round(1.0 / DT)):
        estimator.update((world.imu(),), world.now)
        jumping = world.estimate(spread=0.06)
        shift = (0.1, 0.0, 0.0) if (world.now // STEP) % 50 < 30 else ZERO
        estimator.anchor(jumping._replace(position=add(jumping.position, shift)))
    assert max(off for off, _ in alone(estimator, world, 1.0)) < 0.1


def test_after_half_a_second_alone_it_starts_from_the_next_estimate():
    world = World()
    estimator = anchored(world, 2.0)
    alone(estimator, world, 3.0)
    elsewhere = world.estimate()._replace(position=(1.0, 2.0, 3.0), velocity=ZERO)
    estimator.anchor(elsewhere)
    estimate = estimator.update((), world.now)
    assert estimate.position == (1.0, 2.0, 3.0)
    assert estimate.spread == pytest.approx(0.001, abs=0.001)


def test_it_starts_from_the_next_position_with_its_own_attitude():
    world = World()
    estimator = anchored(world, 2.0)
    alone(estimator, world, 1.0)
    estimator.anchor(world.estimate()._replace(attitude=from_euler(0.2, -0.2, 0.3)))
    assert max(off for off, _ in alone(estimator, world, 1.0)) < 0.2


def test_what_it_is_off_the_estimate_that_it_follows_counts_as_its_spread():
    world = World()
    estimator = anchored(world, 2.0)
    there = world.estimate(spread=0.03)
    x, y, z = there.position
    estimator.update((world.imu(),), world.now)
    estimator.anchor(world.estimate(spread=0.03)._replace(position=(x + 0.2, y, z)))
    assert estimator.update((), world.now).spread > 0.19


def test_a_jump_of_what_it_follows_is_no_speed():
    world = World()
    estimator = anchored(world, 5.0)
    for _ in range(30):
        estimator.update((world.imu(),), world.now)
        x, y, z = world.position()
        estimator.anchor(world.estimate()._replace(position=(x, y, z - 0.35)))
    slow = estimator.update((), world.now).velocity
    assert distance(slow, world.velocity()) < 0.05


def test_attitudes_that_shake_are_not_learnt():
    """Sparse ones with 30 mrad of noise: their tilt would be a push, their turns a bias."""
    shaken = random.Random(0)
    world = World()
    estimator = anchored(world, 5.0)
    for tick in range(500):
        estimator.update((world.imu(),), world.now)
        if tick % 15 == 0:
            seen = world.estimate(spread=0.012)
            turn = from_euler(*(shaken.gauss(0.0, 0.03) for _ in range(3)))
            estimator.anchor(seen._replace(attitude=multiply(seen.attitude, turn)))
    assert max(off for off, _ in alone(estimator, world, 2.5)) < 0.35


def test_an_imu_that_falls_silent_leaves_no_estimate():
    world = World()
    estimator = anchored(world, 1.0)
    last = world.now
    estimate = estimator.update((), last + NS // 20)
    assert estimate.age == pytest.approx(0.05)
    assert estimator.update((), last + NS // 5) is None
    world.now += NS // 5
    assert estimator.update((world.imu(),), world.now) is None


def test_poses_and_batteries_are_none_of_its_business():
    estimator = Inertial(InertialParams(), PLACE)
    assert estimator.update((Battery(0, 1.0, 16.0), Pose(0, ZERO, LEVEL)), 0) is None


def test_a_turn_is_followed_by_the_gyroscope_alone():
    estimator = Inertial(InertialParams(), PLACE)
    turn = (0.0, 0.0, 1.0)
    now, attitude = 0, LEVEL
    estimator.update((Imu(0, DT, (0.0, 0.0, GRAVITY), turn),), 0)
    estimator.anchor(Estimate(0, ZERO, ZERO, LEVEL, turn, "mocap", 0.0, 0.0))
    for _ in range(250):
        now += STEP
        attitude = integrate(attitude, turn, DT)
        estimate = estimator.update((Imu(now, DT, (0.0, 0.0, GRAVITY), turn),), now)
    assert estimate.attitude == pytest.approx(attitude)
    assert estimate.angular_velocity == turn
    assert estimate.position == pytest.approx(ZERO, abs=1e-9)
