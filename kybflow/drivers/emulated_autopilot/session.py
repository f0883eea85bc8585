"""Emulated autopilots in lockstep: the world goes on, then they do, then the links hear them."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import fields, replace
from operator import attrgetter

from kybflow.core.signals import Measurement, Time, Truth
from kybflow.drivers.emulated_autopilot.autopilot import Autopilot
from kybflow.drivers.emulated_autopilot.firmware.preparing import Plans
from kybflow.drivers.emulated_autopilot.fleet import Emulated, Fleet
from kybflow.drivers.mavlink.firmware import Latency, profile_of
from kybflow.drivers.mavlink.link import AutopilotLink
from kybflow.drivers.mavlink.params import AutopilotLinkParams, MavlinkParams
from kybflow.drivers.mavlink.transport.router import Port, Router
from kybflow.drivers.mavlink.transport.wire import Wire, memory_wires
from kybflow.parts import Link, Seat, Session

LATENCY = Latency(position=0.04, acceleration=0.1)
"""By how much an emulated autopilot comes after its set-points."""


class EmulatedLink(AutopilotLink):
    """The link to a real autopilot, to an emulated one; the poses of simulated motion capture come
    beside it. `wire` is our end; `autopilot`, what is at the other."""

    def __init__(self, seat: Seat, port: Port, wire: Wire, emulated: Emulated) -> None:
        shared = {
            field.name: getattr(seat.params, field.name) for field in fields(AutopilotLinkParams)
        }
        params = MavlinkParams(**shared, simulator=True)
        profile = replace(profile_of(params.autopilot), latency=LATENCY)
        super().__init__(Seat(seat.context, params), profile, port)
        self.wire = wire
        self._emulated = emulated
        self.rig = emulated.vehicle.rig

    @property
    def autopilot(self) -> Autopilot:
        return self._emulated.autopilot

    def look(self, now: Time) -> None:
        rig = self._emulated.vehicle.rig
        self.wire.deaf, self.wire.mute = rig.deaf, rig.mute
        super().look(now)

    def read(self, now: Time) -> Sequence[Measurement]:
        told, poses = super().read(now), self._emulated.poses()
        self.is_heard = bool(told)
        return sorted([*told, *poses], key=attrgetter("time")) if poses else told

    def truth(self) -> Truth | None:
        return self._emulated.vehicle.truth()

    def view(self) -> Truth | None:
        return self._emulated.vehicle.view()

    def collisions(self) -> Sequence[str]:
        return self._emulated.vehicle.collisions()


class EmulatedSession(Session):
    """Raises DriverError as the simulator does."""

    def __init__(self, seats: Sequence[Seat], generator: random.Random) -> None:
        own = MavlinkParams(autopilot="px4").own_system
        plans = [
            Plans(s.params.autopilot, s.params.position == "outside", s.params.prepared, own)
            for s in seats
        ]
        self._fleet = Fleet(seats, plans, generator)
        self._links: list[EmulatedLink] = []
        wires = [memory_wires(f"memory:{seat.context.vehicle}") for seat in seats]
        self._hub = Router({ours.address: ours for ours, _ in wires}, own, None)
        for seat, (ours, theirs), emulated in zip(seats, wires, self._fleet.members, strict=True):
            emulated.autopilot.connect(theirs)
            port = self._hub.port(ours.address, emulated.autopilot.system)
            self._links.append(EmulatedLink(seat, port, ours, emulated))
        self.links: dict[str, Link] = {
            seat.context.vehicle: link for seat, link in zip(seats, self._links, strict=True)
        }

    def advance(self, now: Time) -> None:
        self._fleet.advance(now)
        self._hub.poll(now)
        for link in self._links:
            link.look(now)

    def close(self) -> None:
        for link in self._links:
            link.close()
        self._fleet.close()
