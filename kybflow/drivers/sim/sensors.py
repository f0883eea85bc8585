"""What a simulated vehicle measures: the IMU's noise, motion capture, positions, the battery.

Each has its own schedule in integer nanoseconds. Chance comes from seeded NumPy generators, drawn
in blocks.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from itertools import chain
from math import exp, sqrt
from typing import TYPE_CHECKING

from kybflow.core.geometry import Vec3, integrate
from kybflow.core.signals import NS, Battery, Imu, Pose, Position, Time, Truth
from kybflow.drivers.sim.model import SENSORS
from kybflow.world.vehicle_context import Airframe

if TYPE_CHECKING:
    import numpy

BLOCK = 500
WANDERS, LASTS = 0.5, 30.0
"""The part of a position's variance that wanders, and for how many seconds it stays about the
same."""


def draw(
    generator: numpy.random.Generator, offsets: list[float], deviations: list[float]
) -> Iterator[list[float]]:
    """Rows of normally distributed numbers with the given means and deviations, without end."""
    return chain.from_iterable(_blocks(generator, offsets, deviations))


def _blocks(
    generator: numpy.random.Generator, offsets: list[float], deviations: list[float]
) -> Iterator[list[list[float]]]:
    while True:
        block = generator.standard_normal((BLOCK, len(offsets)))
        block *= deviations
        block += offsets
        yield block.tolist()


class Averages:
    """What the on-board controller's IMU felt on average since it was last asked. As `noise` it
    hands the controller its rows of `noise`, off by `bias`, and keeps the last. `lift` is the last
    specific force along body z."""

    def __init__(self, noise: Iterator[list[float]]) -> None:
        self.lift = 0.0
        self.bias: list[float] | None = None
        self._noise = noise
        self._row: list[float] = []
        self._sums = [0.0] * SENSORS
        self._count = 0

    def __iter__(self) -> Iterator[list[float]]:
        return self

    def __next__(self) -> list[float]:
        row = next(self._noise)
        if self.bias is not None:
            row = [error + more for error, more in zip(row, self.bias, strict=True)]
        self._row = row
        return row

    def add(self, felt: list[float]) -> None:
        """Another sample, turn rate and specific force, to which the last row is its error."""
        self._sums = [s + f + n for s, f, n in zip(self._sums, felt, self._row, strict=True)]
        self._count += 1
        self.lift = felt[-1] + self._row[-1]

    def measure(self, now: Time, dt: float) -> Imu | None:
        """The average of the samples, `dt` seconds each, the last of them taken at `now`; None
        without a sample."""
        count = self._count
        if not count:
            return None
        gx, gy, gz, ax, ay, az = (total / count for total in self._sums)
        self._sums, self._count = [0.0] * SENSORS, 0
        return Imu(now, count * dt, (ax, ay, az), (gx, gy, gz))


class Schedule:
    """When a stream is next due: integer nanoseconds, from zero, at a rate in hertz."""

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._count = 0
        self.due: Time = 0

    def move_on(self) -> None:
        self._count += 1
        self.due = round(self._count * NS / self.rate)


class PoseSampler:
    """Poses of one vehicle at their own rate, with noise; they arrive `latency` late."""

    def __init__(
        self, rate: float, latency: float, position_noise: float, attitude_noise: float,
        generator: numpy.random.Generator,
    ) -> None:  # fmt: skip
        self.schedule = Schedule(rate)
        self.latency: Time = round(latency * NS)
        deviations = [position_noise] * 3 + [attitude_noise] * 3
        self._noise = draw(generator, [0.0] * 6, deviations)

    def measure(self, truth: Truth, at: Time, now: Time) -> Pose:
        """The pose at `at`, from the truth at `now`, at most a physics step later."""
        back = (at - now) / NS
        (px, py, pz), (vx, vy, vz), attitude, (ox, oy, oz), _ = truth
        nx, ny, nz, ax, ay, az = next(self._noise)
        position = (px + back * vx + nx, py + back * vy + ny, pz + back * vz + nz)
        turn = (back * ox + ax, back * oy + ay, back * oz + az)
        return Pose(at, position, integrate(attitude, turn, 1.0))


class Positions:
    """Positions of one vehicle at their own rate, as GPS gives them; they arrive `latency` late.

    The error along each axis is noise, anew for each, and what wanders: a first-order Gauss-Markov
    process, w' = a w + sqrt(1 - a^2) n with a = exp(-1 / (rate LASTS)). deviations: east, north and
    up, of both together.
    """

    def __init__(
        self, rate: float, latency: float, deviations: Vec3, generator: numpy.random.Generator
    ) -> None:
        self.schedule = Schedule(rate)
        self.is_wanted = False
        self._latency: Time = round(latency * NS)
        self._spread = deviations
        self._noise = draw(generator, [0.0] * 6, [1.0] * 6)
        self._stays = exp(-1.0 / (rate * LASTS))
        self._wander = next(self._noise)[3:]
        self._arriving: deque[tuple[Time, Position]] = deque()

    def begin(self, now: Time) -> None:
        """Measure from now on."""
        self.is_wanted = True
        while self.schedule.due < now:
            self.schedule.move_on()

    def measure(self, truth: Truth, now: Time) -> None:
        """Measure all that is due, from the truth at `now`, at most a physics step later."""
        while (at := self.schedule.due) <= now:
            back, (ex, ey, ez) = (at - now) / NS, self._errors()
            (px, py, pz), (vx, vy, vz), *_ = truth
            position = (px + back * vx + ex, py + back * vy + ey, pz + back * vz + ez)
            self._arriving.append((at + self._latency, Position(at, position, self._spread)))
            self.schedule.move_on()

    def arrived(self, now: Time) -> list[Position]:
        """The positions that have arrived since the last call."""
        arrived = []
        while self._arriving and self._arriving[0][0] <= now:
            arrived.append(self._arriving.popleft()[1])
        return arrived

    def _errors(self) -> list[float]:
        row, a = next(self._noise), self._stays
        wander = zip(self._wander, row[3:], strict=True)
        self._wander = [a * w + sqrt(1.0 - a * a) * n for w, n in wander]
        return [
            s * (sqrt(1.0 - WANDERS) * n + sqrt(WANDERS) * w)
            for s, n, w in zip(self._spread, row[:3], self._wander, strict=True)
        ]


class SimulatedBattery:
    """A battery that a hovering vehicle empties in the airframe's endurance.

    Power goes with thrust^1.5 (momentum theory). Voltage falls with the charge by the airframe's
    `voltage_spread` and with the load by a quarter of that at hover; rotor thrust goes with its
    square.
    """

    FULL = 4.2 * 4
    sag = 0.0
    """Part of the charge that is missing."""

    def __init__(self, airframe: Airframe, remaining: float, rate: float) -> None:
        self.schedule = Schedule(rate)
        self._spread = airframe.voltage_spread
        self._weight = airframe.hover_thrust
        self._per_second = 1.0 / airframe.endurance
        self._charge = remaining
        self.level = 1.0 - self._spread * (1.0 - remaining)

    @property
    def remaining(self) -> float:
        """0 to 1."""
        return max(0.0, self._charge - self.sag)

    def drain(self, thrust: float, seconds: float) -> None:
        """Give `thrust` newtons for `seconds`."""
        load = max(0.0, thrust / self._weight) ** 1.5
        self._charge = max(0.0, self._charge - load * seconds * self._per_second)
        self.level = 1.0 - self._spread * (1.0 - self.remaining + 0.1 * load)

    def measure(self, now: Time) -> Battery:
        return Battery(now, self.remaining, self.FULL * self.level)


def bias(generator: numpy.random.Generator, deviation: float) -> Vec3:
    """A sensor's constant offset, drawn once."""
    x, y, z = (generator.standard_normal(3) * deviation).tolist()
    return (x, y, z)
