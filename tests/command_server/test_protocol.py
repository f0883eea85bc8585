"""The messages at the socket: whatever arrives is a request or is refused with a reason."""

from __future__ import annotations

import json
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.command_server import protocol
from kybflow.command_server.protocol import (
    LONGEST_LINE,
    LONGEST_NAME,
    Introduction,
    LineBuffer,
    MessageUnreadable,
    OrderRequest,
    StateRequest,
    WatchRequest,
    read_message,
    read_request,
)
from kybflow.dsl.plan import Emit, Switch
from kybflow.runtime.commanding.orders import (
    MOST_LETTERS,
    Answer,
    LandOrder,
    PauseOrder,
    ReleaseLease,
    text,
)

LETTERS = 'az09_.ä"\\ \u2028\n\x1b\x00\U0001f680'
"""What a name may have, and what JSON, a terminal or a line finds hard."""
WORDS = st.text('az09_ä"\\\U0001f680', min_size=1, max_size=20)
ORDERS = st.one_of(
    st.builds(Emit, WORDS.map(lambda word: f"operator.{word}x")),
    st.builds(Switch, WORDS, WORDS),
    st.builds(LandOrder, st.lists(WORDS, unique=True, max_size=3).map(tuple)),
    st.just(PauseOrder()),
    st.just(ReleaseLease()),
)
NUMBERS = st.integers(0, 2**53)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(LETTERS, max_size=20),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(LETTERS, max_size=9), inner)
    ),
    max_leaves=6,
)
NEARLY = st.dictionaries(
    st.sampled_from(["id", "command", "ask", "name", "take", "keeps_lease", "else"]),
    JSON | st.sampled_from(["state", "watch", "stop", "pause mk", 1, True]),
)


@given(NUMBERS, ORDERS, st.booleans())
def test_a_command_is_read_as_it_was_written(number: int, order, take: bool) -> None:
    line = protocol.command(number, text(order), take=take)
    assert line.endswith(b"\n")
    assert read_request(line.strip()) == OrderRequest(number, order, take)


def test_the_other_requests_are_read_as_they_were_written() -> None:
    hello = protocol.introduction(1, "anna at pts/3", keeps_lease=True)
    assert read_request(hello) == Introduction(1, "anna at pts/3", True)
    assert read_request(protocol.question(2, "state")) == StateRequest(2)
    assert read_request(protocol.question(3, "watch")) == WatchRequest(3)


@given(NUMBERS, st.booleans(), st.text(LETTERS))
def test_an_answer_is_read_as_it_was_written(number: int, accepted: bool, reason: str) -> None:
    line = protocol.answer(number, Answer(accepted, reason))
    assert line.count(b"\n") == 1
    assert read_message(line) == {"id": number, "accepted": accepted, "reason": reason}


@given(st.binary(max_size=200) | NEARLY.map(lambda value: json.dumps(value).encode()))
def test_whatever_arrives_is_a_request_or_refused_in_short(line: bytes) -> None:
    try:
        found = read_request(line)
    except MessageUnreadable as error:
        found = error
    if isinstance(found, MessageUnreadable):
        assert 0 < len(str(found)) < 300
        assert str(found).isprintable()
    else:
        assert isinstance(found, OrderRequest | Introduction | StateRequest | WatchRequest)


@pytest.mark.parametrize(
    ("line", "reason", "number"),
    [
        (b"", "the line is not JSON", None),
        (b"\xff{}", "the line is not JSON", None),
        (b"[" * 10_000, "the line is not JSON", None),
        (b"9" * 10_000, "the line is not JSON", None),
        (b"[1]", "the line is not a JSON object", None),
        (b'{"id": NaN}', "JSON has no NaN and no infinity", None),
        (b'{"id": 1, "id": 2, "ask": "state"}', "`id` is given twice", None),
        (b'{"id": true, "ask": "state"}', "`id` is not a whole number from 0", None),
        (b'{"id": -1, "ask": "state"}', "`id` is not a whole number from 0", None),
        (b'{"ask": "state"}', "`id` is not a whole number from 0", None),
        (b'{"id": 7}', "a request has one of `command`, `ask` and `name`", 7),
        (b'{"id": 7, "ask": "state", "name": "a"}', "a request has one of", 7),
        (b'{"id": 7, "ask": "state", "take": true}', "a `ask` has no `take`", 7),
        (b'{"id": 7, "command": "stop", "\\u001b[2J": 1}', "a `command` has no such key", 7),
        (b'{"id": 7, "command": "stop", "take": 1}', "`take` is neither true nor false", 7),
        (b'{"id": 7, "command": ["stop"]}', "`command` is not printable text", 7),
        (b'{"id": 7, "command": "stop \\ud800"}', "`command` is not printable text", 7),
        (b'{"id": 7, "command": "stop\\u001b[2J"}', "`command` is not printable text", 7),
        (b'{"id": 7, "command": "stpo"}', "there is no command `stpo`; did you mean `stop`?", 7),
        (b'{"id": 7, "command": "switch mk"}', "`switch` is written `switch VEHICLE", 7),
        (b'{"id": 7, "ask": "land"}', "`ask` is neither `state` nor `watch`", 7),
        (b'{"id": 7, "name": "  "}', f"a name has 1 to {LONGEST_NAME} characters", 7),
    ],
)
def test_what_is_no_request_is_refused(line: bytes, reason: str, number: int | None) -> None:
    with pytest.raises(MessageUnreadable) as refused:
        read_request(line)
    assert reason in str(refused.value)
    assert refused.value.id == number


def test_the_longest_command_fits_however_it_is_escaped() -> None:
    words = "stop " + "\U0001f680" * (MOST_LETTERS - 5)
    line = protocol.command(2**53, words, take=True)
    assert len(line) <= LONGEST_LINE
    assert isinstance(read_request(line), OrderRequest)


def lines(chunks: list[bytes], longest: int = 20) -> list[bytes | str]:
    """The lines of a stream, and `long` for each that was too long."""
    buffer, found = LineBuffer(longest), []
    for chunk in chunks:
        buffer.feed(chunk)
        while True:
            try:
                line = buffer.next()
            except MessageUnreadable:
                found.append("long")
                continue
            if line is None:
                break
            found.append(line)
    return found


@given(
    st.lists(st.binary(max_size=30)).map(b"\n".join),
    st.lists(st.integers(0, 400), max_size=8).map(sorted),
)
def test_lines_are_the_same_however_they_arrive(stream: bytes, cuts: list[int]) -> None:
    edges = [0, *(min(cut, len(stream)) for cut in cuts), len(stream)]
    pieces = [stream[a:b] for a, b in pairwise(edges)]
    whole = [line for line in stream.split(b"\n")[:-1] if line.strip() or len(line) > 20]
    expected = [line if len(line) <= 20 else "long" for line in whole]
    assert lines(pieces) == lines([stream]) == expected


def test_a_line_without_end_takes_no_room_and_is_told_once() -> None:
    buffer = LineBuffer(100)
    for _ in range(1000):
        buffer.feed(b"x" * 50)
        assert buffer.next() is None
        assert len(buffer._bytes) <= 150
    assert buffer.has_more
    buffer.feed(b"x\nnext\n")
    with pytest.raises(MessageUnreadable, match="at most 100 bytes"):
        buffer.next()
    assert buffer.next() == b"next"
    assert not buffer.has_more
