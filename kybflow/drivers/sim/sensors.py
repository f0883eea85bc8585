"""Sensors of a simulated vehicle: IMU errors, motion capture, positions and battery.

Each sensor has its own schedule in integer nanoseconds. Random numbers come from seeded NumPy
generators in blocks.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from itertools import chain, repeat
from math import exp, sqrt
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy

from kybflow.core.geometry import GRAVITY, LEVEL, Quat, Vec3, integrate, multiply
from kybflow.core.signals import NS, Battery, Imu, Pose, Position, Time, Truth
from kybflow.drivers.sim.steps.onboard import Numbers
from kybflow.world.vehicle_context import Airframe, BatteryCharge

Array = numpy.ndarray[Any, numpy.dtype[numpy.float64]]

BLOCK_SAMPLES = 500
NOTHING: Numbers = (0.0,) * 6
VIBRATION_STEPS = 16
"""Number of steps for which vibration is computed at once."""
SLOW_VARIANCE, SLOW_TIME_S = 0.5, 30.0
"""Fraction of a position's variance that changes slowly, and the time constant of that part, s."""


def draw(
    generator: numpy.random.Generator, offsets: list[float], deviations: list[float]
) -> Iterator[list[float]]:
    """Yield rows of normally distributed numbers endlessly. offsets, deviations: mean and standard
    deviation of each column."""
    blocks = draw_blocks(generator, offsets, deviations)
    return chain.from_iterable(block.tolist() for block in blocks)


def draw_blocks(
    generator: numpy.random.Generator, offsets: list[float], deviations: list[float]
) -> Iterator[Array]:
    """Yield blocks of `BLOCK_SAMPLES` rows of normally distributed numbers, as `draw` does row by
    row."""
    while True:
        block = generator.standard_normal((BLOCK_SAMPLES, len(offsets)))
        block *= deviations
        block += offsets
        yield block


def vibrations(generator: numpy.random.Generator, deviations: list[float]) -> Iterator[Array]:
    """Yield blocks of noise without low frequencies: differences of white noise, with these
    standard deviations. The integral of this noise stays bounded, like that of rotors' vibration at
    tens of hertz."""
    count = len(deviations)
    last = numpy.zeros((1, count))
    for block in draw_blocks(generator, [0.0] * count, [d / sqrt(2.0) for d in deviations]):
        yield numpy.diff(block, axis=0, prepend=last)
        last = block[-1:]


def imu_sample(
    rotation: Numbers, velocity: Numbers, acceleration: Numbers, errors: Numbers
) -> Numbers:
    """Return the turn rate and specific force, body axes, that an IMU at the body's origin measures
    in a physics step, with errors. rotation: body to world, row by row. velocity, acceleration:
    those of the free joint. All arguments apply before the step."""
    _, _, _, gx, gy, gz = velocity
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation
    ax, ay, az = acceleration
    ex, ey, ez, fx, fy, fz = errors
    az += GRAVITY
    return (
        gx + ex,
        gy + ey,
        gz + ez,
        r00 * ax + r10 * ay + r20 * az + fx,
        r01 * ax + r11 * ay + r21 * az + fy,
        r02 * ax + r12 * ay + r22 * az + fz,
    )


class ImuSource(NamedTuple):
    """The errors of a vehicle's IMU (turn rate and specific force, body axes) in blocks of steps.
    errors: with stopped rotors. vibration: the additional errors in hover; None without
    vibration."""

    errors: Iterator[Array]
    vibration: Iterator[Array] | None


