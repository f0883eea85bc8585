"""Bytes to and from autopilots: UDP, TCP and serial wires, and the router that gives each
autopilot its port. Handles MAVLink frames (`protocol`), not what they mean; the session, discovery
and the emulator open wires here."""

from __future__ import annotations

from collections.abc import Callable

from kybflow.drivers.mavlink.transport.address import Address, read_address
from kybflow.drivers.mavlink.transport.sockets import (
    SerialLine,
    TcpClient,
    TcpServer,
    UdpIn,
    UdpOut,
)
from kybflow.drivers.mavlink.transport.wire import Wire


def open_wire(address: str | Address) -> Wire:
    """The wire to an address. Raises DriverError where it cannot work: a port in use, an unknown
    host, no pyserial. A device or simulator that may still appear is reported by `trouble`."""
    place = read_address(address) if isinstance(address, str) else address
    kinds: dict[str, Callable[[Address], Wire]] = {
        "tcp": TcpClient,
        "tcpin": TcpServer,
        "udpin": UdpIn,
        "udpout": UdpOut,
        "serial": SerialLine,
    }
    return kinds[place.kind](place)
