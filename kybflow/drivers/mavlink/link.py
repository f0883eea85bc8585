"""The links to a run's autopilots, and the session that polls the wires to them once a tick.

`AutopilotLink.update` handles the messages that arrived (`AutopilotState`), decides what to command
(`control.offboard`), and sends what is due: setpoints, and the keep-alive of the link."""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from pathlib import Path

from kybflow.core.errors import DriverError, Refused
from kybflow.core.geometry import LEVEL, ZERO, heading_of
from kybflow.core.signals import (
    NS,
    Command,
    CommandKind,
    Estimate,
    Measurement,
    MeasurementKind,
    Setpoint,
    SetpointKind,
    Time,
    Truth,
)
from kybflow.drivers.mavlink.autopilot_state import AutopilotState, KeepAlive, LineCapacity
from kybflow.drivers.mavlink.control import hover_throttle, payload
from kybflow.drivers.mavlink.control.hover_throttle import HoverThrottle
from kybflow.drivers.mavlink.control.offboard import OffboardControl, OffboardGoal
from kybflow.drivers.mavlink.control.payload import PayloadGrip
from kybflow.drivers.mavlink.control.setpoints import SetpointStream, compensated
from kybflow.drivers.mavlink.firmware import FirmwareProfile, Latency, profile_of
from kybflow.drivers.mavlink.preflight import PreflightChecks
from kybflow.drivers.mavlink.protocol import codec
from kybflow.drivers.mavlink.protocol.framing import mavlink
from kybflow.drivers.mavlink.protocol.signing import Signing, read_key
from kybflow.drivers.mavlink.telemetry.received_status import LandedState
from kybflow.drivers.mavlink.telemetry.truth import GroundTruth
from kybflow.drivers.mavlink.telemetry.vision import ExternalVision, FrameDrift
from kybflow.drivers.mavlink.transport.router import Port, Router
from kybflow.drivers.mavlink.transport.sockets import open_wire
from kybflow.drivers.mavlink.transport.wire import Wire
from kybflow.parts import ActiveFaults, Check, ForeignCommand, Link, Seat, Session, StatusText

SILENCE_TIMEOUT: Time = 10 * NS
"""How long the autopilot may be silent after the link was opened."""
KEEP_ALIVE_PERIOD_NS: Time = NS // 50
"""The interval of the keep-alive, which need not run in every tick."""
REREAD_PERIOD_NS: Time = NS // 2
"""The interval at which the next of the preflight's parameters is read again in flight."""
MAX_AGE_NS: Time = NS // 2
"""A position of the autopilot that is older counts as unknown."""
REJECTION_TIME_NS: Time = NS // 2
"""How long the autopilot's filter may reject poses before that counts."""
MS: Time = NS // 1000


