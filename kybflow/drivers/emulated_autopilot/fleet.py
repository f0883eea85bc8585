"""Simulated vehicles in one world, an emulated autopilot on each."""

from __future__ import annotations

import random
from collections.abc import Sequence

from kybflow.core.signals import NS, Imu, Measurement, Pose, Position, Time
from kybflow.drivers.emulated_autopilot.autopilot import Autopilot, Body
from kybflow.drivers.emulated_autopilot.firmware.preparing import (
    FIRMWARES,
    Plans,
    as_built,
    prepared,
)
from kybflow.drivers.sim.vehicle import Vehicle
from kybflow.drivers.sim.world import World
from kybflow.parts import Seat

PERIOD: Time = NS // 125
"""An autopilot steps so often, and not more often."""


class Emulated:
    """A vehicle and its autopilot."""

    def __init__(
        self, vehicle: Vehicle, seat: Seat, plans: Plans, system: int, generator: random.Random
    ) -> None:
        context, firmware = seat.context, FIRMWARES[plans.firmware]
        changes = (
            prepared(firmware, context, system, outside=plans.outside, station=plans.station)
            if plans.prepared
            else as_built(firmware, context, system)
        )
        self.vehicle = vehicle
        vehicle.is_wired = True
        self.autopilot = Autopilot(
            firmware,
            context,
            Body(vehicle.send, vehicle.grip, vehicle.truth),
            system=system,
            changes={**changes, **plans.changes},
            generator=generator,
        )
        own = set() if plans.outside else {Position}
        vehicle.subscribe(frozenset({Imu, *own}))
        self._poses: list[Measurement] = []

    def step(self, now: Time) -> None:
        """Give the autopilot what its own sensors measured, and let it go on."""
        for measured in self.vehicle.read(now):
            if isinstance(measured, Pose):
                self._poses.append(measured)
            else:
                self.autopilot.feel(measured, now)
        self.autopilot.step(now)

    def poses(self) -> list[Measurement]:
        """What motion capture saw since the last call, which the autopilot does not hear of."""
        poses, self._poses = self._poses, []
        return poses


class Fleet:
    """`members` in the order of the seats; system ids go up from `first`. Raises DriverError."""

    def __init__(
        self,
        seats: Sequence[Seat],
        plans: Sequence[Plans],
        generator: random.Random,
        first: int = 1,
    ) -> None:
        self._world = World(seats, generator)
        self.members: list[Emulated] = []
        for number, (seat, plan) in enumerate(zip(seats, plans, strict=True), start=first):
            vehicle = self._world.links[seat.context.vehicle]
            assert isinstance(vehicle, Vehicle)
            chance = random.Random(generator.getrandbits(64))
            self.members.append(Emulated(vehicle, seat, plan, number, chance))
        self._due: Time = 0

    def advance(self, now: Time) -> None:
        """Let the world go on until `now`."""
        self._world.advance(now)
        if now >= self._due:
            self._due = now + PERIOD
            for member in self.members:
                member.step(now)

    def close(self) -> None:
        self._world.close()
