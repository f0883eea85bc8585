"""AT commands: `AT*NAME=SEQUENCE[,ARGUMENT]*` and a carriage return, in ASCII.

A datagram has one or several whole commands and at most 1024 characters. A drone takes a command
only if its sequence number is above the last one; 1 begins anew. A float is sent as the integer
that has its 32 bits. Reading is tolerant, as a drone is: line feeds are skipped, and what is no
command is left out.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable
from typing import NamedTuple

LONGEST = 1024
"""Characters of a datagram."""
ANEW = 1
"""The sequence number with which the count begins anew."""
REF_BASE = 1 << 18 | 1 << 20 | 1 << 22 | 1 << 24 | 1 << 28
FLY, EMERGENCY = 1 << 9, 1 << 8
"""Bits of REF: in the air, or on the ground; and the emergency's switch, which toggles as it is
set."""
PROGRESSIVE, COMBINED_YAW, ABSOLUTE = 1, 2, 4
"""Bits of PCMD's flag. Without the first the drone hovers, whatever the arguments say."""
SEND_CONFIGURATION, RESET_ACKNOWLEDGE, SEND_IDS = 4, 5, 6
"""Modes of CTRL."""

Argument = int | float | str
_BITS, _FLOAT = struct.Struct("<i"), struct.Struct("<f")
_COMMAND = re.compile(r'AT\*([A-Z_]{1,16})=(-?\d{1,10})((?:,(?:-?\d{1,11}|"[^"\r\n]*"))*)\Z')
_ARGUMENT = re.compile(r',(?:(-?\d+)|"([^"]*)")')


class AtCommand(NamedTuple):
    """One command as it is read: a float is the integer of its bits."""

    name: str
    sequence: int
    arguments: tuple[int | str, ...]


class Ids(NamedTuple):
    """Whose configuration is meant, each as 8 hexadecimal digits."""

    session: str
    user: str
    application: str


def bits_of(value: float) -> int:
    """The integer with the 32 bits of a float."""
    return int(_BITS.unpack(_FLOAT.pack(value))[0])


def float_of(bits: int) -> float:
    """The float with the 32 bits of an integer; NaN for an integer that has more."""
    if not -(1 << 31) <= bits < 1 << 31:
        return float("nan")
    return float(_FLOAT.unpack(_BITS.pack(bits))[0])


def ref(flies: bool, emergency: bool = False) -> Line:
    """Take off and stay in the air, or land; toggle the emergency."""
    return Line("REF", (REF_BASE | (FLY if flies else 0) | (EMERGENCY if emergency else 0),))


class Move(NamedTuple):
    """The arguments of PCMD, each -1 to 1 of the configured maximum: to the right, backward, up,
    clockwise. progressive: false to hover."""

    right: float = 0.0
    backward: float = 0.0
    up: float = 0.0
    clockwise: float = 0.0
    progressive: bool = True


HOVER = Move(progressive=False)


def pcmd(move: Move) -> Line:
    """Move, or hover."""
    if not move.progressive:
        return Line("PCMD", (0, 0, 0, 0, 0))
    right, backward, up, clockwise, _ = move
    return Line("PCMD", (PROGRESSIVE, float(right), float(backward), float(up), float(clockwise)))


def pcmd_mag(move: Move, heading: float, accuracy: float) -> Line:
    """Move by a heading that the client knows. heading: -1 to 1, 1 is 180 degrees clockwise from
    north; accuracy: its largest error, likewise."""
    right, backward, up, clockwise, moves = move
    flag = PROGRESSIVE | ABSOLUTE if moves else 0
    values = (right, backward, up, clockwise, heading, accuracy)
    return Line("PCMD_MAG", (flag, *map(float, values)))


def ftrim() -> Line:
    """Take the attitude on the ground, where it stands level, for level."""
    return Line("FTRIM", ())


def calib(device: int = 0) -> Line:
    """Calibrate the magnetometer (0), in the air; the drone spins."""
    return Line("CALIB", (device,))


def config(key: str, value: str) -> Line:
    """Set one value of the configuration."""
    return Line("CONFIG", (key, value))


def config_ids(ids: Ids) -> Line:
    """Whose value the next CONFIG of the datagram sets."""
    return Line("CONFIG_IDS", tuple(ids))


def ctrl(mode: int) -> Line:
    """Ask for the configuration, or reset the acknowledge bit."""
    return Line("CTRL", (mode, 0))


def comwdg() -> Line:
    """Reset the communication's watchdog."""
    return Line("COMWDG", ())


class Line(NamedTuple):
    """A command without its number."""

    name: str
    arguments: tuple[Argument, ...]

    def numbered(self, sequence: int) -> bytes:
        """The command as it is sent."""
        parts = ",".join((str(sequence), *map(_written, self.arguments)))
        return f"AT*{self.name}={parts}\r".encode("ascii")


def _written(argument: Argument) -> str:
    if isinstance(argument, str):
        return f'"{argument}"'
    return str(bits_of(argument) if isinstance(argument, float) else int(argument))


def datagrams(groups: Iterable[Iterable[Line]], first: int) -> tuple[list[bytes], int]:
    """Number the commands and pack them into datagrams; a group stays together. Returns them and
    the number of the next command."""
    packed: list[bytes] = []
    for group in groups:
        data = b""
        for line in group:
            data += line.numbered(first)
            first += 1
        if packed and len(packed[-1]) + len(data) <= LONGEST:
            packed[-1] += data
        elif data:
            packed.append(data)
    return packed, first


def read_commands(datagram: bytes) -> list[AtCommand]:
    """The commands of a datagram; one that is too long has none."""
    if len(datagram) > LONGEST:
        return []
    text = datagram.decode("ascii", "replace").replace("\n", "")
    found = (_COMMAND.match(part) for part in text.split("\r")[:-1])
    return [_read(match) for match in found if match is not None]


def _read(match: re.Match[str]) -> AtCommand:
    name, sequence, rest = match.groups()
    arguments = tuple(int(number) if number else words for number, words in _ARGUMENT.findall(rest))
    return AtCommand(name, int(sequence), arguments)
