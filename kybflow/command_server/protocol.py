"""The messages between a run and its clients: JSON objects in UTF-8, one per line.

    {"id": 1, "name": "anna at pts/3", "keeps_lease": true}       names the client
    {"id": 2, "command": "switch mk hold", "take": true}          gives a command
    {"id": 3, "ask": "state"}                                     asks for the state of the run
    {"id": 4, "ask": "watch"}                                     asks for every event from now on

    {"id": 2, "accepted": false, "reason": "`mk` has no state `hold`"}
    {"id": 3, "accepted": true, "reason": "", "state": {...}}
    {"event": {"t_s": 3.24, "event": "landed", ...}}              an event, to clients that watch
    {"missed": 12}                                                the number of events not sent

`keeps_lease` and `take` are optional and false by default. Each request has one answer; the answer
to an unreadable request has the id null. A client without a name is named after the user and the
process that the kernel reports.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

from kybflow.core.errors import CommandUnreadable
from kybflow.runtime.commanding.orders import Answer, Order, parse

LONGEST_LINE = 16 * 1024
"""The most bytes in a line to the server: enough for the longest command with every letter escaped.
"""
LONGEST_NAME = 80
"""The most letters in a client's name."""
MOST_ID = 2**53


class MessageUnreadable(ValueError):
    """A line is not a valid request; the message says why. id: the request's id, if it is known."""

    def __init__(self, reason: str, id: int | None = None) -> None:
        super().__init__(reason)
        self.id = id


@dataclass(frozen=True, slots=True)
class Introduction:
    """Names the client. keeps_lease: whether it keeps the lease when it disconnects."""

    id: int
    name: str
    keeps_lease: bool = False


@dataclass(frozen=True, slots=True)
class OrderRequest:
    """A command. take: whether to take the lease from another client."""

    id: int
    order: Order
    take: bool = False


@dataclass(frozen=True, slots=True)
class StateRequest:
    """Asks for the state of the run and its legal commands."""

    id: int


@dataclass(frozen=True, slots=True)
class WatchRequest:
    """Asks for every event from now on."""

    id: int


Request = Introduction | OrderRequest | StateRequest | WatchRequest

_ASKED: Mapping[str, type[StateRequest | WatchRequest]] = {
    "state": StateRequest,
    "watch": WatchRequest,
}
_MAY_HAVE: Mapping[str, str | None] = {"name": "keeps_lease", "command": "take", "ask": None}
"""The key that marks each kind of request, and its optional key."""


class LineBuffer:
    """Splits a stream of bytes into lines. A line that is too long is dropped, so that the buffer
    never holds more than one line and the newest data."""

    def __init__(self, longest: int) -> None:
        self._longest = longest
        self._bytes = bytearray()
        self._searched = 0
        self._skips = False

    def feed(self, data: bytes) -> None:
        self._bytes += data

    def next(self) -> bytes | None:
        """Return the next non-empty line without its line feed, or None. Raises MessageUnreadable
        for a line that is too long."""
        while True:
            end = self._bytes.find(b"\n", self._searched)
            if end < 0:
                self._searched = len(self._bytes)
                if self._searched > self._longest:
                    self._bytes.clear()
                    self._searched, self._skips = 0, True
                return None
            line = bytes(self._bytes[:end])
            del self._bytes[: end + 1]
            self._searched = 0
            skipped, self._skips = self._skips, False
            if skipped or len(line) > self._longest:
                raise MessageUnreadable(f"a message has at most {self._longest} bytes")
            if line.strip():
                return line

    @property
    def has_more(self) -> bool:
        """Whether a line has begun but not ended."""
        return bool(self._bytes) or self._skips


def read_request(line: bytes) -> Request:
    """Read a request. Raises MessageUnreadable."""
    message = read_message(line)
    number = message.get("id")
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number <= MOST_ID:
        raise MessageUnreadable(f"`id` is not a whole number from 0 to {MOST_ID}")
    kinds = [key for key in _MAY_HAVE if key in message]
    if len(kinds) != 1:
        raise MessageUnreadable("a request has one of `command`, `ask` and `name`", number)
    [kind] = kinds
    flag = _MAY_HAVE[kind]
    for key in message:
        if key not in ("id", kind, flag):
            raise MessageUnreadable(f"a `{kind}` has no {_shown(key)}", number)
    value, flagged = message[kind], message.get(flag, False) if flag else False
    if not isinstance(value, str) or not value.isprintable():
        raise MessageUnreadable(f"`{kind}` is not printable text", number)
    if not isinstance(flagged, bool):
        raise MessageUnreadable(f"`{flag}` is neither true nor false", number)
    return _request(number, kind, value, flagged)


def _request(id: int, kind: str, value: str, flagged: bool) -> Request:
    if kind == "name":
        if not 0 < len(value.strip()) <= LONGEST_NAME:
            raise MessageUnreadable(f"a name has 1 to {LONGEST_NAME} characters", id)
        return Introduction(id, value.strip(), flagged)
    if kind == "ask":
        if value not in _ASKED:
            raise MessageUnreadable("`ask` is neither `state` nor `watch`", id)
        return _ASKED[value](id)
    try:
        return OrderRequest(id, parse(value), flagged)
    except CommandUnreadable as error:
        raise MessageUnreadable(str(error), id) from None


def read_message(line: bytes) -> dict[str, Any]:
    """Read the JSON object in a line. Raises MessageUnreadable."""
    try:
        message = json.loads(
            line.decode("utf-8"), parse_constant=_no_number, object_pairs_hook=_unique
        )
    except MessageUnreadable:
        raise
    except (ValueError, RecursionError):
        raise MessageUnreadable("the line is not JSON") from None
    if not isinstance(message, dict):
        raise MessageUnreadable("the line is not a JSON object")
    return message


def _no_number(_: str) -> NoReturn:
    raise MessageUnreadable("JSON has no NaN and no infinity")


def _unique(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise MessageUnreadable(f"{_shown(key)} is given twice")
        found[key] = value
    return found


def _shown(key: str) -> str:
    return f"`{key}`" if len(key) <= 40 and key.isprintable() else "such key"


def introduction(id: int, name: str, *, keeps_lease: bool = False) -> bytes:
    """Return the line that names a client."""
    return _line({"id": id, "name": name, "keeps_lease": keeps_lease})


def command(id: int, words: str, *, take: bool = False) -> bytes:
    """Return the line of a command."""
    return _line({"id": id, "command": words, "take": take})


def question(id: int, about: str) -> bytes:
    """Return the line that asks for `state` or `watch`."""
    return _line({"id": id, "ask": about})


def answer(id: int | None, answer: Answer) -> bytes:
    """Return the line that answers a request. id: None if the request was unreadable."""
    return _line({"id": id, "accepted": answer.accepted, "reason": answer.reason})


def state(id: int, state: str) -> bytes:
    """Return the line that answers `state`. state: already JSON, because many clients may receive
    it."""
    return f'{{"id": {id}, "accepted": true, "reason": "", "state": {state}}}\n'.encode()


def event(record: Mapping[str, Any]) -> bytes:
    """Return the line of an event, which is as in `events.jsonl`."""
    return _line({"event": record})


def missed(count: int) -> bytes:
    """Return the line with the number of events that a watching client didn't receive."""
    return _line({"missed": count})


def _line(message: Mapping[str, Any]) -> bytes:
    return json.dumps(message, ensure_ascii=True).encode() + b"\n"
