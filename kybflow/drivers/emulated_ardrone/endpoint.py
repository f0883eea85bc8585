"""An emulated drone at its ports: hears what arrives, steps, and sends what is due."""

from __future__ import annotations

import random
from collections.abc import Callable, Hashable

from kybflow.core.signals import NS, Measurement, Time
from kybflow.drivers.ardrone.protocol.configuration import write_configuration
from kybflow.drivers.emulated_ardrone.onboard.drone import DroneFailures, OnboardDrone
from kybflow.drivers.emulated_ardrone.onboard.radio import DelayLine, Radio
from kybflow.drivers.emulated_ardrone.onboard.telling import Telling
from kybflow.drivers.emulated_ardrone.onboard.video import DroneVideo
from kybflow.drivers.emulated_ardrone.ports.ports import Ports
from kybflow.drivers.emulation.breaking import BreakableLink

Heard = tuple[bytes, Hashable]


class DroneEndpoint:
    """One drone and its ports. generator: the chance of its radio. `video`: what it sends to who
    watches, None for nothing. `on_phase`: called with the time, s, and the state of flight in words
    as it changes."""

    on_phase: Callable[[float, str], None] | None = None
    video: DroneVideo | None = None

    def __init__(self, drone: OnboardDrone, radio: Radio, generator: random.Random) -> None:
        self.drone = drone
        self.telling = Telling(drone)
        self._ports: Ports | None = None
        self._link = BreakableLink(drone.failures, generator)
        self._commands: DelayLine[Heard] = DelayLine(radio, generator)
        self._requests: DelayLine[Heard] = DelayLine(radio, generator)
        self._data: DelayLine[bytes] = DelayLine(radio, generator)
        drone.on_configuration = self._send_configuration

    @property
    def failures(self) -> DroneFailures:
        return self.drone.failures

    def connect(self, ports: Ports) -> None:
        """Speak at these ports."""
        self._ports = ports

    def put_off(self, late: Time) -> None:
        """From now on commands arrive by so much later."""
        self._commands.more = late

    def add_measurement(self, measured: Measurement, now: Time) -> None:
        """Take what the vehicle's own sensors measured."""
        self.drone.add_measurement(measured, now)

    def step(self, now: Time) -> None:
        """Hear, estimate, fly, report."""
        ports, was, was_lost = self._ports, self.drone.flight.phase, self.drone.is_lost
        if ports is not None:
            self._commands.send_all(self._link.received(ports.commands()), now)
            self._requests.send_all(self._link.received(ports.requests()), now)
            for datagram, sender in self._commands.arrived(now):
                self.drone.hear(datagram, sender, now)
            for _, sender in self._requests.arrived(now):
                if ports.answer(sender):
                    self.telling.begin(now)
        self.drone.step(now)
        if self.on_phase is not None and self.drone.flight.phase is not was:
            self.on_phase(now / NS, self.drone.flight.phase.name.lower().replace("_", " "))
        if self.drone.is_lost and not was_lost:
            self._send(now)
            self.telling.end()
        self._send(now)

    def _send(self, now: Time) -> None:
        if self._ports is None:
            return
        packets = self.telling.due(now)
        self._data.send_all((data for data in packets if self._link.sends()), now)
        for data in self._data.arrived(now):
            self._ports.send(data)
        if self.video is not None and self._ports.is_watched:
            self._ports.send_video(self.video.due(now))

    def _send_configuration(self) -> None:
        if self._ports is not None:
            self._ports.send_configuration(write_configuration(self.drone.configuration.values))
