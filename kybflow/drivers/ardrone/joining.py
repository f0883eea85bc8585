"""Taking a drone from its own network into a lab's, over its telnet shell.

A drone opens a network of its own, in which it is 192.168.1.1; several on one computer need one
network. The shell is BusyBox as root, without a password. What is done there lasts until the drone
is switched off, so that a drone that doesn't come is only to be switched off and on. It joins open
networks: it has no WPA of its own.
"""

from __future__ import annotations

import os
import re
import shlex
import socket
from collections.abc import Callable
from ipaddress import AddressValueError, IPv4Address, IPv4Interface, NetmaskValueError

from kybflow.core.errors import DriverError

TELNET = 23
PATIENCE = 5.0
"""Seconds to wait for the shell's answer."""
MOST_SAID = 1 << 16
PROMPT = b"# "
_IAC, _SE, _SB, _WILL = 255, 240, 250, 251
_ESCAPES = re.compile(rb"\x1b\[[0-9;]*[A-Za-z]")


def join_lines(ssid: str, address: str, netmask: str = "255.255.255.0") -> list[str]:
    """The lines for the shell. Raises DriverError for what can be no network or address."""
    if not 1 <= len(ssid.encode("utf-8")) <= 32 or not ssid.isprintable():
        raise DriverError(f"{ssid!r} is no network's name: 1 to 32 bytes that can be printed")
    try:
        where = IPv4Interface(f"{IPv4Address(address)}/{netmask}")
    except (AddressValueError, NetmaskValueError, ValueError):
        raise DriverError(f"`{address}` with `{netmask}` is no IPv4 address") from None
    if where.ip in (where.network.network_address, where.network.broadcast_address):
        raise DriverError(f"{where.ip} is no address of a single drone in {where.network}")
    # in the background, for the shell's own connection ends with the network
    joined = (
        "sleep 1; killall udhcpd; ifconfig ath0 down;"
        f" iwconfig ath0 mode managed essid {shlex.quote(ssid)};"
        f" ifconfig ath0 {where.ip} netmask {where.netmask} up"
    )
    return [f"( {joined} ) < /dev/null > /dev/null 2>&1 &", "exit"]


def run_lines(
    lines: list[str], drone: str, tell: Callable[[str], None], port: int = TELNET
) -> None:
    """Send each line when the shell has asked for one. tell: called with each. Raises
    DriverError."""
    try:
        with socket.create_connection((drone, port), PATIENCE) as shell:
            for line in lines:
                _await_prompt(shell)
                tell(line)
                shell.sendall(line.encode("utf-8") + b"\n")
            _await_end(shell)
    except OSError as error:
        words = os.strerror(error.errno).lower() if error.errno else str(error)
        raise DriverError(f"no shell on the drone at {drone}: {words}") from None


def _await_prompt(shell: socket.socket) -> None:
    said = b""
    while not _ESCAPES.sub(b"", _plain(said)).endswith(PROMPT):
        data = shell.recv(4096)
        if not data or len(said) > MOST_SAID:
            raise OSError(0, "it has no shell that asks for a command")
        said += data


def _await_end(shell: socket.socket) -> None:
    """Wait until the shell has ended, so that nothing is lost on the way to it."""
    while shell.recv(4096):
        pass


def _plain(said: bytes) -> bytes:
    """What was said without telnet's negotiation, which is not answered: a plain line is enough."""
    out, at = bytearray(), 0
    while at < len(said):
        if said[at] != _IAC:
            out.append(said[at])
            at += 1
        elif at + 1 < len(said) and said[at + 1] == _SB:
            end = said.find(bytes((_IAC, _SE)), at)
            at = len(said) if end < 0 else end + 2
        else:
            at += 3 if at + 1 < len(said) and said[at + 1] >= _WILL else 2
    return bytes(out)
