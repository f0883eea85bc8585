"""The drones of a run, each with a wire and a link of its own."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any

from kybflow.core.errors import DriverError
from kybflow.core.signals import Time
from kybflow.drivers.ardrone.link import ArdroneLink
from kybflow.drivers.ardrone.transport.udp import UdpWire
from kybflow.drivers.ardrone.transport.wire import DroneWire
from kybflow.parts import Link, Seat, Session


def _over_wifi(params: Any) -> DroneWire:
    return UdpWire(params.host, params.rate)


def open_session(
    seats: Sequence[Seat],
    generator: random.Random,
    opener: Callable[[Any], DroneWire] = _over_wifi,
) -> ArdroneSession:
    """Open the links of these seats. opener: makes a wire of a seat's parameters. Raises
    DriverError, and nothing stays open then."""
    hosts: dict[str, str] = {}
    for seat in seats:
        name, host = seat.context.vehicle, seat.params.host
        if host in hosts:
            raise DriverError(
                f"`{hosts[host]}` and `{name}` have one `host`, {host}: each drone needs its own"
            )
        hosts[host] = name
    session = ArdroneSession()
    try:
        for seat in seats:
            wire = opener(seat.params)
            session.add(seat, wire, f"{generator.getrandbits(32):08x}")
    except BaseException:
        session.close()
        raise
    return session


class ArdroneSession(Session):
    """Lets every link handle what has arrived, once a tick."""

    def __init__(self) -> None:
        self.links: dict[str, Link] = {}
        self._drones: list[ArdroneLink] = []

    def add(self, seat: Seat, wire: DroneWire, session: str) -> None:
        """One more drone."""
        link = ArdroneLink(seat, wire, session)
        self._drones.append(link)
        self.links[seat.context.vehicle] = link

    def advance(self, now: Time) -> None:
        for drone in self._drones:
            drone.update(now)

    def close(self) -> None:
        for drone in self._drones:
            drone.close()
