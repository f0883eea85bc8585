"""The session of a run's autopilots: the wires to them, polled once a tick, and one link per
vehicle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from kybflow.core.errors import DriverError
from kybflow.core.signals import Time
from kybflow.drivers.mavlink.firmware import FirmwareProfile, profile_of
from kybflow.drivers.mavlink.link import AutopilotLink
from kybflow.drivers.mavlink.protocol.signing import read_key
from kybflow.drivers.mavlink.telemetry.truth import GroundTruth
from kybflow.drivers.mavlink.transport import open_wire
from kybflow.drivers.mavlink.transport.router import Router
from kybflow.drivers.mavlink.transport.wire import Wire
from kybflow.parts import Link, Seat, Session

Group = tuple[int, str | None]
"""Our system id and the file of the signing key; vehicles that share both share a router."""


def open_session(
    seats: Sequence[Seat], opener: Callable[[str], Wire] = open_wire
) -> MavlinkSession:
    """Open the wires and links of these seats. opener: opens the wire to an address. Raises
    DriverError after closing everything again."""
    places = [_place(seat, number) for number, seat in enumerate(seats, start=1)]
    groups: dict[Group, dict[str, Wire]] = {}
    owners: dict[str, Group] = {}
    session = MavlinkSession()
    try:
        for (_, address, _), seat in zip(places, seats, strict=True):
            group = (seat.params.own_system, seat.params.key)
            if owners.setdefault(address, group) != group:
                raise DriverError(
                    f"vehicles at `{address}` have not the same `own_system` and `key`"
                )
            wires = groups.setdefault(group, {})
            if address not in wires:
                wires[address] = session.opened(opener(address))
        routers = {
            (own, key): Router(wires, own, None if key is None else read_key(Path(key)))
            for (own, key), wires in groups.items()
        }
        session.routers = tuple(routers.values())
        for (profile, address, system), seat in zip(places, seats, strict=True):
            port = routers[owners[address]].port(address, system)
            truth = GroundTruth(seat.context, profile.sphere) if seat.params.simulator else None
            session.links[seat.context.vehicle] = AutopilotLink(seat, profile, port, truth)
    except BaseException:
        session.close()
        raise
    return session


class MavlinkSession(Session):
    """The session of a run's autopilots: each tick it polls the `routers`, then updates every
    link."""

    def __init__(self) -> None:
        self.links: dict[str, Link] = {}
        self.routers: tuple[Router, ...] = ()
        self._wires: list[Wire] = []

    def opened(self, wire: Wire) -> Wire:
        """Register a wire to be closed with the session, and return it."""
        self._wires.append(wire)
        return wire

    def advance(self, now: Time) -> None:
        for router in self.routers:
            router.poll(now)
        for link in self.links.values():
            if isinstance(link, AutopilotLink):
                link.update(now)

    def close(self) -> None:
        try:
            for link in self.links.values():
                if isinstance(link, AutopilotLink):
                    link.close()
        finally:
            for wire in self._wires:
                wire.close()


def _place(seat: Seat, number: int) -> tuple[FirmwareProfile, str, int]:
    """Return a vehicle's profile, address and system id. number: its position in the mission, from
    1."""
    profile = profile_of(seat.params.autopilot)
    system = seat.params.system or number
    return profile, seat.params.address or profile.default_address(system), system
