"""How old a command may be, how lines are numbered, and which datagrams count as the drone's."""

from __future__ import annotations

from random import Random

from kybflow.core.signals import NS
from kybflow.drivers.ardrone.at import HOVER, Move, comwdg, config, pcmd, read_commands
from kybflow.drivers.ardrone.navdata import DroneState, write_packet
from kybflow.drivers.ardrone.wire import CommandStream, Gate

MS = NS // 1000


class Clock:
    now = 0

    def __call__(self):
        return self.now


def sent(stream):
    return [command for data in stream.due() for command in read_commands(data)]


def moves(commands):
    return [command.arguments[0] for command in commands if command.name == "PCMD"]


def test_only_the_newest_command_is_sent_and_it_ages():
    stream = CommandStream(clock := Clock())
    assert sent(stream) == []
    stream.hold(True, Move(right=0.5))
    stream.hold(True, Move(right=-0.5))
    first = sent(stream)
    assert [command.name for command in first] == ["REF", "PCMD"]
    assert first[1].arguments == read_commands(pcmd(Move(right=-0.5)).numbered(1))[0].arguments
    clock.now = 200 * MS
    assert moves(sent(stream)) == [1]
    clock.now = 201 * MS
    assert moves(sent(stream)) == [0]  # hover
    clock.now = 250 * MS
    assert moves(sent(stream)) == [0]
    clock.now = 251 * MS
    stream.post(comwdg())
    assert sent(stream) == []
    assert (stream.hovered, stream.ended) == (2, 1)
    stream.hold(True, HOVER)
    assert [command.name for command in sent(stream)] == ["REF", "PCMD"]


def test_numbers_grow_and_begin_anew_when_asked():
    stream = CommandStream(Clock())
    stream.hold(False)
    stream.post(config("a:b", "c"))
    assert [command.sequence for command in sent(stream)] == [1, 2]
    assert [command.sequence for command in sent(stream)] == [3]
    stream.restart()
    assert [command.sequence for command in sent(stream)] == [1]


def test_what_waits_is_spread_over_periods():
    stream = CommandStream(Clock())
    stream.hold(False)
    for number in range(20):
        stream.post(config("a:b", str(number)))
    counts = [len(sent(stream)) for _ in range(4)]
    assert counts == [9, 9, 5, 1]


def test_what_is_foreign_broken_or_old_is_counted():
    gate = Gate()
    good = write_packet(DroneState.DEMO, 5)
    assert gate.admit(good, True, 0) is not None
    assert gate.admit(write_packet(DroneState.DEMO, 6), False, 1) is None
    assert gate.admit(good, True, 2) is None
    assert gate.admit(good[:-1] + b"\x99", True, 3) is None
    assert gate.refused == {"from elsewhere": 1, "not newer": 1, "a wrong checksum": 1}


def test_what_is_refused_is_told_at_ten_and_ten_times_that():
    gate = Gate()
    told = []
    for _ in range(120):
        gate.admit(b"", False, 0)
        told.append(gate.report())
    assert [text for text in told if text] == [
        "10 datagrams were ignored: 10 from elsewhere",
        "100 datagrams were ignored: 100 from elsewhere",
    ]


def test_numbers_begin_anew_after_a_silence_or_the_watchdog():
    gate = Gate()
    for sequence, now, is_new in [(9, 0, True), (1, NS, False), (1, NS + 2, True)]:
        packet = gate.admit(write_packet(DroneState.DEMO, sequence), True, now)
        assert (packet is not None) is is_new
    gate.restart()
    assert gate.admit(write_packet(DroneState.DEMO, 1), True, NS + 3) is not None


def test_ten_thousand_of_a_stranger_are_no_packet():
    gate, chance = Gate(), Random(1)
    good = write_packet(DroneState.DEMO, 2)
    gate.admit(write_packet(DroneState.DEMO, 3), True, 0)
    for number in range(10_000):
        data = chance.choice([chance.randbytes(60), good, good[:30], b"", good + b"\0"])
        assert gate.admit(data, number % 2 == 0, number) is None
    assert gate.refused.total() == 10_000
