"""Reads the messages of a recording as arrays: `log.mcap` (https://mcap.dev/spec).

A file that is still being written, or whose run was killed, is read as far as it goes, chunk by
chunk, and only the topics that are asked for are kept. `mcap` reads only what is not a message: it
makes an object of every message and of its place, which takes ten times as long as to find them by
their lengths.
"""

from __future__ import annotations

import json
import struct
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import SEEK_CUR, BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream, read_magic
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
    sizes: their lengths in bytes, (n,). places: where they are in the file, in the order of all its
    messages, (n,). content: their bytes, one after the other. definition: of a ROS 1 message, as in
    the file; empty for JSON."""

    times: NDArray[np.int64]
    sizes: NDArray[np.int64]
    places: NDArray[np.int64]
    content: bytes | bytearray
    definition: str = ""

    def decoded(self, kind: np.dtype[Any]) -> Series:
        """Return the messages as an array of structures, and their times. Raises ValueError if they
        have another layout."""
        return Series(self.times, np.frombuffer(self.content, kind))

    def json(self) -> Iterator[Any]:
        """Yield the value of each message, of a topic encoded as JSON."""
        ends = np.cumsum(self.sizes)
        for start, end in zip((ends - self.sizes).tolist(), ends.tolist(), strict=True):
            yield json.loads(self.content[start:end])


_NONE = np.zeros(0, np.int64)
NO_MESSAGES = Messages(_NONE, _NONE, _NONE, b"")


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


def read_recording(path: Path, wants: Callable[[str], bool] = lambda _: True) -> Recording:
    """Read the topics that `wants` of the recording at `path`. Raises OSError, ValueError or
    McapError for a file that is not a recording, or is one of another version of kybflow."""
    channels, mission = _Channels(path, wants), read_mission(path)
    try:
        for opcode, data in _records(path):
            if opcode == Opcode.CHUNK:
                stream, length = get_chunk_data_stream(Chunk.read(data))
                channels.read(stream.read(length))
    except (RuntimeError, LookupError, struct.error) as error:
        raise ValueError(f"`{path.name}` is damaged: {error}") from error
    return Recording(mission, channels.topics())


def read_mission(path: Path) -> dict[str, Any]:
    """Return the metadata of a recording, which begins with it. Raises as `read_recording`."""
    for opcode, data in _records(path):
        if opcode == Opcode.METADATA:
            record = Metadata.read(data)
            if record.name == METADATA:
                mission: dict[str, Any] = json.loads(record.metadata["plan"])
                return mission
    raise ValueError(f"`{path.name}` has no metadata of a mission")


def _records(path: Path) -> Iterator[tuple[int, ReadDataStream]]:
    """Yield the outer records that matter, as (opcode, content), as far as they are written."""
    with open_regular(path) as file:
        try:
            read_magic(ReadDataStream(file))
        except struct.error:
            raise ValueError(f"`{path.name}` is no recording") from None
        while len(begin := file.read(_RECORD.size)) == _RECORD.size:
            opcode, length = _RECORD.unpack(begin)
            if opcode not in (Opcode.CHUNK, Opcode.METADATA):
                file.seek(length, SEEK_CUR)
            elif len(content := file.read(length)) == length:
                yield opcode, ReadDataStream(BytesIO(content))
            else:
                return  # the run was killed, or is still flying


@dataclass
class _Collected:
    """The messages of a channel that were read so far."""

    topic: str
    definition: str
    times: array[int] = field(default_factory=lambda: array("q"))
    sizes: array[int] = field(default_factory=lambda: array("q"))
    places: array[int] = field(default_factory=lambda: array("q"))
    content: bytearray = field(default_factory=bytearray)

    def messages(self) -> Messages:
        numbers = self.times, self.sizes, self.places
        times, sizes, places = (np.array(of, np.int64) for of in numbers)
        return Messages(times, sizes, places, self.content, self.definition)


class _Channels:
    """The channels of a file, by number; None for those that nobody wants."""

    def __init__(self, path: Path, wants: Callable[[str], bool]) -> None:
        self._path, self._wants = path, wants
        self._channels: dict[int, _Collected | None] = {}
        self._schemas: dict[int, Schema] = {}
        self._place = 0

    def topics(self) -> dict[str, Messages]:
        return {c.topic: c.messages() for c in self._channels.values() if c and c.times}

    def read(self, data: bytes) -> None:
        """Read the records of a chunk."""
        start, end, header = 0, len(data), _RECORD.size + _MESSAGE.size
        record, message, channels = _RECORD.unpack_from, _MESSAGE.unpack_from, self._channels
        while start < end:
            opcode, length = record(data, start)
            following = start + _RECORD.size + length
            if opcode == Opcode.MESSAGE:
                number, _, time, _ = message(data, start + _RECORD.size)
                channel = channels[number]
                self._place += 1
                if channel is not None:
                    channel.times.append(time)
                    channel.places.append(self._place)
                    channel.sizes.append(following - start - header)
                    channel.content += memoryview(data)[start + header : following]
            elif opcode == Opcode.CHANNEL:
                self._open(Channel.read(_stream(data, start, following)))
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(_stream(data, start, following))
                self._schemas[schema.id] = schema
                _check_layout(self._path, schema)
            start = following

    def _open(self, channel: Channel) -> None:
        if channel.id in self._channels:
            return
        schema = self._schemas.get(channel.schema_id)
        is_plain = schema is None or schema.encoding != "ros1msg"
        definition = "" if schema is None or is_plain else schema.data.decode()
        is_drawn = schema is not None and schema.encoding == "protobuf"  # by viewers only
        wanted = not is_drawn and self._wants(channel.topic)
        collected = _Collected(channel.topic, definition) if wanted else None
        self._channels[channel.id] = collected


def _stream(data: bytes, start: int, end: int) -> ReadDataStream:
    return ReadDataStream(BytesIO(data[start + _RECORD.size : end]))


def _check_layout(path: Path, schema: Schema) -> None:
    """Raise ValueError if the ticks have other fields than in this version."""
    if schema.name == f"{PACKAGE}/Tick" and schema.data != definition("Tick"):
        raise ValueError(
            f"`{path.name}` was recorded by another version of kybflow, whose ticks have another"
            " layout; tools that decode ROS 1 messages by their schema can read it"
        )
