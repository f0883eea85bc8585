"""The session of emulated drones. In each tick the world advances first, then the drones, then the
links."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

from kybflow.core.geometry import Vec3
from kybflow.core.signals import NS, Measurement, Time, Truth
from kybflow.drivers.ardrone.link import ArdroneLink
from kybflow.drivers.ardrone.udp import UdpWire
from kybflow.drivers.ardrone.wire import DroneWire
from kybflow.drivers.emulated_ardrone.drone import OnboardDrone
from kybflow.drivers.emulated_ardrone.endpoint import DroneEndpoint, Radio
from kybflow.drivers.emulated_ardrone.ports import (
    DroneMemoryWire,
    MemoryPorts,
    Ports,
    SocketPorts,
    host_of,
)
from kybflow.drivers.emulation.body import SimulatedBody
from kybflow.drivers.emulation.fleet import EmulatedVehicle, Fleet
from kybflow.parts import Link, Seat, Session
from kybflow.parts.link import Touch

MAX_STEP_NS: Time = NS // 250
"""Longest step of the drones, which send navigation data 200 times a second."""


def open_fleet(
    seats: Sequence[Seat], radios: Sequence[Radio], generator: random.Random
) -> Fleet[DroneEndpoint]:
    """Return the opened drones, which are not connected to ports yet. Raises DriverError."""

    def build(
        number: int, body: SimulatedBody, chance: random.Random
    ) -> tuple[DroneEndpoint, bool]:
        drone = OnboardDrone(seats[number].context, body, chance)
        return DroneEndpoint(drone, radios[number], chance), False

    return Fleet(seats, generator, build, MAX_STEP_NS)


class EmulatedDroneLink(ArdroneLink):
    """The link of the driver for real drones, with the poses of simulated motion capture added.
    drone: the emulated drone."""

    def __init__(
        self, seat: Seat, wire: DroneWire, session: str, emulated: EmulatedVehicle[DroneEndpoint]
    ) -> None:
        super().__init__(seat, wire, session)
        self._emulated = emulated
        self.faults, self.is_calm = emulated.vehicle.faults, emulated.vehicle.is_calm

    @property
    def drone(self) -> OnboardDrone:
        return self._emulated.onboard.drone

    def update(self, now: Time) -> None:
        faults = self._emulated.vehicle.faults
        self.wire.deaf, self.wire.mute = faults.deaf, faults.mute
        self._emulated.onboard.set_delay(round(faults.late * NS))
        super().update(now)

    def read(self, now: Time) -> Sequence[Measurement]:
        return self._emulated.with_poses(super().read(now))

    def truth(self) -> Truth | None:
        return self._emulated.vehicle.truth()

    def view(self) -> Truth | None:
        return self._emulated.vehicle.view()

    def report_touches(self, tell: Callable[[Touch], None]) -> None:
        self._emulated.vehicle.report_touches(tell)

    def carry(self, way: Vec3, turn: Vec3, generator: random.Random) -> None:
        self._emulated.vehicle.carry(way, turn, generator)


class EmulatedDroneSession(Session):
    """The emulated drones of a run. Raises DriverError under the conditions of the simulator."""

    def __init__(self, seats: Sequence[Seat], generator: random.Random) -> None:
        radios = [
            Radio(s.params.wifi_latency, s.params.wifi_jitter, s.params.wifi_loss) for s in seats
        ]
        self._fleet = open_fleet(seats, radios, generator)
        self.scene = self._fleet.scene
        self._links: list[EmulatedDroneLink] = []
        self._now: Time = -MAX_STEP_NS
        self._ports: list[Ports] = []
        try:
            for number, (seat, emulated) in enumerate(zip(seats, self._fleet.members, strict=True)):
                ports, wire = _connected(seat, number)
                self._ports.append(ports)
                emulated.onboard.connect(ports)
                session = f"{generator.getrandbits(32):08x}"
                self._links.append(EmulatedDroneLink(seat, wire, session, emulated))
        except BaseException:
            self.close()
            raise
        self.links: dict[str, Link] = {
            seat.context.vehicle: link for seat, link in zip(seats, self._links, strict=True)
        }

    def advance(self, now: Time) -> None:
        """Advance the drones and the wires at their own rates, however long the tick is."""
        while self._now < now:
            self._now = min(now, self._now + MAX_STEP_NS)
            self._fleet.advance(self._now)
            for link in self._links:
                link.wire.poll(self._now)
        for link in self._links:
            link.update(now)

    def close(self) -> None:
        for link in self._links:
            link.close()
        for ports in self._ports:
            ports.close()
        self._fleet.close()


def _connected(seat: Seat, number: int) -> tuple[Ports, DroneWire]:
    """Return the drone's ports and the driver's connection to them. Raises DriverError."""
    if not seat.params.network:
        memory = MemoryPorts()
        return memory, DroneMemoryWire(memory, seat.params.rate)
    ports = SocketPorts(host_of(number))
    try:
        return ports, UdpWire(ports.host, seat.params.rate)
    except BaseException:
        ports.close()
        raise
