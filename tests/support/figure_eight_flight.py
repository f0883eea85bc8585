"""A vehicle that rests for a second, then flies a figure eight and turns its nose: its truth, and
what a noisy IMU and measurements from outside tell of it. The simulator's noises."""

from __future__ import annotations

import functools
import random
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import inf, radians, sin
from typing import Any, NamedTuple

from kybflow.core.geometry import (
    GRAVITY,
    ZERO,
    Quat,
    Vec3,
    add,
    conjugate,
    from_thrust_direction,
    integrate,
    multiply,
    rotate,
)
from kybflow.core.signals import NS, Estimate, Imu, Measurement, Pose, Position, Time
from kybflow.runtime.estimators.fusion import Fusion, FusionParams
from kybflow.world.vehicle_context import Airframe, VehicleContext

FRAME = Airframe(mass=1.0, diameter=0.5, inertia=(0.01, 0.01, 0.02), thrust=6.0, rotor_time=0.05)
SITE = VehicleContext("a", FRAME, ZERO, 0.0, None, 0.004)
TICK = NS // 250
DT = TICK / NS
FORCE_NOISE, TURN_NOISE = 0.005 / DT**0.5, radians(0.01) / DT**0.5
FORCE_BIAS, TURN_BIAS = 0.05, radians(0.2)
REST = 1.0
SPAN = 1.5


class Instant(NamedTuple):
    """The truth at a tick, and what an IMU without errors felt since the last one."""

    time: Time
    position: Vec3
    velocity: Vec3
    attitude: Quat
    force: Vec3
    turn: Vec3


def where(t: float) -> Vec3:
    s = max(t - REST, 0.0)
    phase = 1.2 * s**3 / (s * s + 2.0)
    return (SPAN * sin(phase), 0.5 * SPAN * sin(2.0 * phase), 0.3 * sin(0.5 * phase))


def velocity(t: float, h: float = 1e-4) -> Vec3:
    return _slope(where(t - h), where(t + h), h)


def attitude(t: float) -> Quat:
    h = 1e-3
    ax, ay, az = _slope(velocity(t - h), velocity(t + h), h)
    s = max(t - REST, 0.0)
    return from_thrust_direction((ax, ay, az + GRAVITY), 0.8 * (s**3 / (s * s + 2.0)))


def _slope(a: Vec3, b: Vec3, h: float) -> Vec3:
    return tuple((y - x) / (2.0 * h) for x, y in zip(a, b, strict=True))  # type: ignore[return-value]


@functools.cache
def figure(seconds: float) -> tuple[Instant, ...]:
    """The flight from its second tick on."""
    instants = []
    before, speed = attitude(0.0), velocity(0.0)
    for i in range(1, round(seconds / DT) + 1):
        t = i * DT
        now, faster = attitude(t), velocity(t)
        w, x, y, z = multiply(conjugate(before), now)
        two = (2.0 if w > 0.0 else -2.0) / DT
        turn = (two * x, two * y, two * z)
        ax, ay, az = ((b - a) / DT for a, b in zip(speed, faster, strict=True))
        force = rotate(conjugate(attitude(t - 0.5 * DT)), (ax, ay, az + GRAVITY))
        instants.append(Instant(i * TICK, where(t), faster, now, force, turn))
        before, speed = now, faster
    return tuple(instants)


@dataclass
class World:
    """Measurements of one flight of the figure. rate, latency, noise: of what comes from outside;
    `turned`: the noise of an attitude, None where only positions come."""

    seed: int = 0
    seconds: float = 12.0
    rate: float = 8.0
    latency: float = 0.12
    noise: float = 0.02
    turned: float | None = radians(1.0)

    def __post_init__(self) -> None:
        self.generator = random.Random(self.seed)
        self.force_bias = self.vector(FORCE_BIAS)
        self.turn_bias = self.vector(TURN_BIAS)

    def vector(self, deviation: float) -> Vec3:
        draw = self.generator.gauss
        return (draw(0.0, deviation), draw(0.0, deviation), draw(0.0, deviation))

    def imu(self, instant: Instant) -> Imu:
        force = add(add(instant.force, self.force_bias), self.vector(FORCE_NOISE))
        turn = add(add(instant.turn, self.turn_bias), self.vector(TURN_NOISE))
        return Imu(instant.time, DT, force, turn)

    def seen(self, time: Time) -> Measurement:
        t = time / NS
        position = add(where(t), self.vector(self.noise))
        if self.turned is None:
            return Position(time, position, (self.noise,) * 3)
        return Pose(time, position, integrate(attitude(t), self.vector(self.turned), 1.0))

    def flight(self) -> Iterator[tuple[Instant, list[Measurement]]]:
        """The ticks, with what arrives in them."""
        late = round(self.latency * NS)
        due = taken = 1
        for instant in figure(self.seconds):
            arriving: list[Measurement] = []
            due = round(taken * NS / self.rate) + 1_000_003
            while due + late <= instant.time:
                arriving.append(self.seen(due))
                taken += 1
                due = round(taken * NS / self.rate) + 1_000_003
            yield instant, [*arriving, self.imu(instant)]


POSES = {"position_noise": 0.02, "attitude_noise": radians(1.0)}
STEADY = {"accelerometer_drift": 0.0, "gyro_drift": 0.0}
SKY = {"rate": 5.0, "latency": 0.1, "noise": 0.3, "turned": None}
Ticks = Iterable[tuple[Instant, Sequence[Measurement]]]


def fusion(**params: Any) -> Fusion:
    return Fusion(FusionParams(**{**POSES, **STEADY, **params}), SITE)


class Moment(NamedTuple):
    truth: Instant
    estimate: Estimate | None


def moments(part: Fusion, ticks: Ticks) -> Iterator[Moment]:
    for truth, arriving in ticks:
        yield Moment(truth, part.update(arriving, truth.time))


def last(part: Fusion, ticks: Ticks) -> Estimate:
    *_, moment = moments(part, ticks)
    assert moment.estimate is not None
    return moment.estimate


def bent(
    world: World, offset: Vec3, since: float, until: float = inf
) -> Iterator[tuple[Instant, list[Measurement]]]:
    """The flight with poses off by `offset` for a time."""
    for truth, arriving in world.flight():
        for i, m in enumerate(arriving):
            if isinstance(m, Pose) and since <= m.time / NS < until:
                arriving[i] = m._replace(position=add(m.position, offset))
        yield truth, arriving
