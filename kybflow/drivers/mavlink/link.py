"""One autopilot as the engine sees it. What it is asked for is decided in `helm`; what is looked at
before take-off, in `watch`; what is known of it is `contact`."""

from __future__ import annotations

from collections.abc import Sequence

from pymavlink.dialects.v20 import all as mavlink

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
from kybflow.drivers.mavlink.contact import Contact
from kybflow.drivers.mavlink.control.hover import Hover
from kybflow.drivers.mavlink.control.latency import Lag, led
from kybflow.drivers.mavlink.control.modes import DO_SET_MODE
from kybflow.drivers.mavlink.control.offboard import Goal, Helm
from kybflow.drivers.mavlink.control.payload import Grip
from kybflow.drivers.mavlink.firmware.profile import Profile
from kybflow.drivers.mavlink.preflight.watch import Watch
from kybflow.drivers.mavlink.protocol import codec
from kybflow.drivers.mavlink.protocol.frames import Anchor
from kybflow.drivers.mavlink.telemetry.drift import Drift
from kybflow.drivers.mavlink.telemetry.heard import Landed
from kybflow.drivers.mavlink.telemetry.measurements import INERTIAL
from kybflow.drivers.mavlink.telemetry.vision import Vision
from kybflow.drivers.mavlink.transport.capacity import Capacity
from kybflow.drivers.mavlink.transport.router import Port
from kybflow.drivers.mavlink.upkeep import Chores
from kybflow.parts import Check, Link, Said, Seat

PATIENCE: Time = 10 * NS
"""How long nothing at all may be heard after opening."""
OFTEN: Time = NS // 50
"""How often it is seen to what need not be done in every tick."""
FORGOTTEN: Time = NS // 2
"""An own position that is older is not where it is any more."""
MS: Time = NS // 1000
IDLE = 25.0
"""Samples of the IMU a second while nobody flies by them: enough to learn what it feels at rest,
and to begin to come down by until more arrive."""


