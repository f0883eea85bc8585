"""Moves a drone from its own Wi-Fi network into a lab's, over its telnet shell.

A drone opens its own network, in which its address is 192.168.1.1. Several drones on one computer
must share a network. The shell is BusyBox as root, without a password. A power cycle undoes the
change, and is the remedy if a drone doesn't appear in the new network. The drone can join only open
networks, since it has no WPA.
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
SHELL_TIMEOUT_S = 5.0
"""Seconds to wait for the shell to answer."""
MOST_BYTES = 1 << 16
PROMPT = b"# "
_IAC, _SE, _SB, _WILL = 255, 240, 250, 251
_ESCAPES = re.compile(rb"\x1b\[[0-9;]*[A-Za-z]")


def join_lines(ssid: str, address: str, netmask: str = "255.255.255.0") -> list[str]:
    """Return the shell commands that join a network. Raises DriverError if the network name or the
    address is invalid."""
    if not 1 <= len(ssid.encode("utf-8")) <= 32 or not ssid.isprintable():
        raise DriverError(f"{ssid!r} is not a network name; use 1 to 32 printable bytes")
    try:
        where = IPv4Interface(f"{IPv4Address(address)}/{netmask}")
    except (AddressValueError, NetmaskValueError, ValueError):
        raise DriverError(f"`{address}` with `{netmask}` is not an IPv4 address") from None
    if where.ip in (where.network.network_address, where.network.broadcast_address):
        raise DriverError(f"{where.ip} is not the address of a single drone in {where.network}")
    # in the background, because the shell's connection ends with the network
    joined = (
        "sleep 1; killall udhcpd; ifconfig ath0 down;"
        f" iwconfig ath0 mode managed essid {shlex.quote(ssid)};"
        f" ifconfig ath0 {where.ip} netmask {where.netmask} up"
    )
    return [f"( {joined} ) < /dev/null > /dev/null 2>&1 &", "exit"]


def run_lines(
    lines: list[str], drone: str, tell: Callable[[str], None], port: int = TELNET
) -> None:
    """Send each line after the shell's prompt. tell: called with each line. Raises DriverError."""
    try:
        with socket.create_connection((drone, port), SHELL_TIMEOUT_S) as shell:
            for line in lines:
                _await_prompt(shell)
                tell(line)
                shell.sendall(line.encode("utf-8") + b"\n")
            while shell.recv(4096):  # wait until the shell ends, so that no line is lost
                pass
    except OSError as error:
        words = os.strerror(error.errno).lower() if error.errno else str(error)
        raise DriverError(f"no shell on the drone at {drone}: {words}") from None


def _await_prompt(shell: socket.socket) -> None:
    received = b""
    while not _ESCAPES.sub(b"", _plain(received)).endswith(PROMPT):
        data = shell.recv(4096)
        if not data or len(received) > MOST_BYTES:
            raise OSError(0, "it has no shell that asks for a command")
        received += data


def _plain(received: bytes) -> bytes:
    """Return the received text without telnet's negotiation, which needs no answer."""
    out, at = bytearray(), 0
    while at < len(received):
        if received[at] != _IAC:
            out.append(received[at])
            at += 1
        elif at + 1 < len(received) and received[at + 1] == _SB:
            end = received.find(bytes((_IAC, _SE)), at)
            at = len(received) if end < 0 else end + 2
        else:
            at += 3 if at + 1 < len(received) and received[at + 1] >= _WILL else 2
    return bytes(out)
