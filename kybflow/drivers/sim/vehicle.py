"""One simulated vehicle: how it was built, its sensors, its on-board controller and its link."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from math import exp, sqrt
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Protocol

import numpy

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import (
    NS,
    Command,
    Imu,
    Measurement,
    MeasurementKind,
    Payload,
    Position,
    Time,
    Truth,
)
from kybflow.drivers.sim.model import BuiltAirframe
from kybflow.drivers.sim.onboard import AttitudeController, Rotors
from kybflow.drivers.sim.receiver import Receiver
from kybflow.drivers.sim.sensors import (
    Averages,
    PoseSampler,
    Positions,
    SimulatedBattery,
    bias,
    draw,
)
from kybflow.parts import Link, Rig, Seat
from kybflow.world.vehicle_context import Airframe

if TYPE_CHECKING:
    import random

GUST_TIME = 1.0
"""Seconds."""
ROTOR_SPREAD = 0.2
"""How much the rotors differ from each other, as a part of `model_error`."""


Update = Callable[[list[float]], Rotors]
"""Called once a physics step with what the IMU measures; returns the rotors' controls."""


class Surroundings(Protocol):
    """What a vehicle asks of the world that it is in (`kybflow.drivers.sim.world`). index: the
    vehicle's place there."""

    @property
    def now(self) -> Time: ...
    def wire(self) -> None: ...
    def truth(self, index: int) -> Truth: ...
    def index(self, name: str) -> int: ...
    def hurry(self, due: Time) -> None: ...
    def load(self, index: int, now: Time) -> None: ...
    def refit(self, index: int) -> None: ...
    def grip(self, index: int, is_open: bool, armed: bool) -> bool: ...
    def collisions(self, index: int) -> Sequence[str]: ...


class GustyWind:
    """The air that one vehicle flies in, m/s, world frame: steady wind, and gusts that are an
    Ornstein-Uhlenbeck process along each axis, which forgets within `GUST_TIME`. gust: their
    standard deviation. noise: rows of three standard normal numbers."""

    def __init__(self, steady: Vec3, gust: float, noise: Iterator[list[float]]) -> None:
        self._steady = steady
        self._gust = gust
        self._noise = noise
        self._now = ZERO
        self.blows = gust > 0.0 or any(steady)

    def after(self, seconds: float) -> Vec3:
        """The wind, `seconds` after the last call."""
        keep = exp(-seconds / GUST_TIME)
        kick = self._gust * sqrt(1.0 - keep * keep)
        (x, y, z), (nx, ny, nz) = self._now, next(self._noise)
        self._now = (keep * x + kick * nx, keep * y + kick * ny, keep * z + kick * nz)
        (sx, sy, sz), (x, y, z) = self._steady, self._now
        return (sx + x, sy + y, sz + z)