class ImuErrors:
    """The errors of all IMUs, step by step. block: the errors of coming steps, by step and vehicle,
    with vibration included up to the step `_ready`. form: makes a block from an array of steps,
    vehicles and values."""

    def __init__(self, sources: Sequence[ImuSource], form: Callable[[Array], Any]) -> None:
        still = repeat(numpy.zeros((BLOCK_SAMPLES, 6)))
        self._errors = [source.errors for source in sources]
        self._vibrations = [source.vibration or still for source in sources]
        self._form = form
        self._shakes = any(source.vibration is not None for source in sources)
        self._biases, self._levels = numpy.zeros((len(sources), 6)), numpy.zeros((len(sources), 1))
        self._drawn = self._shaking = numpy.zeros((0, len(sources), 6))
        self.block, self._next, self._ready = form(self._drawn), 0, 0

    def shake(self, vehicle: int, level: float) -> None:
        """From now on scale a vehicle's vibration to `level` times that in hover."""
        self._levels[vehicle] = level
        self._ready = self._next

    def bias(self, vehicle: int, more: Sequence[float]) -> None:
        """From now on add this bias to a vehicle's errors, in place of an earlier one."""
        self._biases[vehicle] = more
        self.block, self._ready = self._form(self._drawn + self._biases), self._next

    def take(self, steps: int) -> int:
        """Reserve the errors of the next `steps` steps, and return the index in `block` at which
        they begin."""
        first = self._next
        while first + steps > len(self.block):
            self._drawn = _followed(self._drawn[first:], self._errors)
            self._shaking, first = _followed(self._shaking[first:], self._vibrations), 0
            self.block, self._ready = self._form(self._drawn + self._biases), 0
        self._next = last = first + steps
        if self._shakes and last > self._ready:
            self._ready = first + max(steps, VIBRATION_STEPS)
            coming = slice(first, self._ready)
            still = self._drawn[coming] + self._biases
            self.block[coming] = self._form(still + self._levels * self._shaking[coming])
        return first


def _followed(rows: Array, sources: Sequence[Iterator[Array]]) -> Array:
    """Return the rows with the next block of each source appended."""
    return numpy.concatenate((rows, numpy.stack([next(source) for source in sources], axis=1)))


class Averages:
    """The average of a vehicle's IMU samples since the last measurement."""

    def __init__(self) -> None:
        self._sums: Numbers = NOTHING
        self._count = 0

    def add(self, sample: Numbers) -> None:
        (gx, gy, gz, ax, ay, az), (hx, hy, hz, bx, by, bz) = self._sums, sample
        self._sums = (gx + hx, gy + hy, gz + hz, ax + bx, ay + by, az + bz)
        self._count += 1

    def measure(self, now: Time, dt: float) -> Imu | None:
        """Return the average of the samples since the last call; None if there are none. now: time
        of the last sample. dt: duration of a sample, seconds."""
        count = self._count
        if not count:
            return None
        (gx, gy, gz, ax, ay, az), self._sums, self._count = self._sums, NOTHING, 0
        force = (ax / count, ay / count, az / count)
        return Imu(now, count * dt, force, (gx / count, gy / count, gz / count))


class Schedule:
    """The due times of a stream: integer nanoseconds from zero on, at a rate in hertz."""

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._count = 0
        self.due: Time = 0

    def move_on(self) -> None:
        self._count += 1
        self.due = round(self._count * NS / self.rate)


class Stamps:
    """The time stamps of poses, which are off by `error` seconds plus noise with the standard
    deviation `jitter`. A share `lost` of the poses never arrives."""

    def __init__(
        self, error: float, jitter: float, lost: float, generator: numpy.random.Generator
    ) -> None:
        self._error, self._jitter, self._lost = error, jitter, lost
        self._chances = draw(generator, [0.0, 0.0], [1.0, 1.0])
        self._are_exact = not (error or jitter or lost)
        self._rare = NormalDist().inv_cdf(lost) if lost else 0.0

    def of(self, at: Time) -> Time | None:
        """Return the stamp of a pose taken at `at`; None if the pose is lost."""
        if self._are_exact:
            return at
        jitter, chance = next(self._chances)
        if self._lost and chance < self._rare:
            return None
        return at + round((self._error + self._jitter * jitter) * NS)


