"""One autopilot as the engine sees it.

`control.offboard` decides what is asked of it, `preflight.checks` what is checked before take-off,
and `contact` keeps what it reported."""

from __future__ import annotations

from collections.abc import Sequence, Set

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
from kybflow.drivers.mavlink.autopilot_state import AutopilotState, StreamRequests
from kybflow.drivers.mavlink.control import payload, setpoints
from kybflow.drivers.mavlink.control.offboard import OffboardControl, OffboardGoal
from kybflow.drivers.mavlink.control.payload import PayloadGrip
from kybflow.drivers.mavlink.control.setpoints import HoverThrottle, compensated
from kybflow.drivers.mavlink.firmware import FirmwareProfile, Latency
from kybflow.drivers.mavlink.preflight.checks import LineCapacity, PreflightChecks
from kybflow.drivers.mavlink.protocol import codec
from kybflow.drivers.mavlink.protocol.dialect import mavlink
from kybflow.drivers.mavlink.protocol.frames import Anchor
from kybflow.drivers.mavlink.telemetry.received_status import LandedState
from kybflow.drivers.mavlink.telemetry.truth import GroundTruth
from kybflow.drivers.mavlink.telemetry.vision import ExternalVision, FrameDrift
from kybflow.drivers.mavlink.transport.router import Port
from kybflow.parts import ActiveFaults, Check, ForeignCommand, Link, Seat, StatusText

SILENCE_TIMEOUT: Time = 10 * NS
"""How long the autopilot may be silent after opening."""
OFTEN: Time = NS // 50
"""How often the upkeep of the link runs; it need not in every tick."""
REREAD: Time = NS // 2
"""How often one of the preflight's parameters is read again in flight."""
FORGOTTEN: Time = NS // 2
"""Its own position counts as unknown when it is older than this."""
MS: Time = NS // 1000