class AutopilotLink(Link):
    """The link to one vehicle. The session calls `update` once a tick, after polling the router.
    truth: the ground truth of the firmware's own simulator, or None."""

    def __init__(
        self, seat: Seat, profile: FirmwareProfile, port: Port, truth: GroundTruth | None
    ) -> None:
        context, params = seat.context, seat.params
        autopilot = self.autopilot = AutopilotState(seat, profile, port, truth)
        resumes = params.after_failsafe == "resume"
        self._stream = SetpointStream(params.rate)
        self.offboard = OffboardControl(
            profile, autopilot.status, autopilot.requests, self._stream, params.arming_time,
            resumes, self._holding, self._knows_position,
        )  # fmt: skip
        self._checks = PreflightChecks(autopilot, self.offboard.modes, params)
        self._mode_trouble = "it was not requested yet"
        self._drift = FrameDrift()
        self._latency = (
            profile.latency if params.lead is None else Latency(params.lead, params.lead)
        )
        self._hover = HoverThrottle(
            profile.hover_parameter, context.airframe.hover_thrust, profile.raises
        )
        autopilot.port.want(hover_throttle.STREAMS)
        self._vision = ExternalVision(params.vision_rate, autopilot.target)
        self._watched, self._shared = self._checks.names(), params.shared
        names = [*self._watched, profile.hover_parameter]
        self._grip: PayloadGrip | None = None
        if context.payload is not None:
            output = profile.output(context.payload.channel, params.simulator)
            names.append(output.parameter)
            autopilot.port.want(payload.STREAMS)
            self._grip = PayloadGrip(
                profile, autopilot.status, autopilot.requests, autopilot.parameters, output
            )
        if params.simulator:
            self.faults = ActiveFaults(context.vehicle, self._apply_faults)
        self._capacity = LineCapacity(params)
        self._keep_alive = KeepAlive(autopilot, self._streams(frozenset()), names)
        self._now: Time = 0
        self._due: Time = 0
        self._reread: Time = 0
        self._turn = 0
        self._opened: Time | None = None
        self._command: Command | None = None

    def update(self, now: Time) -> None:
        """Handle messages, decide what to command, and send what is due. Raises DriverError."""
        self._now = now
        if self.autopilot.receive(now):
            self._keep_alive.begin_anew()
        self.offboard.update(self.autopilot.age(now), self.autopilot.silence, now)
        self._stream_setpoint(now)
        if now >= self._due:
            self._due = now + KEEP_ALIVE_PERIOD_NS
            self._learn_hover_throttle(now)
            self._watch_parameters(now)
            self._keep_alive.step(now)
            self.delay = self.autopilot.sync.round_trip
            self.rejection = self._rejection(now)
        self._publish_state()

    def read(self, now: Time) -> Sequence[Measurement]:
        if self._opened is None:
            self._opened = now
        port = self.autopilot.port
        if port.last_heard is None and now - self._opened > SILENCE_TIMEOUT:
            why = port.trouble() or "no autopilot was heard"
            way_out = f"{port.to_ask} Start it, or set the driver's `address` and `system`"
            raise DriverError(f"system {port.system} was silent for 10 s: {why}; {way_out}")
        return self.autopilot.telemetry.take()

    def send(self, command: Command, now: Time) -> None:
        self._command = command
        self.offboard.send(command, now)
        self._stream_setpoint(now)

    def arm(self, command: Command, now: Time) -> bool:
        self._command = command
        try:
            return self.offboard.arm(command, now)
        finally:
            self._stream_setpoint(now)
            self._publish_state()

    def cut(self, now: Time) -> None:
        self.offboard.cut(now)
        self.offboard.update(self.autopilot.age(now), self.autopilot.silence, now)
        self._keep_alive.step(now)
        self._publish_state()

    def disarm_by_force(self, now: Time) -> None:
        landed = self.autopilot.status.landed
        if landed in (LandedState.AIR, LandedState.TAKING_OFF):
            raise Refused("it reports that it is in the air")
        self.cut(now)

    def tell_position(self, estimate: Estimate, now: Time) -> None:
        autopilot = self.autopilot
        if not autopilot.is_outside:
            return
        self._drift.learn(estimate, autopilot.telemetry.odometry, now)
        stamp = autopilot.clock.to_boot(estimate.time) if self._vision.is_due(now) else None
        if stamp is None:
            return
        status = autopilot.status
        placed = status.armed or "GPS_GLOBAL_ORIGIN" in status.at
        is_lost = autopilot.profile.needs_origin and not placed
        for message in self._vision.of(estimate, stamp // 1000, is_lost, now):
            autopilot.port.send(message)

    def prepare_preflight(self, now: Time) -> None:
        self._mode_trouble = self.offboard.prepare(now)
        self._stream_setpoint(now)
        self._checks.request_own_checks(now)

    def checks(self, now: Time) -> Sequence[Check]:
        checks = self._checks.checks(self._mode_trouble, self._vision.newest, now)
        return [*checks, *self._capacity.check()]

    def status_texts(self) -> Sequence[StatusText]:
        return self.autopilot.new_texts(is_disarming=self.offboard.is_disarming)

    def foreign_commands(self) -> Sequence[ForeignCommand]:
        noticed = self.autopilot.others.take()
        return [ForeignCommand(words, self._shared) for words in noticed] if noticed else ()

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        for name, rate in self._streams(kinds).items():
            self._keep_alive.stream(name, rate, self._now)

    def reclaim(self, now: Time) -> None:
        self.offboard.reclaim(now)
        self._publish_state()

    def land(self, now: Time) -> bool:
        try:
            return self.offboard.land(now)
        finally:
            self._publish_state()

    def grip(self, is_open: bool, now: Time) -> None:
        if self._grip is None:
            raise Refused("it carries no payload")
        if self.override is not None:
            raise Refused(f"a pilot or another program controls it: {self.override.reason}")
        done = self._grip.ask(is_open, now)
        if done is None:
            return
        self.autopilot.telemetry.add(done)
        truth = self.autopilot.truth
        if truth is not None and is_open:
            truth.release(now)
        elif truth is not None:
            truth.load()

    def truth(self) -> Truth | None:
        truth = self.autopilot.truth
        return None if truth is None else truth.truth(self._now)

    def close(self) -> None:
        """Restore the default streams. If the vehicle is disarmed and under no other control, also
        restore the mode that it had before the first request."""
        self._keep_alive.close()
        autopilot, before = self.autopilot, self.offboard.modes.before
        is_ours = self.override is None and not autopilot.status.armed
        if not is_ours or before is None or before == autopilot.status.mode:
            return
        command, params = mavlink.MAV_CMD_DO_SET_MODE, autopilot.profile.mode_params(before)
        autopilot.port.send(codec.command_long(autopilot.target, command, *params))

    def _apply_faults(self) -> None:
        """Apply the injected faults that act on this side of the link."""
        if self.faults is not None:
            self.autopilot.port.deaf, self.autopilot.port.mute = self.faults.deaf, self.faults.mute

    def _streams(self, kinds: Set[MeasurementKind]) -> dict[str, float]:
        """Return the streams to request, Hz, by message name. kinds: the measurements with which
        the vehicle is flown."""
        rates = {**self.autopilot.streams(kinds), **hover_throttle.STREAMS}
        if self._grip is not None:
            rates |= payload.STREAMS
        sent = self.autopilot.profile.streams
        return self._capacity.fitting({name: rates[name] for name in rates if name in sent})

    def _stream_setpoint(self, now: Time) -> None:
        """Send the newest setpoint if it is due."""
        command, autopilot = self._stream.due(now), self.autopilot
        if command is None:
            return
        anchor = self._drift.anchor if autopilot.is_outside else autopilot.telemetry.anchor
        if anchor is None:
            return
        boot = autopilot.clock.to_boot(now) or now
        message = codec.encode(
            compensated(command, self._latency), target=autopilot.target, boot_ms=boot // MS,
            anchor=anchor,
            throttle=self._hover.throttle(autopilot.parameters.values),
            own_heading=autopilot.telemetry.heading if command.heading is None else None,
        )  # fmt: skip
        autopilot.port.send(message)
        autopilot.others.sent(message, now)

    def _watch_parameters(self, now: Time) -> None:
        """Report changed safety parameters. In flight, also read the preflight's parameters again,
        one at a time."""
        parameters = self.autopilot.parameters
        for name, before, value in parameters.take_changed():
            if name in self._watched:
                self.autopilot.others.changed(parameters.called(name), before, value, now)
        if now >= self._reread and self.autopilot.status.armed:
            self._reread = now + REREAD_PERIOD_NS
            self._turn = (self._turn + 1) % len(self._watched)
            name = self._watched[self._turn]
            if name in parameters.values:
                parameters.read((name,), now, again=True)

    def _learn_hover_throttle(self, now: Time) -> None:
        status, autopilot = self.autopilot.status, self.autopilot
        flies = self.offboard.goal is OffboardGoal.FOLLOW and status.landed is LandedState.AIR
        if self._command is not None:
            asked = status.throttle if flies else None
            values, own = autopilot.parameters.values, autopilot.telemetry.odometry
            self._hover.learn(asked, self._command, own, values, now)

    def _holding(self) -> Command | None:
        """Return the command that holds the vehicle at its current position, or None while that
        position is unknown."""
        own = self.autopilot.telemetry.odometry
        if own is None or self._now - own.time > MAX_AGE_NS:
            return None
        heading = heading_of(own.attitude)
        here = own.position
        if self.autopilot.is_outside:
            here = self._drift.anchor.to_world(here)
        setpoint = Setpoint(SetpointKind.POSITION, here, ZERO, heading=heading)
        return Command(LEVEL, 0.0, ZERO, heading, True, CommandKind.POSITION, setpoint)

    def _is_sent_positions(self, now: Time) -> bool:
        sent = self._vision.newest
        return sent is not None and now - sent[1] <= REJECTION_TIME_NS

    def _knows_position(self, now: Time) -> bool:
        """Return whether the autopilot measures its position itself or is being sent it."""
        return not self.autopilot.is_outside or self._is_sent_positions(now)

    def _rejection(self, now: Time) -> str | None:
        """Return why the autopilot doesn't use the positions that it is sent, None if it does."""
        status = self.autopilot.status
        if status.rejected_for < REJECTION_TIME_NS or not self._is_sent_positions(now):
            return None
        return f"its filter rejects the poses: {status.innovations} of the largest that it accepts"

    def _publish_state(self) -> None:
        status = self.autopilot.status
        self.override = self.offboard.override
        self.armed = None if status.heartbeat is None else status.armed


Group = tuple[int, str | None]
"""Our system id and the file of the signing key; vehicles that share both share a router."""


def open_session(
    seats: Sequence[Seat], opener: Callable[[str], Wire] = open_wire
) -> MavlinkSession:
    """Open the wires to the autopilots of these vehicles, and their links. opener: opens the wire
    to an address. If one can't be opened, closes the others and raises DriverError."""
    places: list[tuple[FirmwareProfile, str, int]] = []
    for number, seat in enumerate(seats, start=1):
        profile = profile_of(seat.params.autopilot)
        system = seat.params.system or number
        places.append((profile, seat.params.address or profile.default_address(system), system))
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
                wires[address] = opener(address)
                session.wires.append(wires[address])
        routers = {
            (own, key): Router(wires, own, None if key is None else Signing(read_key(Path(key))))
            for (own, key), wires in groups.items()
        }
        session.routers = tuple(routers.values())
        for (profile, address, system), seat in zip(places, seats, strict=True):
            port = routers[owners[address]].port(address, system)
            truth = GroundTruth(seat.context, profile.sphere) if seat.params.simulator else None
            link = AutopilotLink(seat, profile, port, truth)
            session.links[seat.context.vehicle] = link
            session.autopilots.append(link)
    except BaseException:
        session.close()
        raise
    return session


class MavlinkSession(Session):
    """The session of a run's autopilots: each tick it polls the `routers`, then updates the link
    of every autopilot. wires: are closed with the session."""

    def __init__(self) -> None:
        self.links: dict[str, Link] = {}
        self.autopilots: list[AutopilotLink] = []
        self.routers: tuple[Router, ...] = ()
        self.wires: list[Wire] = []

    def advance(self, now: Time) -> None:
        for router in self.routers:
            router.poll(now)
        for link in self.autopilots:
            link.update(now)

    def close(self) -> None:
        try:
            for link in self.autopilots:
                link.close()
        finally:
            for wire in self.wires:
                wire.close()
