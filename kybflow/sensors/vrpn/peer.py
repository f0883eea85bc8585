"""One end of a VRPN connection, without its socket. It encodes and decodes messages, with senders
and types given by name."""

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
    """A message other than a pose. kind: PING, PONG or TEXT."""

    kind: str
    text: str = ""
    severity: int = 0


class SenderMessage(NamedTuple):
    """A decoded message. sender: its name. stamp: time on the peer's clock."""

    sender: str
    stamp: Time
    what: PoseReport | SenderStatus


class Peer:
    """Decodes the messages from the other end and encodes those to it. datagrams_to: the address at
    which the other end wants datagrams; None if unknown. senders: the other end's sender names by
    number."""

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
        """Return the messages that bytes from TCP complete. Raises CodecError, after which the
        connection must be closed."""
        return self._decode(self._decoder.feed(data))

    def receive_datagram(self, data: bytes) -> list[SenderMessage]:
        """Return the messages in a datagram. Raises CodecError, which doesn't affect the
        connection."""
        messages = decode_datagram(data)
        if any(message.type < 0 for message in messages):
            raise CodecError("a description in a datagram")
        return self._decode(messages)

    def message(self, sender: str, kind: str, stamp: Time, payload: bytes = b"") -> bytes:
        """Encode a message for TCP, preceded by the descriptions of its sender and type if the peer
        needs them."""
        introduction = self.introduce(sender, kind)
        return introduction + self._numbered(self._message(sender, kind, stamp, payload))

    def datagram(self, sender: str, kind: str, stamp: Time, payload: bytes = b"") -> bytes:
        """Encode a message as a datagram. The peer must know its sender and its type already
        (`introduce`)."""
        self._datagram += 1
        return encode(self._message(sender, kind, stamp, payload), self._datagram - 1)

    def ask_for_datagrams(self, address: str, port: int) -> bytes:
        """Encode the request, sent over TCP, for datagrams to an address."""
        return self._numbered(target_message(address, port))

    def introduce(self, sender: str, *kinds: str) -> bytes:
        """Encode the descriptions, sent over TCP, of those names that the peer doesn't know yet."""
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
        """Apply a system message. Messages about logging are ignored."""
        if message.type in (SENDER, TYPE):
            number, name = described(message)
            (self.senders if message.type == SENDER else self._types)[number] = name
        elif message.type == UDP:
            self.datagrams_to = read_target(message)