class AutopilotLink(Link):
    """The link to one vehicle. The session calls `update` once a tick, after polling the router."""

    def __init__(self, seat: Seat, profile: FirmwareProfile, port: Port) -> None:
        context, params = seat.context, seat.params
        contact = self.contact = AutopilotState(
            seat, profile, port, self._ground_truth(seat, profile)
        )
        resumes = params.after_failsafe == "resume"
        self.offboard = OffboardControl(
            profile, contact.status, contact.requests, params.arming_time, params.rate, resumes,
            self._holding,
        )  # fmt: skip
        self._checks = PreflightChecks(contact, self.offboard.modes, params)
        self._drift = FrameDrift()
        self._latency = (
            profile.latency if params.lead is None else Latency(params.lead, params.lead)
        )
        self._hover = HoverThrottle(
            profile.hover_parameter, context.airframe.hover_thrust, profile.raises
        )
        contact.port.want(setpoints.STREAMS)
        self._vision = ExternalVision(params.vision_rate, contact.target)
        self._watched, self._shared = self._checks.names(), params.shared
        names = [*self._checks.names(), profile.hover_parameter]
        self._grip: PayloadGrip | None = None
        if context.payload is not None:
            output = profile.output(context.payload.channel, params.simulator)
            names.append(output.parameter)
            contact.port.want(payload.STREAMS)
            self._grip = PayloadGrip(
                profile, contact.status, contact.requests, contact.parameters, output
            )
        if params.simulator:
            self.faults = ActiveFaults(context.vehicle, self._apply_faults)
        self._capacity = LineCapacity(params)
        self._stream_requests = StreamRequests(contact, self._streams(frozenset()), names)
        self._now: Time = 0
        self._due: Time = 0
        self._reread: Time = 0
        self._turn = 0
        self._opened: Time | None = None
        self._command: Command | None = None

    def update(self, now: Time) -> None:
        """Take in messages, decide, and send what is due. Raises DriverError."""
        self._now = now
        if self.contact.listen(now):
            self._stream_requests.begin_anew()
        self.offboard.update(self.contact.age(now), self.contact.silence, now)
        self._stream_setpoint(now)
        if now >= self._due:
            self._due = now + OFTEN
            self._learn_hover_throttle(now)
            self._watch_parameters(now)
            self._stream_requests.step(now)
            self.delay = self.contact.sync.round_trip
        self._publish_state()

    def read(self, now: Time) -> Sequence[Measurement]:
        if self._opened is None:
            self._opened = now
        port = self.contact.port
        if port.last_heard is None and now - self._opened > SILENCE_TIMEOUT:
            why = port.trouble() or "no autopilot was heard"
            way_out = f"{port.to_ask} Start it, or set the driver's `address` and `system`"
            raise DriverError(f"system {port.system} was not heard for 10 s: {why}; {way_out}")
        return self.contact.telemetry.take()

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
        self.offboard.update(self.contact.age(now), self.contact.silence, now)
        self._stream_requests.step(now)
        self._publish_state()

    def disarm_by_force(self, now: Time) -> None:
        landed = self.contact.status.landed
        if landed in (LandedState.AIR, LandedState.TAKING_OFF):
            raise Refused("it says that it is in the air")
        self.cut(now)

    def tell_position(self, estimate: Estimate, now: Time) -> None:
        contact = self.contact
        if not contact.is_outside:
            return
        self._drift.learn(estimate, contact.telemetry.odometry, now)
        if not self._vision.is_due(now) or (stamp := contact.clock.to_boot(estimate.time)) is None:
            return
        status = contact.status
        placed = status.armed or "GPS_GLOBAL_ORIGIN" in status.at
        is_lost = contact.profile.needs_origin and not placed
        for message in self._vision.of(estimate, stamp // 1000, is_lost, now):
            contact.port.send(message)

    def checks(self, now: Time) -> Sequence[Check]:
        misses = self.offboard.prepare(now)
        self._stream_setpoint(now)
        return [*self._checks.checks(misses, self._vision.told, now), *self._capacity.check()]

    def status_texts(self) -> Sequence[StatusText]:
        return self.contact.said(is_disarming=self.offboard.is_disarming)

    def foreign_commands(self) -> Sequence[ForeignCommand]:
        noticed = self.contact.others.take()
        return [ForeignCommand(words, self._shared) for words in noticed] if noticed else ()

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        for name, rate in self._streams(kinds).items():
            self._stream_requests.stream(name, rate, self._now)

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
            raise Refused(f"somebody else has it: {self.override.reason}")
        done = self._grip.ask(is_open, now)
        if done is None:
            return
        self.contact.telemetry.add(done)
        truth = self.contact.truth
        if truth is not None and is_open:
            truth.release(now)
        elif truth is not None:
            truth.load()

    def truth(self) -> Truth | None:
        truth = self.contact.truth
        return None if truth is None else truth.truth(self._now)

    def close(self) -> None:
        """Put the streams back to what they were before us, and the mode of a disarmed vehicle,
        unless somebody else has it."""
        self._stream_requests.close()
        contact, before = self.contact, self.offboard.modes.before
        is_ours = self.override is None and not contact.status.armed
        if not is_ours or before is None or before == contact.status.mode:
            return
        params = (*contact.profile.mode_params(before), 0.0, 0.0, 0.0, 0.0)
        command = mavlink.MAV_CMD_DO_SET_MODE
        contact.port.send(
            mavlink.MAVLink_command_long_message(*contact.target, command, 0, *params)
        )

    def _ground_truth(self, seat: Seat, profile: FirmwareProfile) -> GroundTruth | None:
        """What tells the ground truth; None on hardware."""
        return GroundTruth(seat.context, profile.sphere) if seat.params.simulator else None

    def _apply_faults(self) -> None:
        """Apply the faults on this side of the link."""
        if self.faults is not None:
            self.contact.port.deaf, self.contact.port.mute = self.faults.deaf, self.faults.mute

    def _streams(self, kinds: Set[MeasurementKind]) -> dict[str, float]:
        """The messages to request, Hz. kinds: what the vehicle is flown by."""
        rates = {**self.contact.streams(kinds), **setpoints.STREAMS}
        if self._grip is not None:
            rates |= payload.STREAMS
        sent = self.contact.profile.streams
        return self._capacity.fitting({name: rates[name] for name in rates if name in sent})

    def _stream_setpoint(self, now: Time) -> None:
        """Send the setpoint that is due."""
        command = self.offboard.stream.due(now)
        if command is None or (anchor := self._anchor) is None:
            return
        contact = self.contact
        boot = contact.clock.to_boot(now) or now
        message = codec.encode(
            compensated(command, self._latency), target=contact.target, boot_ms=boot // MS,
            anchor=anchor,
            throttle=self._hover.throttle(contact.parameters.values),
            own_heading=contact.telemetry.heading if command.heading is None else None,
        )  # fmt: skip
        contact.port.send(message)
        contact.others.sent(message, now)

    @property
    def _anchor(self) -> Anchor | None:
        """Where its frame lies."""
        own = self.contact.telemetry.anchor
        return self._drift.anchor if self.contact.is_outside else own

    def _watch_parameters(self, now: Time) -> None:
        """Read the parameters of the preflight again in flight, one at a time."""
        parameters = self.contact.parameters
        for name, before, value in parameters.take_changed():
            if name in self._watched:
                self.contact.others.changed(parameters.called(name), before, value, now)
        if now >= self._reread and self.contact.status.armed:
            self._reread = now + REREAD
            self._turn = (self._turn + 1) % len(self._watched)
            name = self._watched[self._turn]
            if name in parameters.values:
                parameters.read((name,), now, again=True)

    def _learn_hover_throttle(self, now: Time) -> None:
        """How much throttle holds it in the air."""
        status, contact = self.contact.status, self.contact
        flies = self.offboard.goal is OffboardGoal.FOLLOW and status.landed is LandedState.AIR
        if self._command is not None:
            asked = status.throttle if flies else None
            values, own = contact.parameters.values, contact.telemetry.odometry
            self._hover.learn(asked, self._command, own, values, now)

    def _holding(self) -> Command | None:
        """What makes it hold still where it is, None where that is not known any more."""
        own = self.contact.telemetry.odometry
        if own is None or self._now - own.time > FORGOTTEN:
            return None
        heading = heading_of(own.attitude)
        here = own.position
        if self.contact.is_outside:
            here = self._drift.anchor.to_world(here)
        setpoint = Setpoint(SetpointKind.POSITION, here, ZERO, heading=heading)
        return Command(LEVEL, 0.0, ZERO, heading, True, CommandKind.POSITION, setpoint)

    def _publish_state(self) -> None:
        status = self.contact.status
        self.override = self.offboard.override
        self.armed = None if status.heartbeat is None else status.armed
