"""The link to one drone, and the session that holds the links of a run.

`control.flight` decides which commands to send, `control.configuring` writes the configuration,
`control.round_trips` measures the delay, `telemetry` decodes navigation data, and `transport` sends
and receives datagrams.
"""

from __future__ import annotations

import random
from collections.abc import Sequence

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Command, Measurement, Time
from kybflow.drivers.ardrone.control.acts import ACTS, lasts, lines_of
from kybflow.drivers.ardrone.control.configuring import Configuring, values_of
from kybflow.drivers.ardrone.control.flight import FlightControl
from kybflow.drivers.ardrone.control.moves import limits_of
from kybflow.drivers.ardrone.control.round_trips import RoundTrips
from kybflow.drivers.ardrone.preflight import checks, round_trip
from kybflow.drivers.ardrone.protocol.at import Ids, comwdg, ftrim
from kybflow.drivers.ardrone.protocol.configuration import identity
from kybflow.drivers.ardrone.protocol.navdata.packet import Packet
from kybflow.drivers.ardrone.protocol.navdata.state import DroneState
from kybflow.drivers.ardrone.telemetry.measurements import Measurements
from kybflow.drivers.ardrone.telemetry.status import DroneStatus
from kybflow.drivers.ardrone.transport.udp import UdpWire
from kybflow.drivers.ardrone.transport.wire import DroneWire
from kybflow.parts import Check, Link, Seat, Session, StatusText

REQUEST_PERIOD: Time = NS // 5
"""Period of the requests for navigation data while none arrives."""
SILENCE: Time = NS
"""Time without navigation data after which it is requested again."""
FIRST_PACKET_TIMEOUT: Time = 10 * NS
"""Timeout of the first packet."""
WATCHDOG_ANSWER_PERIOD: Time = NS // 20
"""Shortest time between two answers to the watchdog bit."""


