"""The address of an autopilot.

`udpin:[HOST:]PORT` waits for datagrams and answers their senders; `udpout:HOST:PORT` sends first;
`tcp:HOST:PORT` connects; `tcpin:[HOST:]PORT` accepts connections; `serial:DEVICE:BAUD` is a cable
or a radio. A listening address without a host listens on this machine's loopback.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from kybflow.core.errors import DriverError

LOOPBACK = "127.0.0.1"
LISTENING = frozenset({"udpin", "tcpin"})
CALLING = frozenset({"udpout", "tcp"})
KINDS = ("udpin", "udpout", "tcp", "tcpin", "serial")
_PLACE = re.compile(r"(?:([^\s:/@\[\]]+):)?(\d{1,5})")
_FORMS = (
    "write `udpin:HOST:PORT`, `udpout:HOST:PORT`, `tcp:HOST:PORT`, `tcpin:HOST:PORT` or"
    " `serial:DEVICE:BAUD`"
)


_QUESTIONS = {
    "udpin": "does the autopilot send to that port, and does no other program take it?",
    "udpout": "does an autopilot listen there?",
    "tcp": "does an autopilot listen there, and is no other program connected?",
    "tcpin": "does the autopilot connect there?",
    "serial": "is it the right device, with the autopilot's baud rate?",
}


class Address(NamedTuple):
    """An autopilot's address. kind: one of `KINDS`. place: a host or a serial device. number: a
    port or a baud rate. Port 0, which a mission can't use, stands for any free one."""

    kind: str
    place: str
    number: int

    def __str__(self) -> str:
        return f"{self.kind}:{self.place}:{self.number}"


def read_address(text: str) -> Address:
    """Parse an address. Raises DriverError, which says what to write instead."""
    kind, _, rest = text.strip().partition(":")
    if kind == "serial":
        return _serial(text, rest)
    if kind == "udp":
        raise DriverError(
            f"`{text}` could mean two things: write `udpin:{rest}` to wait for the autopilot to"
            f" send, or `udpout:{rest}` to send first"
        )
    if kind not in KINDS:
        raise DriverError(f"`{text}` is no MAVLink address: {_FORMS}")
    return _host(text, kind, rest)


def _host(text: str, kind: str, rest: str) -> Address:
    match = _PLACE.fullmatch(rest)
    if match is None:
        raise DriverError(f"`{text}` is no MAVLink address: write `{kind}:HOST:PORT`")
    host, port = match[1], int(match[2])
    if host is None and kind in CALLING:
        raise DriverError(f"`{text}` says no host: write `{kind}:HOST:{port}`")
    if not 0 < port < 65536:
        raise DriverError(f"`{text}` has port {port}: ports go from 1 to 65535")
    return Address(kind, host or LOOPBACK, port)


def _serial(text: str, rest: str) -> Address:
    device, _, baud = rest.rpartition(":")  # a device may have colons in its name
    if not device or not re.fullmatch(r"\d{3,8}", baud):
        raise DriverError(
            f"`{text}` is no serial line: write `serial:DEVICE:BAUD`, as in"
            " `serial:/dev/ttyUSB0:57600`"
        )
    return Address("serial", device, int(baud))


def to_ask(address: str) -> str:
    """Return what to check if no autopilot is heard at an address, as a question."""
    return _QUESTIONS.get(address.partition(":")[0], "is it switched on?")