class AutopilotLink(Link):
    """One vehicle. `look` is called once a tick after the hub has heard everybody."""

    def __init__(self, seat: Seat, profile: Profile, port: Port) -> None:
        context, params = seat.context, seat.params
        contact = self.contact = Contact(seat, profile, port)
        resumes = params.after_failsafe == "resume"
        self.helm = Helm(
            profile, contact.heard, contact.requests, params.arming_time, params.rate, resumes,
            self._holding,
        )  # fmt: skip
        self._watch = Watch(contact, self.helm.modes, params)
        self._drift = Drift()
        self._lead = profile.lag if params.lead is None else Lag(params.lead, params.lead)
        self._hover = Hover(profile.hover_parameter, context.airframe.hover_thrust, profile.raises)
        self._vision = Vision(params.vision_rate, contact.target)
        names = [*self._watch.names(), profile.hover_parameter]
        self._grip: Grip | None = None
        if context.payload is not None:
            output = profile.output(context.payload.channel, params.simulator)
            names.append(output.parameter)
            self._grip = Grip(contact, output)
        rates = {**profile.streams, **(profile.simulator_streams if params.simulator else {})}
        self._capacity, self._rates = Capacity(params), rates
        idle = {name: min(rates[name], IDLE) for name in INERTIAL if name in rates}
        self._chores = Chores(contact, self._capacity.fitting(rates | idle), names)
        self._now: Time = 0
        self._due: Time = 0
        self._opened: Time | None = None
        self._command: Command | None = None

    def look(self, now: Time) -> None:
        """Hear what came, see to what is wanted of it, send what is due. Raises DriverError."""
        self._now = now
        self.contact.listen(self._chores, now)
        self.helm.taking.silence = self.contact.silence
        self.helm.look(self.contact.age(now), now)
        self._flow(now)
        if now >= self._due:
            self._due = now + OFTEN
            self._learn(now)
            self._chores.step(now)
        self._note()

    def read(self, now: Time) -> Sequence[Measurement]:
        if self._opened is None:
            self._opened = now
        port = self.contact.port
        if port.heard is None and now - self._opened > PATIENCE:
            why = port.trouble() or "no autopilot was heard"
            way_out = "start it, or set the driver's `address` and `system`"
            raise DriverError(f"system {port.system} was not heard for 10 s: {why}; {way_out}")
        return self.contact.telemetry.take()

    def send(self, command: Command, now: Time) -> None:
        self._command = command
        self.helm.send(command, now)
        self._flow(now)

    def arm(self, command: Command, now: Time) -> bool:
        self._command = command
        try:
            return self.helm.arm(command, now)
        finally:
            self._flow(now)
            self._note()

    def cut(self, now: Time) -> None:
        self.helm.cut(now)
        self.helm.look(self.contact.age(now), now)
        self._chores.step(now)
        self._note()

    def tell(self, estimate: Estimate, now: Time) -> None:
        contact = self.contact
        stamp = contact.clock.to_boot(estimate.time) if contact.is_outside else None
        if stamp is None:
            return
        heard = contact.heard
        placed = heard.armed or "GPS_GLOBAL_ORIGIN" in heard.at
        is_lost = contact.profile.needs_origin and not placed
        self._drift.learn(estimate, contact.telemetry.odometry, now)
        for message in self._vision.of(estimate, stamp // 1000, is_lost, now):
            contact.port.send(message)

    def checks(self, now: Time) -> Sequence[Check]:
        misses = self.helm.prepare(now)
        self._flow(now)
        return [*self._watch.checks(misses, self._vision.told, now), *self._capacity.check()]

    def said(self) -> Sequence[Said]:
        return self.contact.said(is_disarming=self.helm.is_disarming)

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        if MeasurementKind.IMU in kinds:
            for name, rate in self._capacity.fitting(self._rates).items():
                self._chores.stream(name, rate, self._now)

    def reclaim(self, now: Time) -> None:
        self.helm.reclaim(now)
        self._note()

    def land(self, now: Time) -> bool:
        try:
            return self.helm.land(now)
        finally:
            self._note()

    def grip(self, is_open: bool, now: Time) -> None:
        if self._grip is None:
            raise Refused("it carries no payload")
        if self.taken is not None:
            raise Refused(f"somebody else has it: {self.taken.reason}")
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
        """Put the mode of a disarmed vehicle back to what it was before us, unless somebody else
        has it."""
        contact, before = self.contact, self.helm.modes.before
        is_ours = self.taken is None and not contact.heard.armed
        if not is_ours or before is None or before == contact.heard.mode:
            return
        params = (*contact.profile.mode_params(before), 0.0, 0.0, 0.0, 0.0)
        contact.port.send(
            mavlink.MAVLink_command_long_message(*contact.target, DO_SET_MODE, 0, *params)
        )

    def _flow(self, now: Time) -> None:
        """Send the set-point that is due."""
        command = self.helm.stream.due(now)
        if command is None or (anchor := self._anchor) is None:
            return
        contact = self.contact
        boot = contact.clock.to_boot(now) or now
        message = codec.encode(
            led(command, self._lead), target=contact.target, boot_ms=boot // MS, anchor=anchor,
            throttle=self._hover.throttle(contact.parameters.values),
            own_heading=contact.telemetry.heading,
        )  # fmt: skip
        contact.port.send(message)

    @property
    def _anchor(self) -> Anchor | None:
        """Where its frame lies."""
        own = self.contact.telemetry.anchor
        return self._drift.anchor if self.contact.is_outside else own

    def _learn(self, now: Time) -> None:
        """How much throttle holds it in the air."""
        heard, contact = self.contact.heard, self.contact
        flies = self.helm.goal is Goal.FOLLOW and heard.landed is Landed.AIR
        if self._command is not None:
            asked = heard.throttle if flies else None
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

    def _note(self) -> None:
        heard = self.contact.heard
        self.taken = self.helm.taken
        self.armed = None if heard.heartbeat is None else heard.armed
