"""One simulated vehicle: how it was built, its sensors, its on-board controller and its link."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy

from kybflow.drivers.sim.model import Body
from kybflow.drivers.sim.onboard import Pilot
from kybflow.drivers.sim.sensors import Cell, MotionCapture, bias, draw
from kybflow.drivers.sim.wind import Wind
from kybflow.parts import Link, Seat
from kybflow.signals import Command, Measurement, Time, Truth
from kybflow.site import Airframe

if TYPE_CHECKING:
    import random

    from kybflow.drivers.sim.world import World

ROTOR_SPREAD = 0.2
"""How much the rotors differ from each other, as a part of `model_error`."""


class Vehicle(Link):
    """A vehicle in a world, and the link to it. `index` is its place there."""

    def __init__(self, world: World, index: int, seat: Seat, generator: random.Random) -> None:
        site, p = seat.site, seat.params
        streams = numpy.random.default_rng(generator.getrandbits(64)).spawn(4)
        self._world = world
        self._index = index
        self.body = build(site.airframe, p.model_error, streams[0])
        imu = streams[1]
        offsets = [*bias(imu, p.gyro_bias), *bias(imu, p.accelerometer_bias)]
        noises = [p.gyro_noise] * 3 + [p.accelerometer_noise] * 3
        self.pilot = Pilot(site.airframe, site.heading, 1.0 / p.physics, draw(imu, offsets, noises))
        self.capture = MotionCapture(
            p.mocap_rate, p.mocap_latency, p.mocap_position_noise, p.mocap_attitude_noise,
            streams[2],
        )  # fmt: skip
        self.cell = Cell(site.airframe, p.battery, p.battery_rate)
        self.wind = Wind(p.wind, p.gust, draw(streams[3], [0.0] * 3, [1.0] * 3))
        self.due: Time = 0
        self._arriving: deque[tuple[Time, Measurement]] = deque()

    def measure(self, now: Time) -> None:
        """Take every measurement that is due at `now`."""
        capture, cell = self.capture, self.cell
        if capture.schedule.due <= now:
            truth = self.truth()
            while (at := capture.schedule.due) <= now:
                self._arriving.append((at + capture.latency, capture.measure(truth, at, now)))
                capture.schedule.move_on()
        if cell.schedule.due <= now:
            self._arriving.append((now, cell.measure(now)))
            self._world.load(self._index, now)
            cell.schedule.move_on()
        self.due = min(capture.schedule.due, cell.schedule.due)

    def read(self, now: Time) -> Sequence[Measurement]:
        arriving = self._arriving
        if not arriving or arriving[0][0] > now:
            return ()
        arrived = []
        while arriving and arriving[0][0] <= now:
            arrived.append(arriving.popleft()[1])
        return arrived

    def send(self, command: Command, now: Time) -> None:
        self.pilot.receive(command)

    def truth(self) -> Truth:
        return self._world.truth(self._index)


def build(airframe: Airframe, error: float, generator: Any) -> Body:
    """A vehicle within `error` of what its maker says, each rotor a little different."""
    draws = (1.0 + error * generator.uniform(-1.0, 1.0, 7)).tolist()
    mass, jx, jy, jz, thrust, rotor_time, drag = draws
    ix, iy, iz = airframe.inertia
    spread = 1.0 + error * ROTOR_SPREAD * generator.uniform(-1.0, 1.0, 4)
    a, b, c, d = (airframe.thrust * thrust * spread).tolist()
    return Body(
        airframe.mass * mass, (ix * jx, iy * jy, iz * jz), (a, b, c, d),
        airframe.rotor_time * rotor_time, airframe.drag * drag,
    )  # fmt: skip
