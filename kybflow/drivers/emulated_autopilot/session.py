"""Emulated autopilots with their MAVLink channels, flown in lockstep.

In each tick first the world advances, then the autopilots, then the links.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

from kybflow.core.geometry import Vec3
from kybflow.core.signals import NS, Measurement, Time, Truth
from kybflow.drivers.emulated_autopilot.autopilot import OnboardAutopilot
from kybflow.drivers.emulated_autopilot.channel import Channel
from kybflow.drivers.emulated_autopilot.firmware import SetupPlan, emulated_firmware
from kybflow.drivers.emulated_autopilot.handlers import MessageHandlers
from kybflow.drivers.emulated_autopilot.telemetry import MAKERS
from kybflow.drivers.emulation.body import SimulatedBody
from kybflow.drivers.emulation.fleet import EmulatedVehicle, Fleet
from kybflow.drivers.mavlink.firmware import Latency, profile_of
from kybflow.drivers.mavlink.link import AutopilotLink
from kybflow.drivers.mavlink.params import AutopilotLinkParams, MavlinkParams
from kybflow.drivers.mavlink.protocol.framing import mavlink
from kybflow.drivers.mavlink.transport.router import Port, Router
from kybflow.drivers.mavlink.transport.wire import MemoryWire, Wire, memory_wires
from kybflow.parts import Link, Seat, Session
from kybflow.parts.link import Touch

CHUNK = 50
"""The bytes of text in a STATUSTEXT."""


class MavlinkEndpoint:
    """One autopilot and its channels. generator: draws which messages are lost."""

    def __init__(self, autopilot: OnboardAutopilot, generator: random.Random) -> None:
        self.autopilot, self.failures = autopilot, autopilot.failures
        self._generator = generator
        self._channels: list[tuple[Channel, MessageHandlers]] = []
        self._text_id = 0
        autopilot.on_mode_change = self._send_mode

    def connect(self, wire: Wire, key: bytes | None = None, *, is_station: bool = False) -> Channel:
        """Add a wire and return its channel. key: the secret key of signed messages. is_station:
        whether the firmware's simulator takes the other end for a ground station."""
        firmware, system = self.autopilot.firmware, self.autopilot.system
        own = firmware.station_streams if is_station else firmware.streams
        streams = {"HEARTBEAT": 1.0, **own}
        channel = Channel(wire, system, key, streams, self.failures, self._generator)
        self._channels.append((channel, MessageHandlers(self.autopilot, channel)))
        return channel

    def add_measurement(self, measured: Measurement, now: Time) -> None:
        """Handle a measurement of the vehicle's own sensors."""
        self.autopilot.add_measurement(measured, now)

    def step(self, now: Time) -> None:
        """Handle messages, estimate, fly, and report. Must be called at least fifty times a
        second."""
        self.autopilot.now = now
        for channel, handlers in self._channels:
            for message in channel.receive(now):
                handlers.handle(message)
                if message.get_type() == "HEARTBEAT" and len(self._channels) > 1:
                    self._forward(message, channel)
        self.autopilot.step(now)
        texts, self.autopilot.texts = self.autopilot.texts, []
        for words, severity in texts:
            self._send_text(words, severity, now)
        for channel, _ in self._channels:
            for name in channel.due(now):
                message = MAKERS[name](self.autopilot)
                if message is not None:
                    channel.send(message)

    def _forward(self, message: Any, heard: Channel) -> None:
        """Forward a heartbeat to the other channels, as both firmwares do."""
        for channel, _ in self._channels:
            if channel is not heard:
                channel.forward(message)

    def _send_mode(self) -> None:
        for channel, _ in self._channels:
            for name in self.autopilot.firmware.mode_messages:
                channel.send(MAKERS[name](self.autopilot))

    def _send_text(self, words: str, severity: int, now: Time) -> None:
        """Send a text in chunks, on the channels to which the firmware sends texts."""
        firmware = self.autopilot.firmware
        data = (words + firmware.text_end).encode()
        chunks = [data[at : at + CHUNK] for at in range(0, len(data), CHUNK)]
        self._text_id = self._text_id % 0xFFFF + 1
        number = self._text_id if len(chunks) > 1 else 0
        for channel, _ in self._channels:
            if firmware.speaks_to_all or channel.has_station(now):
                for place, chunk in enumerate(chunks):
                    channel.send(mavlink.MAVLink_statustext_message(severity, chunk, number, place))


