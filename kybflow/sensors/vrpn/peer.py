"""One end of a VRPN link without its socket: which numbers names have, and what messages mean."""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.signals import Time
from kybflow.sensors.vrpn.codec import (
    PING,
    PONG,
    POSE,
    SENDER,
    TEXT,
    TYPE,
    UDP,
    CodecError,
    Message,
    MessageDecoder,
    PoseReport,
    decode_datagram,
    decode_pose,
    decode_text,
    describe,
    described,
    encode,
    point_to,
    pointed_to,
)


class SenderStatus(NamedTuple):
    """Something other than a pose. kind: PING, PONG or TEXT."""

    kind: str
    text: str = ""
    severity: int = 0


class SenderMessage(NamedTuple):
    """Something the peer said: of `sender`, a name, at `stamp` of its clock."""

    sender: str
    stamp: Time
    what: PoseReport | SenderStatus


class Peer:
    """Reads what the other end sends and writes what is sent to it. `datagrams_to` is where it
    wants datagrams, None where it did not say. `senders`: its names by number."""

    def __init__(self) -> None:
        self.datagrams_to: tuple[str, int] | None = None
        self.senders: dict[int, str] = {}
        self._types: dict[int, str] = {}
        self._decoder = MessageDecoder()
        self._told: dict[int, dict[str, int]] = {SENDER: {}, TYPE: {}}
        self._sequence = self._datagram = 0

    @property
    def greeted(self) -> bool:
        """Whether the peer's cookie has come."""
        return self._decoder.version is not None

    def hear(self, data: bytes) -> list[SenderMessage]:
        """What came over TCP. Raises CodecError; then the link must be closed."""
        return self._meaning(self._decoder.feed(data))

    def hear_datagram(self, data: bytes) -> list[SenderMessage]:
        """What came in one datagram. Raises CodecError; the link is as good as before."""
        messages = decode_datagram(data)
        if any(message.type < 0 for message in messages):
            raise CodecError("a description in a datagram")
        return self._meaning(messages)

    def say(self, sender: str, kind: str, stamp: Time, payload: bytes = b"") -> bytes:
        """A message for TCP, after the descriptions that the peer needs for it."""
        introduction = self.introduce(sender, kind)
        return introduction + self._numbered(self._message(sender, kind, stamp, payload))

    def say_in_datagram(self, sender: str, kind: str, stamp: Time, payload: bytes = b"") -> bytes:
        """A message for a datagram; both names must have been introduced."""
        self._datagram += 1
        return encode(self._message(sender, kind, stamp, payload), self._datagram - 1)

    def ask_for_datagrams(self, address: str, port: int) -> bytes:
        """For TCP: where datagrams are to go."""
        return self._numbered(point_to(address, port))

    def introduce(self, sender: str, *kinds: str) -> bytes:
        """The descriptions, for TCP, of those names that the peer has not been told yet."""
        out = b""
        for table, name in ((SENDER, sender), *((TYPE, kind) for kind in kinds)):
            told = self._told[table]
            if name not in told:
                out += self._numbered(describe(table, len(told), name))
                told[name] = len(told)
        return out

    def _message(self, sender: str, kind: str, stamp: Time, payload: bytes) -> Message:
        return Message(stamp, self._told[SENDER][sender], self._told[TYPE][kind], payload)

    def _numbered(self, message: Message) -> bytes:
        self._sequence += 1
        return encode(message, self._sequence - 1)

    def _meaning(self, messages: list[Message]) -> list[SenderMessage]:
        heard = []
        for message in messages:
            if message.type < 0:
                self._learn(message)
                continue
            sender, kind = self.senders.get(message.sender), self._types.get(message.type)
            if sender is None:
                continue  # a datagram can be faster than the description of its sender
            if kind == POSE:
                heard.append(SenderMessage(sender, message.stamp, decode_pose(message.payload)))
            elif kind in (PING, PONG):
                heard.append(SenderMessage(sender, message.stamp, SenderStatus(kind)))
            elif kind == TEXT:
                severity, text = decode_text(message.payload)
                heard.append(
                    SenderMessage(sender, message.stamp, SenderStatus(TEXT, text, severity))
                )
        return heard

    def _learn(self, message: Message) -> None:
        """A system message; of those that log or end a log there is nothing to learn."""
        if message.type in (SENDER, TYPE):
            number, name = described(message)
            (self.senders if message.type == SENDER else self._types)[number] = name
        elif message.type == UDP:
            self.datagrams_to = pointed_to(message)
