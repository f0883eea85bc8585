"""Simulated vehicles in one world, each with an emulated computer, advanced in lockstep."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Sequence
from operator import attrgetter
from typing import Generic, Protocol, TypeVar

from kybflow.core.signals import NS, Imu, Measurement, Pose, Position, Time
from kybflow.drivers.emulation.body import SimulatedBody
from kybflow.drivers.emulation.breaking import Break, Failures
from kybflow.drivers.sim.vehicle import SimulatedVehicle
from kybflow.drivers.sim.world import SimulatedWorld
from kybflow.parts import Seat

PERIOD: Time = NS // 125
"""The shortest interval between two steps of the emulated computers."""


class OnboardComputer(Protocol):
    """The computer of an emulated vehicle."""

    @property
    def failures(self) -> Failures:
        """The injected failures."""

    def add_measurement(self, measured: Measurement, now: Time) -> None:
        """Handle a measurement of the vehicle's own sensors."""

    def step(self, now: Time) -> None:
        """Receive messages, estimate, fly, and report."""


Onboard = TypeVar("Onboard", bound=OnboardComputer)


class EmulatedVehicle(Generic[Onboard]):
    """A simulated vehicle and its onboard computer. has_gps: whether its GPS is switched on."""

    def __init__(self, vehicle: SimulatedVehicle, onboard: Onboard, *, has_gps: bool) -> None:
        self.vehicle, self.onboard = vehicle, onboard
        vehicle.is_wired = True
        own = {Position} if has_gps else set()
        vehicle.subscribe(frozenset({Imu, *own}))
        self._poses: list[Measurement] = []

    def step(self, now: Time) -> None:
        """Pass the sensors' measurements to the computer, and step it."""
        for measured in self.vehicle.read(now):
            if isinstance(measured, Pose):
                self._poses.append(measured)
            else:
                self.onboard.add_measurement(measured, now)
        self.onboard.step(now)

    def with_poses(self, measured: Sequence[Measurement]) -> Sequence[Measurement]:
        """Return the computer's measurements merged, by time, with the motion-capture poses since
        the last call, which the computer doesn't receive."""
        poses, self._poses = self._poses, []
        return sorted([*measured, *poses], key=attrgetter("time")) if poses else measured


class Fleet(Generic[Onboard]):
    """The emulated vehicles of one world.

    members: the vehicles, in the order of the seats. scene: the world's objects.
    build: takes the index of a seat, the vehicle's body and its random generator; returns the
    computer, and whether the vehicle has GPS.
    period: the shortest interval between two steps of the computers.
    Raises DriverError like `SimulatedWorld`.
    """

    def __init__(
        self,
        seats: Sequence[Seat],
        generator: random.Random,
        build: Callable[[int, SimulatedBody, random.Random], tuple[Onboard, bool]],
        period: Time = PERIOD,
    ) -> None:
        self._period = period
        self._world = SimulatedWorld(seats, generator)
        self.scene = self._world.scene
        self.members: list[EmulatedVehicle[Onboard]] = []
        for number, seat in enumerate(seats):
            vehicle = self._world.links[seat.context.vehicle]
            assert isinstance(vehicle, SimulatedVehicle)
            chance = random.Random(generator.getrandbits(64))
            body = SimulatedBody(
                vehicle.send, vehicle.controller.attitude, vehicle.grip, vehicle.truth
            )
            onboard, has_gps = build(number, body, chance)
            self.members.append(EmulatedVehicle(vehicle, onboard, has_gps=has_gps))
        self._due: Time = 0

    def advance(self, now: Time) -> None:
        """Advance the world and the computers to `now`."""
        self._world.advance(now)
        if now >= self._due:
            self._due = now + self._period
            for member in self.members:
                member.step(now)

    def serve(
        self, ticks: Iterable[Time], breaks: Sequence[Break], report: Callable[[Break, Time], None]
    ) -> None:
        """Advance from tick to tick and inject each failure at its time. report: called with a
        failure and the time when it begins."""
        waiting = sorted(breaks)
        for now in ticks:
            while waiting and waiting[0].at <= now:
                failure = waiting.pop(0)
                report(failure, now)
                for member in self.members:
                    failure.apply(member.onboard.failures)
            self.advance(now)

    def close(self) -> None:
        self._world.close()