LATENCY = Latency(position=0.04, acceleration=0.1)
"""The delay with which an emulated autopilot follows its setpoints."""


def open_fleet(
    seats: Sequence[Seat], plans: Sequence[SetupPlan], generator: random.Random, first: int = 1
) -> Fleet[MavlinkEndpoint]:
    """Return the vehicles with their autopilots, not yet connected to any wire. first: the system
    id of the first vehicle. Raises DriverError."""

    def build(
        number: int, body: SimulatedBody, chance: random.Random
    ) -> tuple[MavlinkEndpoint, bool]:
        plan, context, system = plans[number], seats[number].context, first + number
        autopilot = OnboardAutopilot(
            emulated_firmware(plan.firmware),
            context,
            body,
            system=system,
            changes=plan.parameters(context, system),
            generator=chance,
        )
        return MavlinkEndpoint(autopilot, chance), not plan.outside

    return Fleet(seats, generator, build)


class EmulatedLink(AutopilotLink):
    """The link of a real autopilot, with added poses from simulated motion capture. `wire`: our end
    of the wire. `onboard`: the emulated autopilot at the other end."""

    def __init__(
        self, seat: Seat, port: Port, wire: MemoryWire, emulated: EmulatedVehicle[MavlinkEndpoint]
    ) -> None:
        shared = {
            field.name: getattr(seat.params, field.name) for field in fields(AutopilotLinkParams)
        }
        params = MavlinkParams(**shared, simulator=True)
        profile = replace(profile_of(params.autopilot), latency=LATENCY)
        super().__init__(Seat(seat.context, params), profile, port, None)
        self.wire = wire
        self._emulated = emulated
        self.faults, self.is_calm = emulated.vehicle.faults, emulated.vehicle.is_calm

    @property
    def onboard(self) -> OnboardAutopilot:
        return self._emulated.onboard.autopilot

    def update(self, now: Time) -> None:
        faults = self._emulated.vehicle.faults
        self.wire.deaf, self.wire.mute = faults.deaf, faults.mute
        self.wire.other.late = round(faults.late * NS)
        super().update(now)

    def read(self, now: Time) -> Sequence[Measurement]:
        measured = super().read(now)
        self.is_heard = bool(measured)
        return self._emulated.with_poses(measured)

    def truth(self) -> Truth | None:
        return self._emulated.vehicle.truth()

    def view(self) -> Truth | None:
        return self._emulated.vehicle.view()

    def report_touches(self, tell: Callable[[Touch], None]) -> None:
        self._emulated.vehicle.report_touches(tell)

    def carry(self, way: Vec3, turn: Vec3, generator: random.Random) -> None:
        self._emulated.vehicle.carry(way, turn, generator)


class EmulatedSession(Session):
    """The session of a run with emulated autopilots. Raises DriverError like
    `SimulatedWorld`."""

    def __init__(self, seats: Sequence[Seat], generator: random.Random) -> None:
        own = MavlinkParams.own_system
        plans = [
            SetupPlan(s.params.autopilot, s.params.position == "outside", s.params.prepared, own)
            for s in seats
        ]
        self._fleet = open_fleet(seats, plans, generator)
        self.scene = self._fleet.scene
        self._links: list[EmulatedLink] = []
        wires = [memory_wires(f"memory:{seat.context.vehicle}") for seat in seats]
        self._router = Router({ours.address: ours for ours, _ in wires}, own)
        for seat, (ours, theirs), emulated in zip(seats, wires, self._fleet.members, strict=True):
            emulated.onboard.connect(theirs)
            port = self._router.port(ours.address, emulated.onboard.autopilot.system)
            self._links.append(EmulatedLink(seat, port, ours, emulated))
        self.links: dict[str, Link] = {
            seat.context.vehicle: link for seat, link in zip(seats, self._links, strict=True)
        }

    def advance(self, now: Time) -> None:
        self._fleet.advance(now)
        self._router.poll(now)
        for link in self._links:
            link.update(now)

    def close(self) -> None:
        for link in self._links:
            link.close()
        self._fleet.close()
