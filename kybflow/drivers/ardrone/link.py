"""The link to one drone with its preflight checks, and the session that holds the links of a run.

`flight` decides which commands to send, `configuring` writes the configuration and measures the
delay, `telemetry` decodes navigation data, and `wire` and `udp` send and receive datagrams.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from math import degrees

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Command, Measurement, Time
from kybflow.drivers.ardrone.acts import ACTS, lasts, lines_of
from kybflow.drivers.ardrone.at import Ids, comwdg, ftrim, identity
from kybflow.drivers.ardrone.configuring import (
    LONGEST_WATCHDOG,
    NAME,
    VERSION,
    WATCHDOG,
    Configuring,
    RoundTrips,
    values_of,
)
from kybflow.drivers.ardrone.flight import FlightControl
from kybflow.drivers.ardrone.navdata import DroneState, Packet, in_words
from kybflow.drivers.ardrone.params import Limits, limits_of
from kybflow.drivers.ardrone.telemetry import DroneStatus, Measurements
from kybflow.drivers.ardrone.udp import UdpWire
from kybflow.drivers.ardrone.wire import DroneWire
from kybflow.parts import Check, Link, Seat, Session, StatusText
from kybflow.world.vehicle_context import Airframe

NAVSILENCE_NS: Time = NS // 2
EXCESS_DELAY_S = 0.15
"""Seconds by which a round trip may exceed the delay for which the gains are designed."""
FIRMWARE = "2."
"""Prefix of an AR.Drone 2.0's firmware version."""


def checks(
    status: DroneStatus,
    configuring: Configuring,
    limits: Limits,
    airframe: Airframe,
    trouble: str,
    now: Time,
) -> Iterator[Check]:
    if status.last_received is None:
        yield Check("navdata", False, trouble or "none has arrived")
        return
    age = now - status.last_received
    yield Check("navdata", age < NAVSILENCE_NS, f"{age / NS:.1f} s old")
    emergency = "; ".join(in_words(status.state)) if status.is_in_emergency else ""
    yield Check("emergency", not emergency, emergency or "none")
    low = DroneState.BATTERY_LOW in status.state
    charge = "unknown" if status.demo is None else f"{status.demo.battery} %"
    yield Check("own battery", not low, f"{charge}{', which it reports as low' if low else ''}")
    waits = configuring.pending
    wrong = "" if waits else "; ".join(configuring.mismatches)
    yield Check("configuration", not (waits or wrong), waits or wrong or "as written")
    found = configuring.found or {}
    version, name = found.get(VERSION, "unknown"), found.get(NAME)
    named = f"{version} of `{name}`" if name else version
    yield Check("firmware", version.startswith(FIRMWARE), named)
    yield _watchdog(found.get(WATCHDOG))
    fits = limits.tilt >= airframe.tilt - 1e-6
    reason = f"{degrees(limits.tilt):.0f} deg, of which a command is a fraction"
    if not fits:
        most = degrees(airframe.tilt)
        reason += f"; the airframe's tilt is {most:.0f} deg: set it, or `euler_angle_max`"
    yield Check("tilt", fits, reason, waits=False)


def _watchdog(found: str | None) -> Check:
    """Return the check that the drone lands soon after commands stop. found: the configured
    timeout, seconds."""
    try:
        seconds = float(found) if found is not None else None
    except ValueError:
        seconds = None
    if seconds is None:
        return Check("watchdog", False, f"`{WATCHDOG}` is not known")
    good = 0.0 < seconds <= LONGEST_WATCHDOG
    words = f"it lands {seconds:g} s after the last command"
    return Check("watchdog", good, words if good else f"{words}; {LONGEST_WATCHDOG:g} s at most")


def round_trip(trips: RoundTrips, latency: float, now: Time) -> Check:
    """Return the check that a round trip takes little longer than the delay for which the gains are
    designed. latency: this delay, seconds."""
    if trips.waits(now):
        return Check("round trip", False, "no command is acknowledged yet")
    if not trips.delay:
        return Check("round trip", True, "unknown, so that `link_slow` is never raised")
    words = f"a command and its answer take {trips.delay:.2f} s"
    good = trips.delay <= latency + EXCESS_DELAY_S
    late = f"{words}, {latency + EXCESS_DELAY_S:.2f} s at most with `latency: {latency:g} s`"
    return Check("round trip", good, words if good else late)


REQUEST_PERIOD: Time = NS // 5
"""Period of the requests for navigation data while none arrives."""
NAVDATA_RETRY_NS: Time = NS
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
        self._is_flown = self._flew = self._is_configured = False
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
            self._flew = self._flew or self.status.flies
            self.flight.wait(now)
        self._configure(now)
        self.flight.watch(now)
        self.override = self.flight.override
        self.armed = None if self.status.last_received is None else self.status.flies

    def read(self, now: Time) -> Sequence[Measurement]:
        opened = now if self._opened is None else self._opened
        if self.status.last_received is None and now - opened > FIRST_PACKET_TIMEOUT:
            why = self.wire.trouble or "no navigation data has arrived"
            way_out = "join its network, end its other clients, or set the driver's `host`"
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

    def prepare_preflight(self, now: Time) -> None:
        if self.status.is_in_emergency and self.status.stands:
            self.flight.reset_emergency(now)

    def checks(self, now: Time) -> Sequence[Check]:
        found = checks(
            self.status, self.configuring, self._limits, self._airframe, self.wire.trouble, now
        )
        others = () if self._is_flown else self._other_client(now)
        return [*found, *others, round_trip(self._round_trips, self._latency, now)]

    def _other_client(self, now: Time) -> Iterator[Check]:
        """Yield a check if another client seems to control the drone. A drone that was in the air
        stays red: this client may have taken the navigation data away from the other."""
        way_out = "end that client, or set the driver's `host` to the address of your own drone"
        if self._flew:
            words = (
                f"it flew before this run gave a command, so another client controls it: {way_out}"
            )
            yield Check("other client", False, words, waits=False)
        elif self.status.last_received is not None and self.configuring.is_ignored(now):
            words = "it sends data but obeys no command; if another client controls it, "
            yield Check("other client", False, words + way_out)

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
        if last_received is not None and now - last_received <= NAVDATA_RETRY_NS:
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
