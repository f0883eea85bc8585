"""Commands: sent again, answered, refused in the autopilot's own words; the wanted mode against the
reported one."""

from __future__ import annotations

from typing import Any

import pytest
from framing import ARM, INTERVAL, SET_MODE
from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.signals import NS
from kybflow.drivers.mavlink.control.arming import FORCE
from kybflow.drivers.mavlink.control.requests import CommandRequest, CommandRequests, Modes
from kybflow.drivers.mavlink.firmware import profile_of
from kybflow.drivers.mavlink.telemetry.received_status import ReceivedStatus

pytest.importorskip("pymavlink")


MS = NS // 1000


class Peer:
    """An autopilot that hears a request's messages and answers as it is told."""

    def __init__(self, own_system: int = 0) -> None:
        self.heard = ReceivedStatus()
        self.requests = CommandRequests(self.heard, target=(3, 1), own_system=own_system)

    def ask(self, command: int, *params: float, now: int = 0, **more: Any) -> CommandRequest:
        return self.requests.ask(command, *params, now=now, **more)

    def sent(self, now: int) -> list[tuple[int, float, int]]:
        """Command, first parameter and confirmation of what is sent then (ms)."""
        due = self.requests.due(now * MS)
        return [(m.command, m.param1, m.confirmation) for m in due]

    def answer(self, command: int, result: int, now: int, system: int = 0) -> None:
        ack = mavlink.MAVLink_command_ack_message(command, result, target_system=system)
        self.requests.handle(ack, now * MS)

    def say(self, words: str, now: int) -> None:
        self.heard.handle(mavlink.MAVLink_statustext_message(2, words.encode()), now * MS)


def test_a_command_goes_to_its_target_with_its_parameters() -> None:
    peer = Peer()
    peer.ask(SET_MODE, 1, 6)
    (message,) = peer.requests.due(0)
    assert (message.target_system, message.target_component) == (3, 1)
    assert [getattr(message, f"param{i}") for i in range(1, 8)] == [1, 6, 0, 0, 0, 0, 0]


def test_it_is_sent_again_ever_more_slowly_and_then_given_up() -> None:
    peer = Peer()
    request = peer.ask(SET_MODE, 1)
    when = [now for now in range(0, 12_000, 10) if peer.sent(now)]
    assert when == [0, 300, 900, 2100, 4100]
    assert request.outcome == "silent"
    assert request.words == "no answer to DO_SET_MODE, sent 5 times"


def test_the_confirmation_counts_the_times() -> None:
    peer = Peer()
    peer.ask(SET_MODE, 1)
    assert [peer.sent(now)[0] for now in (0, 300, 900)] == [(SET_MODE, 1, i) for i in range(3)]


def test_an_answer_ends_it_and_a_late_one_is_ignored() -> None:
    peer = Peer()
    request = peer.ask(SET_MODE, 1)
    peer.answer(SET_MODE, 4, 0)
    assert request.outcome == "waiting"  # it was not even sent
    peer.sent(0)
    peer.answer(SET_MODE, 0, 20)
    peer.answer(SET_MODE, 4, 30)
    assert (request.outcome, request.words) == ("accepted", "")
    assert peer.sent(300) == []


def test_an_answer_to_somebody_else_is_not_ours() -> None:
    peer = Peer(own_system=245)
    request = peer.ask(SET_MODE, 1)
    peer.sent(0)
    peer.answer(SET_MODE, 4, 1, system=255)
    assert request.outcome == "waiting"
    peer.answer(SET_MODE, 0, 2, system=245)
    assert request.outcome == "accepted"


def test_a_refusal_waits_for_its_reason() -> None:
    peer = Peer()
    peer.say("Arm: of the last time", 0)
    request = peer.ask(ARM, 1, now=5 * MS)
    peer.sent(5)
    peer.answer(ARM, 1, 100)
    assert peer.sent(399) == []
    assert request.outcome == "waiting"
    peer.say("Arm: not level", 399)
    peer.sent(400)
    assert request.outcome == "refused"
    assert request.words == "refused (TEMPORARILY_REJECTED): Arm: not level"


