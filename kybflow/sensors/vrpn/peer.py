"""One end of a VRPN connection without its socket: encodes and decodes messages by names."""

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
    read_target,
    target_message,
)


class SenderStatus(NamedTuple):
    """Something other than a pose. kind: PING, PONG or TEXT."""

    kind: str
    text: str = ""
    severity: int = 0


class SenderMessage(NamedTuple):
    """A decoded message. sender: a name. stamp: of the peer's clock."""

    sender: str
    stamp: Time
    what: PoseReport | SenderStatus


class Peer:
    """Decodes what the other end sends and encodes what it receives. `datagrams_to`: where it wants
    datagrams; None if unknown. `senders`: its names by number."""

    def __init__(self) -> None:
        self.datagrams_to: tuple[str, int] | None = None
        self.senders: dict[int, str] = {}
        self._types: dict[int, str] = {}
        self._decoder = MessageDecoder()
        self._introduced: dict[int, dict[str, int]] = {SENDER: {}, TYPE: {}}
        self._sequence = self._datagram = 0

    @property
    def is_connected(self) -> bool:
        """Whether the peer's cookie has arrived."""
        return self._decoder.version is not None

    def receive(self, data: bytes) -> list[SenderMessage]:
        """Decode bytes from TCP. Raises CodecError, after which the connection must be closed."""
        return self._decode(self._decoder.feed(data))

    def receive_datagram(self, data: bytes) -> list[SenderMessage]:
        """Decode a datagram. Raises CodecError, which doesn't affect the connection."""
        messages = decode_datagram(data)
        if any(message.type < 0 for message in messages):
            raise CodecError("a description in a datagram")
        return self._decode(messages)

    def message(self, sender: str, kind: str, stamp: Time, payload: bytes = b"") -> bytes:
        """Encode a message for TCP, preceded by the descriptions that it needs."""
        introduction = self.introduce(sender, kind)
        return introduction + self._numbered(self._message(sender, kind, stamp, payload))

    def datagram(self, sender: str, kind: str, stamp: Time, payload: bytes = b"") -> bytes:
        """Encode a message for a datagram; both names must have been introduced."""
        self._datagram += 1
        return encode(self._message(sender, kind, stamp, payload), self._datagram - 1)

    def ask_for_datagrams(self, address: str, port: int) -> bytes:
        """Encode the request for datagrams, for TCP."""
        return self._numbered(target_message(address, port))

    def introduce(self, sender: str, *kinds: str) -> bytes:
        """Encode the descriptions, for TCP, of names that the peer doesn't know yet."""
        out = b""
        for table, name in ((SENDER, sender), *((TYPE, kind) for kind in kinds)):
            known = self._introduced[table]
            if name not in known:
                out += self._numbered(describe(table, len(known), name))
                known[name] = len(known)
        return out

    def _message(self, sender: str, kind: str, stamp: Time, payload: bytes) -> Message:
        return Message(
            stamp, self._introduced[SENDER][sender], self._introduced[TYPE][kind], payload
        )

    def _numbered(self, message: Message) -> bytes:
        self._sequence += 1
        return encode(message, self._sequence - 1)

    def _decode(self, messages: list[Message]) -> list[SenderMessage]:
        reports = []
        for message in messages:
            if message.type < 0:
                self._apply(message)
                continue
            sender, kind = self.senders.get(message.sender), self._types.get(message.type)
            if sender is None:
                continue  # a datagram may overtake the description of its sender
            if kind == POSE:
                reports.append(SenderMessage(sender, message.stamp, decode_pose(message.payload)))
            elif kind in (PING, PONG):
                reports.append(SenderMessage(sender, message.stamp, SenderStatus(kind)))
            elif kind == TEXT:
                severity, text = decode_text(message.payload)
                reports.append(
                    SenderMessage(sender, message.stamp, SenderStatus(TEXT, text, severity))
                )
        return reports

    def _apply(self, message: Message) -> None:
        """Apply a system message; those about logging are ignored."""
        if message.type in (SENDER, TYPE):
            number, name = described(message)
            (self.senders if message.type == SENDER else self._types)[number] = name
        elif message.type == UDP:
            self.datagrams_to = read_target(message)
