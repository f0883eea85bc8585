"""A test bench: an emulated drone on the simulator, and a client that sends raw AT commands."""

from __future__ import annotations

import random
from dataclasses import replace

from sim_worlds import QUIET, seat

from kybflow.core.signals import NS
from kybflow.drivers.ardrone.protocol import at
from kybflow.drivers.ardrone.protocol.navdata.options import demo
from kybflow.drivers.ardrone.protocol.navdata.packet import read_packet
from kybflow.drivers.ardrone.protocol.navdata.state import DroneState, Phase
from kybflow.drivers.emulated_ardrone.onboard.radio import Radio
from kybflow.drivers.emulated_ardrone.ports import MemoryPorts
from kybflow.drivers.emulated_ardrone.session import PERIOD, open_fleet

PLAIN = replace(QUIET, physics=250.0)


class DroneBench:
    """One drone. `fly`: what is sent every 20 ms from now on. `packets`: all that came."""

    def __init__(self, radio=None, seed=1, params=PLAIN):
        self.fleet = open_fleet([seat(params=params)], [radio or Radio()], random.Random(seed))
        self.endpoint = self.fleet.members[0].onboard
        self.drone, self.ports = self.endpoint.drone, MemoryPorts()
        self.endpoint.connect(self.ports)
        self.now, self.sequence, self.packets = 0, 0, []
        self.lines = None

    def say(self, *lines, sequence=None):
        """Send these at once."""
        for line in lines:
            self.sequence += sequence is None
            self.ports.at.append(line.numbered(self.sequence if sequence is None else sequence))

    def ask(self):
        self.ports.asked.append(b"\1")

    def configured(self):
        """Out of bootstrap, and asked."""
        self.ask()
        self.say(at.config("general:navdata_demo", "FALSE"), at.ctrl(at.RESET_ACKNOWLEDGE))
        self.run(0.1)
        return self

    def fly(self, *lines):
        self.lines = lines

    def run(self, seconds, until=lambda: False):
        """Let time pass; whether `until` came true."""
        for _ in range(round(seconds * NS / PERIOD)):
            self.now += PERIOD
            if self.lines and self.now % (5 * PERIOD) == 0:
                self.say(*self.lines)
            self.fleet.advance(self.now)
            while self.ports.sent:
                self.packets.append(read_packet(self.ports.sent.popleft()))
            if until():
                return True
        return until()

    @property
    def state(self):
        return self.packets[-1].state

    @property
    def demo(self):
        return demo(self.packets[-1].options)

    @property
    def height(self):
        return self.fleet.members[0].vehicle.truth().position[2]

    def is_in(self, *phases):
        return lambda: self.drone.flight.phase in phases

    def hovering(self):
        """In the air."""
        self.fly(at.ref(True), at.pcmd(at.HOVER))
        assert self.run(10.0, self.is_in(Phase.HOVERING)), self.demo
        return self


__all__ = ["DroneBench", "DroneState", "Phase", "Radio", "at"]