class ArdroneLink(Link):
    """The link to one drone. The session calls `update` once a tick. session: the run's id, 8
    hexadecimal digits."""

    def __init__(self, seat: Seat, wire: DroneWire, session: str) -> None:
        context, params = seat.context, seat.params
        self.wire = wire
        self._airframe, self._latency = context.airframe, params.latency
        self._limits = limits_of(params, context.airframe)
        wire.stream.bearing = params.compass
        ids = self._ids = Ids(session, identity(params.profile), identity(params.application))
        self.status = DroneStatus()
        self._measurements = Measurements(context)
        self.configuring = Configuring(
            values_of(params, self._limits, ids),
            ids,
            wire.stream.post,
            wire.listen_for_configuration,
        )
        self.flight = FlightControl(self.status, wire.stream, self._limits, params.take_off_time)
        self._round_trips = RoundTrips(ids, wire.stream.post)
        self._opened: Time | None = None
        self._asked: Time | None = None
        self._answered: Time | None = None
        self._is_flown = self._is_configured = False
        self._trims = params.flat_trim
        self.armed = None

    def update(self, now: Time) -> None:
        """Process the packets that have arrived, and maintain the connection. Raises DriverError if
        it has failed."""
        self.wire.poll(now)
        self._opened = now if self._opened is None else self._opened
        arrived = self.wire.take(now)
        for at, packet in arrived:
            self._receive(packet, at)
        self.is_heard = bool(arrived)
        self._reconnect(now)
        if not self._is_flown:
            self.flight.wait(now)
        self._configure(now)
        self.flight.watch(now)
        self.override = self.flight.override
        self.armed = None if self.status.last_received is None else self.status.flies

    def read(self, now: Time) -> Sequence[Measurement]:
        opened = now if self._opened is None else self._opened
        if self.status.last_received is None and now - opened > FIRST_PACKET_TIMEOUT:
            why = self.wire.trouble or "no navigation data has arrived"
            way_out = "join its network, or set the driver's `host`"
            raise DriverError(f"no data from the drone for 10 s: {why}; {way_out}")
        return self._measurements.take()

    def send(self, command: Command, now: Time) -> None:
        self._is_flown = True
        self.flight.send(command, now)

    def arm(self, command: Command, now: Time) -> bool:
        self._is_flown = True
        return self.flight.arm(now)

    def cut(self, now: Time) -> None:
        self._is_flown = True
        self.flight.cut(now)

    def land(self, now: Time) -> bool:
        self._is_flown = True
        return self.flight.land(now)

    def perform(self, act: str, now: Time) -> None:
        if ACTS[act].moves:
            self.flight.start_act(now + lasts(act))
        self.wire.stream.post(*lines_of(act, self._ids))

    def checks(self, now: Time) -> Sequence[Check]:
        if self.status.is_in_emergency and self.status.stands:
            self.flight.reset_emergency(now)
        found = checks(
            self.status, self.configuring, self._limits, self._airframe, self.wire.trouble, now
        )
        return [*found, round_trip(self._round_trips, self._latency, now)]

    def status_texts(self) -> Sequence[StatusText]:
        ignored = self.wire.gate.report()
        notices = () if ignored is None else (StatusText("notice", ignored),)
        return (*self.status.texts(), *notices)

    def close(self) -> None:
        self.wire.close()

    def _receive(self, packet: Packet, at: Time) -> None:
        self.status.receive(packet, at)
        self._measurements.receive(packet, at)
        is_warned = DroneState.COMMUNICATION_WATCHDOG in packet.state
        if is_warned and (self._answered is None or at - self._answered >= WATCHDOG_ANSWER_PERIOD):
            self._answered = at
            self.wire.gate.restart()
            if DroneState.BOOTSTRAP not in packet.state:
                self.wire.stream.post(comwdg())

    def _reconnect(self, now: Time) -> None:
        """Request navigation data while none arrives, and restart the command sequence after a
        silence."""
        last_received = self.status.last_received
        if last_received is not None and now - last_received <= SILENCE:
            return
        if self._asked is None or now - self._asked >= REQUEST_PERIOD:
            self._asked = now
            self.wire.ask()
            if last_received is not None:
                self.wire.stream.restart()

    def _configure(self, now: Time) -> None:
        """Write the configuration, and measure round trips once it is written."""
        status, data = self.status, self.wire.configuration()
        if data is not None:
            self.configuring.read(data)
        if status.last_received is None:
            return
        in_bootstrap = DroneState.BOOTSTRAP in status.state
        if in_bootstrap and self._is_configured:
            self.configuring.restart()
        self._is_configured = not self.configuring.pending and not in_bootstrap
        if self._is_configured:
            self._round_trips.update(status.acknowledges, now)
        else:
            self._round_trips.restart()
            self.configuring.update(status.acknowledges, now)
        self.delay = self._round_trips.delay
        if self._trims and self._is_configured and status.stands:
            self._trims = False
            self.wire.stream.post(ftrim())


class ArdroneSession(Session):
    """The drones of a run, each with its own connection. The constructor raises DriverError, with
    nothing left open."""

    def __init__(self, seats: Sequence[Seat], generator: random.Random) -> None:
        self._drones: list[ArdroneLink] = []
        hosts: dict[str, str] = {}
        for seat in seats:
            name, host = seat.context.vehicle, seat.params.host
            if host in hosts:
                raise DriverError(
                    f"`{hosts[host]}` and `{name}` share the `host` {host}; give each drone its own"
                )
            hosts[host] = name
        try:
            for seat in seats:
                wire = UdpWire(seat.params.host, seat.params.rate)
                session = f"{generator.getrandbits(32):08x}"
                self._drones.append(ArdroneLink(seat, wire, session))
        except BaseException:
            self.close()
            raise
        self.links: dict[str, Link] = dict(zip(hosts.values(), self._drones, strict=True))

    def advance(self, now: Time) -> None:
        for drone in self._drones:
            drone.update(now)

    def close(self) -> None:
        for drone in self._drones:
            drone.close()