@pytest.mark.parametrize(
    ("result", "word"), [(2, "DENIED"), (3, "UNSUPPORTED"), (4, "FAILED"), (99, "result 99")]
)
def test_a_refusal_without_a_word(result: int, word: str) -> None:
    peer = Peer()
    request = peer.ask(ARM, 1)
    peer.sent(0)
    peer.answer(ARM, result, 1)
    peer.sent(400)
    assert request.words == f"refused ({word}), for an unknown reason"


def test_two_commands_wait_at_once() -> None:
    peer = Peer()
    mode, arm = peer.ask(SET_MODE, 1), peer.ask(ARM, 1)
    assert peer.sent(0) == [(SET_MODE, 1, 0), (ARM, 1, 0)]
    peer.answer(ARM, 0, 1)
    assert (mode.outcome, arm.outcome) == ("waiting", "accepted")


def test_what_is_in_progress_is_not_sent_again_but_must_end() -> None:
    peer = Peer()
    request = peer.ask(ARM, 1)
    peer.sent(0)
    peer.answer(ARM, 5, 100)
    assert peer.sent(10_099) == []
    assert request.outcome == "waiting"
    peer.sent(10_100)
    assert request.outcome == "silent"
    assert request.words == "COMPONENT_ARM_DISARM began, but its end was not reported"


def test_many_of_one_command_take_turns() -> None:
    peer = Peer()
    requests = [peer.ask(INTERVAL, stream) for stream in (30, 31, 32)]
    assert peer.sent(0) == [(INTERVAL, 30, 0)]
    assert peer.sent(100) == []
    peer.answer(INTERVAL, 2, 110)
    assert peer.sent(110) == [(INTERVAL, 31, 0)]
    peer.answer(INTERVAL, 0, 120)
    assert peer.sent(120) == [(INTERVAL, 32, 0)]
    peer.sent(410)
    assert [r.outcome for r in requests] == ["refused", "accepted", "waiting"]


def test_asking_again_for_what_waits_sends_nothing_more() -> None:
    peer = Peer()
    first = peer.ask(SET_MODE, float("nan"))
    assert peer.ask(SET_MODE, float("nan"), now=10) is first
    assert len(peer.sent(20)) == 1


def test_a_newer_request_on_the_same_matter_goes_at_once_and_ends_the_older() -> None:
    """No late retry may arm what was disarmed, and no late answer may speak for the newer one."""
    peer = Peer()
    arm = peer.ask(ARM, 1)
    peer.sent(0)
    disarm = peer.ask(ARM, 0, FORCE, now=50 * MS)
    assert (arm.outcome, arm.words) == ("refused", "a newer request replaced it")
    assert peer.sent(50) == [(ARM, 0, 0)]
    peer.answer(ARM, 4, 60)
    assert disarm.outcome == "waiting"
    assert peer.sent(350) == [(ARM, 0, 1)]
    peer.answer(ARM, 0, 360)
    assert disarm.outcome == "accepted"
    assert peer.sent(5000) == []


def test_an_older_request_that_was_never_answered_does_not_stand_in_the_way() -> None:
    peer = Peer()
    peer.ask(ARM, 1)
    peer.sent(0)
    disarm = peer.ask(ARM, 0, now=290 * MS)
    peer.sent(290)
    peer.sent(300)
    peer.answer(ARM, 0, 310)
    assert disarm.outcome == "accepted"


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


def wanting() -> Talk:
    """One that is in STABILIZE and is to follow setpoints."""
    talk = Talk()
    talk.report("STABILIZE")
    talk.modes.want("offboard")
    return talk


def test_an_acknowledgement_is_not_the_mode():
    talk = wanting()
    assert talk.run(1.0) == [(SET_MODE, 4.0)]
    assert not talk.modes.in_force
    talk.report("offboard")
    assert talk.modes.step(talk.now)


def test_what_does_not_show_is_asked_again_ever_more_seldom():
    talk = wanting()
    assert 4 <= len(talk.run(15.0)) <= 8


def test_why_not_is_in_its_own_words():
    talk = wanting()
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
    talk = wanting()
    talk.run(0.1)
    talk.report("offboard")
    talk.run(0.1)
    assert talk.modes.before == talk.profile.modes["STABILIZE"]
