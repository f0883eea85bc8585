"""Reads the messages of a recording as arrays: `log.mcap` (https://mcap.dev/spec).

A file that is still being written, or whose run was killed, is read as far as it goes. Only the
outer records are read by `mcap`: it makes an object of every message, which takes ten times as long
as to find them by their lengths.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata, Schema
from mcap.stream_reader import StreamReader, get_chunk_data_stream
from numpy.typing import NDArray

from kybflow.core.files import open_regular
from kybflow.recording.layout import METADATA, PACKAGE, definition, dtype_spec, kept_every

TICK = np.dtype(dtype_spec("Tick"))
_RECORD, _MESSAGE = struct.Struct("<BQ"), struct.Struct("<HIQQ")
"""A record's opcode and length; a message's channel, sequence, log time and publish time."""


class Series(NamedTuple):
    """Decoded messages. times: log times, ns, (n,). values: structures, (n,)."""

    times: NDArray[np.int64]
    values: NDArray[Any]

    def every(self, n: int) -> Series:
        """Return the first of each `n` messages."""
        return Series(self.times[::n], self.values[::n])


@dataclass(frozen=True)
class Messages:
    """The messages of a topic in the order of the file. times: their log times, ns, shape (n,).
    sizes: their lengths in bytes, (n,). content: their bytes, one after the other."""

    times: NDArray[np.int64]
    sizes: NDArray[np.int64]
    content: bytes

    def decoded(self, kind: np.dtype[Any]) -> Series:
        """Return the messages as an array of structures, and their times. Raises ValueError if they
        have another layout."""
        return Series(self.times, np.frombuffer(self.content, kind))

    def json(self) -> Iterator[Any]:
        """Yield the value of each message, of a topic encoded as JSON."""
        ends = np.cumsum(self.sizes)
        for start, end in zip((ends - self.sizes).tolist(), ends.tolist(), strict=True):
            yield json.loads(self.content[start:end])


NO_MESSAGES = Messages(np.zeros(0, np.int64), np.zeros(0, np.int64), b"")


@dataclass(frozen=True)
class Recording:
    """A recording. mission: the metadata, as in `recording.layout.head`. topics: the messages of
    each topic that has any."""

    mission: dict[str, Any]
    topics: dict[str, Messages]

    def __getitem__(self, topic: str) -> Messages:
        return self.topics.get(topic, NO_MESSAGES)

    def ticks(self, vehicle: str) -> Series:
        """Return a vehicle's ticks, at about `RATE` a second."""
        rows = self[f"/{vehicle}/tick"].decoded(TICK)
        return rows.every(kept_every(self.mission["control_rate"]))

    @property
    def end(self) -> int:
        """The newest log time, ns; 0 without messages."""
        return max((int(messages.times.max()) for messages in self.topics.values()), default=0)


def read_recording(path: Path) -> Recording:
    """Read the recording at `path`. Raises OSError, ValueError or McapError for a file that is not
    a recording, or is one of another version of kybflow."""
    mission: dict[str, Any] = {}
    channels: dict[int, _Collected] = {}
    with open_regular(path) as file:
        try:
            for record in StreamReader(file, emit_chunks=True).records:
                if isinstance(record, Chunk):
                    stream, length = get_chunk_data_stream(record)
                    _read_chunk(path, stream.read(length), channels)
                elif isinstance(record, Metadata) and record.name == METADATA:
                    mission.update(json.loads(record.metadata["plan"]))
        except (EndOfFile, struct.error):
            pass  # the run was killed, or is still flying
    if not mission:
        raise ValueError(f"`{path.name}` has no metadata of a mission")
    return Recording(mission, {c.topic: c.messages() for c in channels.values() if c.times})


@dataclass
class _Collected:
    """The messages of a channel that were read so far."""

    topic: str
    times: list[int] = field(default_factory=list)
    parts: list[bytes] = field(default_factory=list)

    def messages(self) -> Messages:
        sizes = np.fromiter(map(len, self.parts), np.int64, len(self.parts))
        return Messages(np.array(self.times, np.int64), sizes, b"".join(self.parts))


def _read_chunk(path: Path, data: bytes, channels: dict[int, _Collected]) -> None:
    start, end, header = 0, len(data), _RECORD.size + _MESSAGE.size
    while start < end:
        opcode, length = _RECORD.unpack_from(data, start)
        following = start + _RECORD.size + length
        if opcode == Opcode.MESSAGE:
            number, _, time, _ = _MESSAGE.unpack_from(data, start + _RECORD.size)
            channel = channels[number]
            channel.times.append(time)
            channel.parts.append(data[start + header : following])
        elif opcode == Opcode.CHANNEL:
            opened = Channel.read(_stream(data, start, following))
            channels.setdefault(opened.id, _Collected(opened.topic))
        elif opcode == Opcode.SCHEMA:
            _check_layout(path, Schema.read(_stream(data, start, following)))
        start = following


def _stream(data: bytes, start: int, end: int) -> ReadDataStream:
    return ReadDataStream(BytesIO(data[start + _RECORD.size : end]))


def _check_layout(path: Path, schema: Schema) -> None:
    """Raise ValueError if the ticks have other fields than in this version."""
    if schema.name == f"{PACKAGE}/Tick" and schema.data != definition("Tick"):
        raise ValueError(
            f"`{path.name}` was recorded by another version of kybflow, whose ticks have another"
            " layout; tools that decode ROS 1 messages by their schema can read it"
        )
