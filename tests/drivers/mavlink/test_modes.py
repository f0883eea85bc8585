"""The wanted mode against the reported one."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink")

from framing import SET_MODE
from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.signals import NS
from kybflow.drivers.mavlink.control.requests import CommandRequests, Modes
from kybflow.drivers.mavlink.firmware import profile_of
from kybflow.drivers.mavlink.telemetry.received_status import ReceivedStatus

TICK = NS // 50


class Talk:
    def __init__(self, name="ardupilot"):
        self.profile = profile_of(name)
        self.heard = ReceivedStatus()
        self.requests = CommandRequests(self.heard, target=(1, 1))
        self.modes = Modes(self.profile, self.heard, self.requests)
        self.now = 0
        self.result = 0

    def report(self, mode):
        maker, number = 3, self.profile.modes[mode]
        self.heard.handle(mavlink.MAVLink_heartbeat_message(2, maker, 0, number, 3, 3), self.now)

    def run(self, seconds):
        """What is sent meanwhile; every command is answered with `result`."""
        sent = []
        for _ in range(round(seconds * 50)):
            self.now += TICK
            self.modes.step(self.now)
            for message in self.requests.due(self.now):
                sent.append((message.command, message.param2))
                ack = mavlink.MAVLink_command_ack_message(message.command, self.result)
                self.requests.handle(ack, self.now)
        return sent


def test_an_acknowledgement_is_not_the_mode():
    talk = Talk()
    talk.report("STABILIZE")
    talk.modes.want("offboard")
    assert talk.run(1.0) == [(SET_MODE, 4.0)]
    assert not talk.modes.in_force
    talk.report("offboard")
    assert talk.modes.step(talk.now)


def test_what_does_not_show_is_asked_again_ever_more_seldom():
    talk = Talk()
    talk.report("STABILIZE")
    talk.modes.want("offboard")
    assert 4 <= len(talk.run(15.0)) <= 8


def test_why_not_is_in_its_own_words():
    talk = Talk()
    talk.report("STABILIZE")
    talk.modes.want("offboard")
    talk.result = 4
    talk.heard.handle(mavlink.MAVLink_statustext_message(3, b"Mode change failed"), TICK)
    talk.run(1.0)
    assert "from STABILIZE to GUIDED" in talk.modes.trouble
    assert "FAILED" in talk.modes.trouble
    assert "Mode change failed" in talk.modes.trouble


def test_a_mode_that_was_in_force_and_was_left_is_not_asked_for_again():
    talk = Talk()
    talk.report("offboard")
    talk.modes.want("offboard")
    talk.run(0.1)
    talk.report("LOITER")
    assert talk.run(10.0) == []
    assert talk.modes.has_left
    talk.modes.again()
    assert talk.run(0.1) == [(SET_MODE, 4.0)]


def test_the_mode_before_the_first_wish_is_remembered():
    talk = Talk()
    talk.report("STABILIZE")
    talk.modes.want("offboard")
    talk.run(0.1)
    talk.report("offboard")
    talk.run(0.1)
    assert talk.modes.before == talk.profile.modes["STABILIZE"]