class PoseSampler:
    """Noisy poses of one vehicle at a given rate, which arrive after `latency`. markers: attitude
    of the motion-capture body relative to the vehicle's body."""

    def __init__(
        self, rate: float, latency: float, position_noise: float, attitude_noise: float,
        markers: Quat, stamps: Stamps, generator: numpy.random.Generator,
    ) -> None:  # fmt: skip
        self._markers, self._stamps = markers, stamps
        self.schedule = Schedule(rate)
        self.latency: Time = round(latency * NS)
        deviations = [position_noise] * 3 + [attitude_noise] * 3
        self._noise = draw(generator, [0.0] * 6, deviations)

    def measure(self, truth: Truth, at: Time, now: Time) -> Pose | None:
        """Return the pose at `at`, computed from the true state at `now`, at most a physics step
        later; None if the pose is lost."""
        stamp = self._stamps.of(at)
        back = (at - now) / NS
        (px, py, pz), (vx, vy, vz), attitude, (ox, oy, oz), _ = truth
        nx, ny, nz, ax, ay, az = next(self._noise)
        position = (px + back * vx + nx, py + back * vy + ny, pz + back * vz + nz)
        turn = (back * ox + ax, back * oy + ay, back * oz + az)
        if stamp is None:
            return None
        if self._markers != LEVEL:
            attitude = multiply(attitude, self._markers)
        return Pose(stamp, position, integrate(attitude, turn, 1.0))


class Positions:
    """GPS positions of one vehicle at a given rate, which arrive after `latency`.

    The error along each axis is white noise plus a first-order Gauss-Markov process, w' = a w +
    sqrt(1 - a^2) n with a = exp(-1 / (rate SLOW_TIME_S)). deviations: standard deviations of their
    sum, east, north and up."""

    def __init__(
        self, rate: float, latency: float, deviations: Vec3, generator: numpy.random.Generator
    ) -> None:
        self.schedule = Schedule(rate)
        self.is_wanted = False
        self._latency: Time = round(latency * NS)
        self._spread = deviations
        self._noise = draw(generator, [0.0] * 6, [1.0] * 6)
        self._stays = exp(-1.0 / (rate * SLOW_TIME_S))
        self._wander = next(self._noise)[3:]
        self._arriving: deque[tuple[Time, Position]] = deque()

    def begin(self, now: Time) -> None:
        """Start measuring."""
        self.is_wanted = True
        while self.schedule.due < now:
            self.schedule.move_on()

    def measure(self, truth: Truth, now: Time) -> None:
        """Take every position that is due, computed from the true state at `now`, at most a physics
        step later."""
        while (at := self.schedule.due) <= now:
            back, (ex, ey, ez) = (at - now) / NS, self._errors()
            (px, py, pz), (vx, vy, vz), *_ = truth
            position = (px + back * vx + ex, py + back * vy + ey, pz + back * vz + ez)
            self._arriving.append((at + self._latency, Position(at, position, self._spread)))
            self.schedule.move_on()

    def arrived(self, now: Time) -> list[Position]:
        """Return the positions that have arrived since the last call."""
        arrived = []
        while self._arriving and self._arriving[0][0] <= now:
            arrived.append(self._arriving.popleft()[1])
        return arrived

    def _errors(self) -> list[float]:
        row, a = next(self._noise), self._stays
        wander = zip(self._wander, row[3:], strict=True)
        self._wander = [a * w + sqrt(1.0 - a * a) * n for w, n in wander]
        return [
            s * (sqrt(1.0 - SLOW_VARIANCE) * n + sqrt(SLOW_VARIANCE) * w)
            for s, n, w in zip(self._spread, row[:3], self._wander, strict=True)
        ]


class SimulatedBattery:
    """A vehicle's battery and the schedule of its reports."""

    def __init__(self, airframe: Airframe, remaining: float, rate: float) -> None:
        self.schedule = Schedule(rate)
        self.charge = BatteryCharge(airframe, remaining)

    def measure(self, now: Time) -> Battery:
        return Battery(now, self.charge.remaining, self.charge.voltage)


def bias(generator: numpy.random.Generator, deviation: float) -> Vec3:
    """Return a random constant offset for the three axes of a sensor."""
    x, y, z = (generator.standard_normal(3) * deviation).tolist()
    return (x, y, z)
