"""AT commands, and the configuration that some of them write and request.

A command is `AT*NAME=SEQUENCE[,ARGUMENT]*` and a carriage return, in ASCII.

A datagram holds whole commands, at most 1024 characters. The drone accepts a command only if its
sequence number is larger than the last one; 1 restarts the sequence. A float is sent as the integer
with its 32 bits. The parser is as tolerant as the drone: it skips line feeds and anything that is
no command. The drone sends its configuration over TCP, as lines of `section:key = value` and a zero
byte. Source of the protocol: AR.Drone Developer Guide (SDK 2.0), and the headers of Parrot's SDK.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Mapping
from typing import NamedTuple
from zlib import crc32

MAX_DATAGRAM = 1024
"""Largest size of a datagram, characters."""
FIRST_SEQUENCE = 1
"""The sequence number that restarts the sequence."""
REF_BASE = 1 << 18 | 1 << 20 | 1 << 22 | 1 << 24 | 1 << 28
FLY, EMERGENCY = 1 << 9, 1 << 8
"""Bits of REF: fly, and the emergency switch. Setting the switch toggles the emergency state."""
PROGRESSIVE, ABSOLUTE = 1, 4
"""Bits of PCMD's flag. Without `PROGRESSIVE` the drone hovers and ignores the arguments."""
SEND_CONFIGURATION, RESET_ACKNOWLEDGE = 4, 5
"""Modes of CTRL."""

Argument = int | float | str
_BITS, _FLOAT = struct.Struct("<i"), struct.Struct("<f")
_COMMAND = re.compile(r'AT\*([A-Z_]{1,16})=(-?\d{1,10})((?:,(?:-?\d{1,11}|"[^"\r\n]*"))*)\Z')
_ARGUMENT = re.compile(r',(?:(-?\d+)|"([^"]*)")')


class AtCommand(NamedTuple):
    """A parsed command. A float argument is given as the integer with the same bits."""

    name: str
    sequence: int
    arguments: tuple[int | str, ...]


class Ids(NamedTuple):
    """The ids that own configuration values, each 8 hexadecimal digits."""

    session: str
    user: str
    application: str


def bits_of(value: float) -> int:
    """Return the integer with the 32 bits of a float."""
    return int(_BITS.unpack(_FLOAT.pack(value))[0])


def float_of(bits: int) -> float:
    """Return the float with the 32 bits of an integer; NaN for a larger integer."""
    if not -(1 << 31) <= bits < 1 << 31:
        return float("nan")
    return float(_FLOAT.unpack(_BITS.pack(bits))[0])


def ref(flies: bool, emergency: bool = False) -> Line:
    """Return the command to take off and stay in the air, or to land. emergency: toggle the
    emergency state."""
    return Line("REF", (REF_BASE | (FLY if flies else 0) | (EMERGENCY if emergency else 0),))


class Move(NamedTuple):
    """The arguments of PCMD, each -1 to 1 as a fraction of the configured limit. progressive: False
    to hover."""

    right: float = 0.0
    backward: float = 0.0
    up: float = 0.0
    clockwise: float = 0.0
    progressive: bool = True


HOVER = Move(progressive=False)


def pcmd(move: Move) -> Line:
    if not move.progressive:
        return Line("PCMD", (0, 0, 0, 0, 0))
    right, backward, up, clockwise, _ = move
    return Line("PCMD", (PROGRESSIVE, float(right), float(backward), float(up), float(clockwise)))


def pcmd_mag(move: Move, heading: float, accuracy: float) -> Line:
    """Return the command to move relative to a heading that the client knows. heading: -1 to 1,
    where 1 is 180 degrees clockwise from north. accuracy: largest error of the heading, in the same
    unit."""
    right, backward, up, clockwise, moves = move
    flag = PROGRESSIVE | ABSOLUTE if moves else 0
    values = (right, backward, up, clockwise, heading, accuracy)
    return Line("PCMD_MAG", (flag, *map(float, values)))


def ftrim() -> Line:
    """Return the command to calibrate the level attitude; the drone must stand on level ground."""
    return Line("FTRIM", ())


def calib() -> Line:
    """Return the command to calibrate the magnetometer (device 0) in flight; the drone spins."""
    return Line("CALIB", (0,))


def config(key: str, value: str) -> Line:
    """Return the command to set one value of the configuration."""
    return Line("CONFIG", (key, value))


def config_ids(ids: Ids) -> Line:
    """Return the command that sets the ids for the next CONFIG in the same datagram."""
    return Line("CONFIG_IDS", tuple(ids))


def ctrl(mode: int) -> Line:
    """Return the command to request the configuration, or to reset the acknowledge bit."""
    return Line("CTRL", (mode, 0))


def comwdg() -> Line:
    """Return the command to reset the communication watchdog."""
    return Line("COMWDG", ())


class Line(NamedTuple):
    """A command without its sequence number."""

    name: str
    arguments: tuple[Argument, ...]

    def numbered(self, sequence: int) -> bytes:
        parts = [str(sequence)]
        for argument in self.arguments:
            if isinstance(argument, str):
                parts.append(f'"{argument}"')
            else:
                parts.append(str(bits_of(argument) if isinstance(argument, float) else argument))
        return f"AT*{self.name}={','.join(parts)}\r".encode("ascii")


def datagrams(groups: Iterable[Iterable[Line]], first: int) -> tuple[list[bytes], int]:
    """Number the commands and pack them into datagrams, without splitting a group. Return the
    datagrams and the next sequence number. first: sequence number of the first command."""
    packed: list[bytes] = []
    for group in groups:
        data = b""
        for line in group:
            data += line.numbered(first)
            first += 1
        if packed and len(packed[-1]) + len(data) <= MAX_DATAGRAM:
            packed[-1] += data
        elif data:
            packed.append(data)
    return packed, first


def read_commands(datagram: bytes) -> list[AtCommand]:
    """Return the commands of a datagram; none if it is too long."""
    if len(datagram) > MAX_DATAGRAM:
        return []
    text = datagram.decode("ascii", "replace").replace("\n", "")
    commands = []
    for match in filter(None, map(_COMMAND.match, text.split("\r")[:-1])):
        name, sequence, rest = match.groups()
        arguments = (int(number) if number else word for number, word in _ARGUMENT.findall(rest))
        commands.append(AtCommand(name, int(sequence), tuple(arguments)))
    return commands


END = b"\0"
MAX_CONFIGURATION = 1 << 16
"""Largest size of a configuration, bytes; a real one has about 5,000."""


def read_configuration(data: bytes) -> dict[str, str]:
    """Return the values by `section:key`; malformed lines are skipped."""
    values = {}
    for line in data.partition(END)[0].decode("utf-8", "replace").splitlines():
        key, equals, value = line.partition("=")
        if equals and ":" in key:
            values[key.strip()] = value.strip()
    return values


def write_configuration(values: Mapping[str, str]) -> bytes:
    lines = "".join(f"{key} = {value}\n" for key, value in values.items())
    return lines.encode("utf-8") + END


def identity(words: str) -> str:
    """Return the id of an application or a user: CRC-32 of its name, 8 hexadecimal digits."""
    return f"{crc32(words.encode('utf-8')):08x}"


def agrees(asked: str, found: str) -> bool:
    """Return whether the value found matches the one written, although the drone formats numbers
    and booleans differently."""
    if asked.strip().upper() == found.strip().upper():
        return True
    try:
        one, other = float(asked), float(found)
    except ValueError:
        return False
    return abs(one - other) <= 1e-3 * max(abs(one), abs(other), 1e-3)
