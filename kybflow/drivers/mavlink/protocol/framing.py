"""Bytes to messages and back.

Version 2 goes out; version 1 comes in too, unless messages are signed. Any float may come, NaN too,
which has a meaning in some fields.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass

from kybflow.drivers.mavlink.protocol.layout import (
    FIRST,
    LAYOUTS,
    SECOND,
    SIGNED,
    Message,
    is_signed,
    next_of,
    number_of,
    size_of,
)
from kybflow.drivers.mavlink.protocol.signing import Signing

__all__ = ["ONBOARD", "Counts", "Framing", "Message", "Packer", "Parser"]

ONBOARD = 191
"""Our component: a computer that flies the vehicle (MAV_COMP_ID_ONBOARD_COMPUTER)."""
_DROPPED = object()


@dataclass(slots=True)
class Counts:
    """What came. bad: stretches of bytes that are no frame, or one with a wrong checksum. refused:
    frames unsigned, wrongly signed or old; stale: those of them that are rightly signed. signed:
    frames whose signature nobody checks, for want of a key. unknown: frames of another dialect."""

    messages: int = 0
    bad: int = 0
    refused: int = 0
    stale: int = 0
    signed: int = 0
    unknown: int = 0


class Parser:
    """What one sender says, whole frames or a stream of bytes. Never raises, whatever comes.
    stale: who signed rightly, but long ago, by system and component; who reads it, empties it.
    wanted: the numbers of the messages that are read, when there are any; others are looked at no
    further than their signature, and without one, alone in a datagram, no further than their
    length."""

    def __init__(
        self,
        signing: Signing | None = None,
        counts: Counts | None = None,
        wanted: Set[int] = frozenset(),
    ) -> None:
        self.counts = Counts() if counts is None else counts
        self.stale: set[tuple[int, int]] = set()
        self._signing, self._wanted = signing, wanted
        self._rest = b""

    def parse(self, data: bytes) -> list[Message]:
        """The messages that are complete now, oldest first. After a bad byte the search goes on
        with the next one: no good frame is lost to a bad one before it."""
        size = -1 if self._rest or not data else size_of(data, 0, len(data))
        if size == len(data):  # one frame, as datagrams are: nothing to search for
            if self._signing is None and self._wanted and number_of(data) not in self._wanted:
                return []
            message = self._frame(data, b"")
            if message is not None:
                if message is _DROPPED:
                    return []
                self.counts.messages += 1
                return [message]
        messages: list[Message] = []
        while self._rest and _is_whole(data):  # then the rest of the one before won't come:
            rest = self._rest  # it was a datagram cut short, or bytes were lost
            self.counts.bad += 1
            messages += self._scan(rest[next_of(rest, 1) :])
        messages += self._scan(self._rest + data)
        self.counts.messages += len(messages)
        return messages

    def _scan(self, data: bytes) -> list[Message]:
        at, end, is_lost = 0, len(data), False
        messages: list[Message] = []
        while at < end:
            size = size_of(data, at, end)
            if size < 0:
                break
            message = self._frame(data[at : at + size], data[at + size : at + size + 1])
            if message is None:
                self.counts.bad += not is_lost
                is_lost = True
                at = next_of(data, at + 1)
                continue
            is_lost = False
            at += size
            if message is not _DROPPED:
                messages.append(message)
        self._rest = data[at:]
        return messages

    def _frame(self, frame: bytes, after: bytes) -> Message | None:
        """The message of a frame, `_DROPPED` where it is not for us, None where it is none."""
        if not frame:
            return None
        number = number_of(frame)
        layout = LAYOUTS.get(number)
        if layout is None:  # its checksum can't be told: what follows has to look like a frame
            if after and after[0] not in {FIRST, SECOND}:
                return None
            self.counts.unknown += 1
            return _DROPPED
        if not layout.fits(frame):
            return None
        if frame[0] == FIRST:
            sequence, system, component = frame[2], frame[3], frame[4]
        else:
            sequence, system, component = frame[4], frame[5], frame[6]
        if not self._is_believed(frame, system, component):
            self.counts.refused += 1
            return _DROPPED
        if self._wanted and number not in self._wanted:
            return _DROPPED
        try:
            message = layout.message(frame)
        except Exception:  # a foreign class made from foreign bytes
            return None
        header = message.get_header()
        header.srcSystem, header.srcComponent, header.seq = system, component, sequence
        return message

    def _is_believed(self, frame: bytes, system: int, component: int) -> bool:
        """Whether its signature is as it should be."""
        if self._signing is None:
            self.counts.signed += is_signed(frame)
            return True
        if not is_signed(frame):
            return False
        if self._signing.accepts(frame, system, component):
            return True
        if self._signing.knows(frame):
            self.counts.stale += 1
            self.stale.add((system, component))
        return False


def _is_whole(data: bytes) -> bool:
    """Whether bytes begin with a frame that is right."""
    size = size_of(data, 0, len(data)) if data else 0
    layout = LAYOUTS.get(number_of(data[:size])) if size > 0 else None
    return layout is not None and layout.fits(data[:size])


class Packer:
    """Frames for one receiver, which counts them by component."""

    def __init__(self, system: int, signing: Signing | None = None, link: int = 0) -> None:
        self._system, self._signing, self._link = system, signing, link
        self._sequences: dict[int, int] = {}

    def pack(self, message: Message, component: int = ONBOARD) -> bytes:
        """Raises DriverError where a field does not fit into the message."""
        layout = LAYOUTS[message.get_msgId()]  # `id` is a field of some
        sequence = self._sequences.get(component, 0)
        sender = self._system, component
        if self._signing is None:
            frame = layout.frame(message, sequence, sender, 0)
        else:
            frame = layout.frame(message, sequence, sender, SIGNED)
            frame += self._signing.signature(frame, self._link)
        self._sequences[component] = (sequence + 1) % 256
        return frame


class Framing:
    """Both ways of one link to one other. key: the secret of signed messages."""

    def __init__(self, system: int, component: int = ONBOARD, key: bytes | None = None) -> None:
        signing = None if key is None else Signing(key)
        self._parser, self._packer = Parser(signing), Packer(system, signing)
        self._component = component
        self.counts = self._parser.counts
        self.parse = self._parser.parse

    def pack(self, message: Message, component: int | None = None) -> bytes:
        """Raises DriverError where a field does not fit into the message."""
        return self._packer.pack(message, self._component if component is None else component)
