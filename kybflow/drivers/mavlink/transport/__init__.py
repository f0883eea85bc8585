"""Bytes to and from autopilots: UDP, TCP and serial wires, and the router that gives each autopilot
its port. This package handles MAVLink frames (`protocol`), not their meaning. The session,
discovery and the emulator open their wires here."""

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
    """Open the wire to an address. Raises DriverError if it cannot work: a port in use, an unknown
    host, pyserial missing. A device or simulator that may still appear is reported by `trouble`
    instead."""
    place = read_address(address) if isinstance(address, str) else address
    kinds: dict[str, Callable[[Address], Wire]] = {
        "tcp": TcpClient,
        "tcpin": TcpServer,
        "udpin": UdpIn,
        "udpout": UdpOut,
        "serial": SerialLine,
    }
    return kinds[place.kind](place)
