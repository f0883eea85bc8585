"""An emulated drone with its ports: it receives datagrams, makes a step, and sends what is due."""

from __future__ import annotations

import random
from collections.abc import Callable, Hashable

from kybflow.core.signals import NS, Measurement, Time
from kybflow.drivers.ardrone.protocol.configuration import write_configuration
from kybflow.drivers.emulated_ardrone.onboard.drone import DroneFailures, OnboardDrone
from kybflow.drivers.emulated_ardrone.onboard.navdata import NavdataSender
from kybflow.drivers.emulated_ardrone.onboard.radio import DelayLine, Radio
from kybflow.drivers.emulated_ardrone.onboard.video import DroneVideo
from kybflow.drivers.emulated_ardrone.ports import Ports
from kybflow.drivers.emulation.breaking import BreakableLink

Received = tuple[bytes, Hashable]


class DroneEndpoint:
    """One drone and its ports. generator: draws the radio's delays and losses. video: the drone's
    video; None without video. on_phase: called with the time (s) and the flight phase whenever the
    phase changes."""

    on_phase: Callable[[float, str], None] | None = None
    video: DroneVideo | None = None

    def __init__(self, drone: OnboardDrone, radio: Radio, generator: random.Random) -> None:
        self.drone = drone
        self.navdata = NavdataSender(drone)
        self._ports: Ports | None = None
        self._link = BreakableLink(drone.failures, generator)
        self._commands: DelayLine[Received] = DelayLine(radio, generator)
        self._requests: DelayLine[Received] = DelayLine(radio, generator)
        self._data: DelayLine[bytes] = DelayLine(radio, generator)
        drone.on_configuration = self._send_configuration

    @property
    def failures(self) -> DroneFailures:
        return self.drone.failures

    def connect(self, ports: Ports) -> None:
        self._ports = ports

    def set_delay(self, late: Time) -> None:
        """Delay commands by `late` beyond the radio's delay."""
        self._commands.more = late

    def add_measurement(self, measured: Measurement, now: Time) -> None:
        self.drone.add_measurement(measured, now)

    def step(self, now: Time) -> None:
        """Make one step: receive, estimate, fly and send."""
        ports, was, was_lost = self._ports, self.drone.flight.phase, self.drone.is_lost
        if ports is not None:
            self._commands.send_all(self._link.received(ports.commands()), now)
            self._requests.send_all(self._link.received(ports.requests()), now)
            for datagram, sender in self._commands.arrived(now):
                self.drone.receive(datagram, sender, now)
            for _, sender in self._requests.arrived(now):
                if ports.answer(sender):
                    self.navdata.begin(now)
        self.drone.step(now)
        if self.on_phase is not None and self.drone.flight.phase is not was:
            self.on_phase(now / NS, self.drone.flight.phase.name.lower().replace("_", " "))
        if self.drone.is_lost and not was_lost:
            self._send(now)
            self.navdata.end()
        self._send(now)

    def _send(self, now: Time) -> None:
        if self._ports is None:
            return
        packets = self.navdata.due(now)
        self._data.send_all((data for data in packets if self._link.sends()), now)
        for data in self._data.arrived(now):
            self._ports.send(data)
        if self.video is not None and self._ports.is_watched:
            self._ports.send_video(self.video.due(now))

    def _send_configuration(self) -> None:
        if self._ports is not None:
            self._ports.send_configuration(write_configuration(self.drone.configuration.values))