class SimulatedVehicle(Link):
    """A vehicle in a world, and the link to it. `index` is its place there. `is_wired`: who reads
    and commands it sits on board, so that a fault of the link does not come between."""

    rig: Rig
    is_wired = False

    def __init__(
        self, world: Surroundings, index: int, seat: Seat, generator: random.Random
    ) -> None:
        context, p = seat.context, seat.params
        streams = numpy.random.default_rng(generator.getrandbits(64)).spawn(5)
        self._world = world
        self._index = index
        self.body = build(context.airframe, p.model_error, streams[0])
        imu = streams[1]
        offsets = [*bias(imu, p.gyro_bias), *bias(imu, p.accelerometer_bias)]
        noises = [p.gyro_noise] * 3 + [p.accelerometer_noise] * 3
        self.controller = AttitudeController(
            context.airframe, context.heading, 1.0 / p.physics, draw(imu, offsets, noises)
        )
        self.capture = PoseSampler(
            p.mocap_rate, p.mocap_latency, p.mocap_position_noise, p.mocap_attitude_noise,
            streams[2],
        )  # fmt: skip
        spread = (p.position_noise, p.position_noise, p.position_noise_up)
        self._positions = Positions(p.position_rate, p.position_latency, spread, streams[4])
        self.battery = SimulatedBattery(context.airframe, p.battery, p.battery_rate)
        self.wind = GustyWind(p.wind, p.gust, draw(streams[3], [0.0] * 3, [1.0] * 3))
        self.due: Time = 0
        self.thrust = list(self.body.thrust)
        self.rig = Rig(context.vehicle, self._rigged)
        self._dt = 1.0 / p.physics
        self._arriving: deque[tuple[Time, Measurement]] = deque()
        self._filters = self.rig.filters
        self._deaf = self._mute = False
        self._seen_as = self._sees_as = index
        self._imu = Averages(self.controller.noise)
        self._subscribed = False
        self._receiver = Receiver(self.controller, context.airframe, p.watchdog)
        self._minded: Time = 0
        if context.payload is not None:
            self._arriving.append(
                (0, Payload(0, not context.payload.aboard, context.payload.aboard))
            )

    def measure(self, now: Time) -> None:
        """Take every measurement that is due at `now`, and every command; mind the watchdog."""
        capture, battery = self.capture, self.battery
        if capture.schedule.due <= now:
            truth = self._world.truth(self._seen_as)
            while (at := capture.schedule.due) <= now:
                self._arriving.append((at + capture.latency, capture.measure(truth, at, now)))
                capture.schedule.move_on()
        if battery.schedule.due <= now:
            self._arriving.append((now, battery.measure(now)))
            self._world.load(self._index, now)
            battery.schedule.move_on()
        if self._minded <= now:
            falling, self._minded = self._receiver.descent, self._receiver.mind(now)
            if self._receiver.descent is not falling:
                self._rewire()
        self.due = min(capture.schedule.due, battery.schedule.due, self._minded)
        if self._positions.is_wanted:
            if self._positions.schedule.due <= now:
                self._positions.measure(self.truth(), now)
            self.due = min(self.due, self._positions.schedule.due)

    @property
    def update(self) -> Update:
        """The on-board controller, as much of it as is needed now."""
        taps = self._subscribed or self._imu.bias is not None or self._receiver.descent is not None
        return self._update if taps else self.controller.update

    def _update(self, felt: list[float]) -> Rotors:
        rotors = self.controller.update(felt)
        self._imu.add(felt)
        self._receiver.come_down(self._imu.lift, self._dt)
        return rotors

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        if Imu in kinds and not self._subscribed:
            self._subscribed = True
            self._imu.measure(self._world.now, self._dt)  # what was felt before is nobody's
            self._rewire()
        if Position in kinds and not self._positions.is_wanted:
            self._positions.begin(self._world.now)
            self.due = min(self.due, self._positions.schedule.due)
            self._world.hurry(self.due)

    def read(self, now: Time) -> Sequence[Measurement]:
        arriving, positions = self._arriving, self._positions.is_wanted
        if not (self._subscribed or positions) and (not arriving or arriving[0][0] > now):
            return ()
        arrived = []
        while arriving and arriving[0][0] <= now:
            arrived.append(arriving.popleft()[1])
        imu = self._imu.measure(self._world.now, self._dt) if self._subscribed else None
        if imu is not None:
            arrived.append(imu)
        if positions and (late := self._positions.arrived(now)):
            arrived = sorted([*late, *arrived], key=attrgetter("time"))
        if self._deaf:
            return ()
        return self._filtered(arrived) if self._filters else arrived

    def _filtered(self, arrived: list[Measurement]) -> list[Measurement]:
        left = []
        for arriving in arrived:
            measurement: Measurement | None = arriving
            for change in self._filters:
                measurement = None if measurement is None else change(measurement)
            if measurement is not None:
                left.append(measurement)
        return left

    def send(self, command: Command, now: Time) -> None:
        receiver = self._receiver
        if self._mute:
            return
        if not receiver.late:
            receiver.hear(command, now)
            return
        self._minded = min(self._minded, receiver.delay(command, now))
        self.due = min(self.due, self._minded)
        self._world.hurry(self.due)

    def grip(self, is_open: bool, now: Time) -> None:
        if self._mute:
            return
        aboard = self._world.grip(self._index, is_open, self.controller.armed)
        self._arriving.append((now, Payload(now, is_open, aboard)))

    def _rewire(self) -> None:
        self.controller.noise = self._imu
        self._world.wire()

    def _rigged(self) -> None:
        """Obey the rig."""
        rig = self.rig
        self._filters = rig.filters
        self._deaf, self._mute = (not self.is_wired and cut for cut in (rig.deaf, rig.mute))
        self._receiver.put_off(round(rig.late * NS))
        self._seen_as = self._world.index(rig.body)
        self._sees_as = self._world.index(rig.view)
        self.battery.sag = rig.sag
        self.thrust = [t * left for t, left in zip(self.body.thrust, rig.rotors, strict=True)]
        off = [*rig.gyro_bias, *rig.accelerometer_bias]
        self._imu.bias = off if any(off) else None
        self._rewire()
        self._world.refit(self._index)

    def truth(self) -> Truth:
        return self._world.truth(self._index)

    def view(self) -> Truth:
        return self._world.truth(self._sees_as)

    def collisions(self) -> Sequence[str]:
        return self._world.collisions(self._index)


def build(airframe: Airframe, error: float, generator: Any) -> BuiltAirframe:
    """A vehicle within `error` of what its maker says, each rotor a little different."""
    draws = (1.0 + error * generator.uniform(-1.0, 1.0, 7)).tolist()
    mass, jx, jy, jz, thrust, rotor_time, drag = draws
    ix, iy, iz = airframe.inertia
    spread = 1.0 + error * ROTOR_SPREAD * generator.uniform(-1.0, 1.0, 4)
    a, b, c, d = (airframe.thrust * thrust * spread).tolist()
    return BuiltAirframe(
        airframe.mass * mass, (ix * jx, iy * jy, iz * jz), (a, b, c, d),
        airframe.rotor_time * rotor_time, airframe.drag * drag,
    )  # fmt: skip
