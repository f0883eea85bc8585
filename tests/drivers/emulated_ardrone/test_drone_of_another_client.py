"""A drone that another client controls is named before the flight, over real sockets."""

from __future__ import annotations

import random
import socket
from contextlib import closing
from dataclasses import replace

import pytest
from served_drones import free_host
from sim_worlds import QUIET, seat
from waiting import until

from kybflow.core.signals import NS
from kybflow.drivers.ardrone import at
from kybflow.drivers.ardrone.link import ArdroneLink
from kybflow.drivers.ardrone.params import ArdroneParams
from kybflow.drivers.ardrone.udp import UdpWire
from kybflow.drivers.ardrone.wire import AT
from kybflow.drivers.emulated_ardrone.endpoint import Radio
from kybflow.drivers.emulated_ardrone.ports import SocketPorts
from kybflow.drivers.emulated_ardrone.session import MAX_STEP_NS, open_fleet

PLAIN = replace(QUIET, physics=250.0)


class TakenDrone:
    """A drone on loopback that another client commands, and our link to it. Time is simulated."""

    def __init__(self, *lines):
        self.fleet = open_fleet([seat(params=PLAIN)], [Radio()], random.Random(1))
        self.ports = SocketPorts(free_host())
        self.fleet.members[0].onboard.connect(self.ports)
        self.other = socket.socket(type=socket.SOCK_DGRAM)
        self.other.connect((self.ports.host, AT))
        self.lines, self.now, self.sequence = lines, 0, 0
        self.run(0.1)  # so that it is the first
        where = ArdroneParams(host=self.ports.host)
        self.link = ArdroneLink(seat(params=where), UdpWire(where.host, 200.0), "0000abcd")

    def run(self, seconds, link=None):
        for _ in range(round(seconds * NS / MAX_STEP_NS)):
            self.now += MAX_STEP_NS
            for line in self.lines:
                self.sequence += 1
                self.other.send(line.numbered(self.sequence))
            self.fleet.advance(self.now)
            if link is not None:
                link.update(self.now)

    def others(self):
        """Let time pass; return the lines about another client."""
        self.run(0.02, self.link)
        return [line for line in self.link.checks(self.now) if line.name == "other client"]

    def close(self):
        self.link.close()
        self.other.close()
        self.ports.close()
        self.fleet.close()


OUT = at.config("general:navdata_demo", "TRUE")


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ((OUT, at.ref(flies=False)), "it sends data but obeys no command"),
        ((OUT, at.ref(flies=True)), "it flew before this run gave a command"),
    ],
)
def test_another_client_s_drone_is_told_before_the_flight(lines, words):
    with closing(TakenDrone(*lines)) as taken:
        until(taken.others, "another client")
        (found,) = taken.others()
    assert found.reason.startswith(words)
    assert "set the driver's `host`" in found.reason
    assert not found.green


def test_a_drone_of_one_s_own_has_no_line_about_another_client():
    with closing(TakenDrone()) as drone:
        until(
            lambda: drone.others() is not None and drone.link.configuring.found, "the configuration"
        )
        assert drone.others() == []
