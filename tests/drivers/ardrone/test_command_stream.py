"""How old a command may be, and how lines are numbered."""

from __future__ import annotations

from kybflow.core.signals import NS
from kybflow.drivers.ardrone.at import HOVER, Move, comwdg, config, pcmd, read_commands
from kybflow.drivers.ardrone.wire import CommandStream

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
