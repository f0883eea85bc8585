"""The session of vehicles simulated by rotorpy, in lockstep with the engine's clock."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy

from kybflow.core.errors import DriverError, Refused
from kybflow.core.geometry import ZERO, Quat, distance, rotate
from kybflow.core.signals import NS, Time, Truth
from kybflow.drivers.rotorpy.plant import Plant
from kybflow.drivers.sim.sensors import NOTHING, ImuErrors, imu_sample
from kybflow.drivers.sim.steps.onboard import control, estimate, shares, smooth
from kybflow.drivers.sim.steps.onboard_state import Numbers, OnboardState
from kybflow.drivers.sim.vehicle import TOUCH_GAP, SimulatedVehicle, jets_of
from kybflow.parts import Link, Seat, Session
from kybflow.parts.link import Touch

if TYPE_CHECKING:
    import random


class RotorpyWorld(Session):
    """All vehicles, each with its own plant. Raises DriverError if their physics rates differ."""

    def __init__(self, seats: Sequence[Seat], generator: random.Random) -> None:
        rates = {seat.params.physics for seat in seats}
        if len(rates) != 1:
            raise DriverError(f"vehicles in one world need one physics rate, found {sorted(rates)}")
        self._rate: int = round(rates.pop())
        self._dt = 1.0 / self._rate
        self.onboard = OnboardState(len(seats), lambda count, width: [(0.0,) * width] * count)
        self._seats = [seat.context for seat in seats]
        self._vehicles = [
            SimulatedVehicle(self, i, seat, generator) for i, seat in enumerate(seats)
        ]
        self._plants = [
            Plant(seat.context, vehicle.body, seat.params.aerodynamics)
            for seat, vehicle in zip(seats, self._vehicles, strict=True)
        ]
        self.links: dict[str, Link] = {
            context.vehicle: vehicle
            for context, vehicle in zip(self._seats, self._vehicles, strict=True)
        }
        sources = [vehicle.imu_source for vehicle in self._vehicles]
        self._errors = ImuErrors(sources, numpy.ndarray.tolist)
        self._shares = shares(self._dt)
        self._touched: dict[tuple[int, Touch], Time] = {}
        self._blown: Time = 0
        for vehicle in self._vehicles:
            vehicle.measure(0)

    @property
    def now(self) -> Time:
        """The time of the last physics step."""
        return self.onboard.steps * NS // self._rate

    def advance(self, now: Time) -> None:
        last = ((now + 1) * self._rate - 1) // NS
        if self.onboard.steps >= last:
            return
        self._blow(now)
        while self.onboard.steps < last:
            self._step()
        for index, vehicle in enumerate(self._vehicles):
            for touch in self._touches(index):
                before = self._touched.get((index, touch))
                self._touched[index, touch] = now
                if before is None or now - before > TOUCH_GAP:
                    vehicle.on_touch(touch)

    def _step(self) -> None:
        on, row = self.onboard, self._errors.take(1)
        for i, (vehicle, plant) in enumerate(zip(self._vehicles, self._plants, strict=True)):
            before, most = plant.truth, on.thrusts[i]
            asked = tuple(u * f for u, f in zip(on.controls[i], most, strict=True))
            moved = plant.step(asked, on.winds[i], on.pushes[i], self._dt)
            on.rotors[i] = tuple(
                given / f if f else 0.0 for given, f in zip(plant.thrusts, most, strict=True)
            )
            velocity = (*before.velocity, *before.angular_velocity)
            felt = imu_sample(_rows(before.attitude), velocity, moved, self._errors.block[row][i])
            on.filters[i], rates = estimate(on.filters[i], on.setpoints[i], felt, self._shares)
            on.gyros[i], rates = smooth(on.gyros[i], rates)
            on.loops[i], wanted = control(
                on.loops[i], on.filters[i], rates, on.setpoints[i], on.gains[i]
            )
            on.controls[i] = on.delayed(i, wanted)
            if vehicle.reads_imu:
                vehicle.add_imu(felt)
        on.steps += 1
        for vehicle in self._vehicles:
            if vehicle.due <= self.now:
                vehicle.measure(self.now)

    def _blow(self, now: Time) -> None:
        """Set the wind (world frame), the additional force and torque, and the vibration of each
        vehicle."""
        elapsed, self._blown = (now - self._blown) / NS, now
        jets = jets_of(self._vehicles)
        for i, vehicle in enumerate(self._vehicles):
            if vehicle.is_disturbed:
                self.onboard.winds[i] = vehicle.wind_at(now, elapsed, jets)
                thrust = vehicle.thrust
                self.onboard.pushes[i] = vehicle.push(elapsed, thrust)
                self._errors.shake(i, vehicle.vibration(thrust))

    def _touches(self, index: int) -> Iterator[Touch]:
        """Yield what a vehicle touches now: the floor, and obstacles and vehicles within its arms'
        reach."""
        context, plant = self._seats[index], self._plants[index]
        place, arm = plant.truth.position, context.airframe.arm
        yield from _floor(plant)
        for name, shape in context.obstacles.items():
            if shape.distance(place) < arm:
                yield Touch(name, carries=False)
        for other, beside in enumerate(self._seats):
            there = self._plants[other].truth.position
            if other != index and distance(there, place) < arm + beside.airframe.arm:
                yield Touch(beside.vehicle, carries=False)

    def truth(self, index: int) -> Truth:
        """Return the current state of a vehicle."""
        return self._plants[index].truth

    def index(self, name: str) -> int:
        """Return the index of a vehicle."""
        return list(self.links).index(name)

    def apply_faults(self, index: int) -> None:
        """Apply a vehicle's active faults."""
        vehicle = self._vehicles[index]
        self._plants[index].load(vehicle.body.mass * vehicle.faults.mass + vehicle.faults.payload)
        self._errors.bias(index, vehicle.imu_bias)
        self.onboard.winds[index], self.onboard.pushes[index] = ZERO, NOTHING

    def grip(self, index: int, is_open: bool, armed: bool) -> bool:
        """Raise Refused, since no vehicle carries a payload."""
        raise Refused("it carries no payload")

    def schedule(self, due: Time) -> None:
        """Do nothing: every step checks which measurements are due."""

    def update_imu_readers(self) -> None:
        """Do nothing: every step checks `reads_imu` of each vehicle."""

    def close(self) -> None:
        """There is nothing to release."""


def _floor(plant: Plant) -> Iterator[Touch]:
    if plant.is_down:
        yield Touch("the floor", carries=True)


def _rows(attitude: Quat) -> Numbers:
    """Return the rotation from body to world, row by row."""
    columns = [rotate(attitude, axis) for axis in ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0))]
    return tuple(column[row] for row in range(3) for column in columns)
