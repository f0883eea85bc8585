"""An emulated autopilot: hears, estimates, flies, tells. It never asks for the truth.

Call `feel` with what its sensors measure, `step` at least fifty times a second. Time is that of the
run; its own begins `boot` before.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.geometry import LEVEL, ZERO, Vec3
from kybflow.core.signals import (
    NEVER,
    NS,
    Battery,
    Command,
    Imu,
    Measurement,
    Position,
    Time,
    Truth,
)
from kybflow.drivers.emulated_autopilot.control.arming import refusal
from kybflow.drivers.emulated_autopilot.control.control import Control
from kybflow.drivers.emulated_autopilot.control.failsafe import act, forgets
from kybflow.drivers.emulated_autopilot.control.flight import Flight
from kybflow.drivers.emulated_autopilot.control.payload import Outputs
from kybflow.drivers.emulated_autopilot.estimation.estimator import Estimator
from kybflow.drivers.emulated_autopilot.estimation.sensors import Senses
from kybflow.drivers.emulated_autopilot.firmware.firmware import Firmware, Role
from kybflow.drivers.emulated_autopilot.firmware.parameters import Parameters
from kybflow.drivers.emulated_autopilot.messages.channel import Channel
from kybflow.drivers.emulated_autopilot.messages.hearing import Ears
from kybflow.drivers.emulated_autopilot.messages.telemetry import MAKERS
from kybflow.drivers.emulated_autopilot.state import CRITICAL, INFO, Failures, Landed, State, Sticks
from kybflow.drivers.mavlink.firmware import profile_of
from kybflow.drivers.mavlink.transport.wire import Wire
from kybflow.world.vehicle_context import VehicleContext

REPEATS: Time = 30 * NS
"""How often ArduPilot says why it can't be armed."""
CHUNK = 50
"""Bytes of a STATUSTEXT."""
REST = Command(LEVEL, 0.0, ZERO, None, armed=False)


class Body(NamedTuple):
    """The vehicle under an autopilot. drive: takes what the attitude loop is to follow. move: opens
    or closes what holds the payload. look: the simulator's truth, for simulated sensors and for
    what the simulator itself tells."""

    drive: Callable[[Command, Time], None]
    move: Callable[[bool, Time], None]
    look: Callable[[], Truth]


class Autopilot:
    """One vehicle's. changes: parameters that differ from the firmware's own. `failures` breaks it;
    `commanded` is what its attitude loop follows, None while the rotors rest."""

    def __init__(
        self,
        firmware: Firmware,
        context: VehicleContext,
        body: Body,
        *,
        system: int = 1,
        changes: Mapping[str, float] | None = None,
        boot: Time = 3 * NS,
        generator: random.Random,
    ) -> None:
        parameters = Parameters(firmware, changes or {})
        estimator = Estimator(firmware, parameters, 0.0)
        self.state = State(firmware, parameters, context.airframe, estimator, self._say)
        self.state.mode = self.state.asked = firmware.start
        self.failures: Failures = self.state.failures
        self.px4 = firmware.name == "px4"
        self.system = system
        self.origin, self.height = firmware.origin, 0.0
        self.fix: Vec3 | None = None
        self.look = body.look
        self.commanded: Command | None = None
        self._body, self._boot, self._generator = body, boot, generator
        self._senses = Senses(body.look, generator)
        self._most = context.airframe.max_thrust
        parcel, place = context.payload, profile_of(firmware.name).output
        self.outputs = Outputs(
            self.state,
            None if parcel is None else place(parcel.channel, True).number,
            parcel is not None and parcel.aboard,
            body.move,
        )
        self._control = Control(context.airframe, 0.0)
        self.flight = Flight(self.state, self._control)
        self._channels: list[Channel] = []
        self._ears: list[tuple[Channel, Ears]] = []
        self._texts: list[tuple[str, int]] = []
        self._text_id = 0
        self._stepped: Time = 0
        self.now: Time = 0
        self._complained: Time = 0

    def connect(self, wire: Wire, key: bytes | None = None) -> Channel:
        """Speak over a wire too."""
        streams = {"HEARTBEAT": 1.0, **self.state.firmware.streams}
        channel = Channel(wire, self.system, key, streams, self.failures, self._generator)
        self._channels.append(channel)
        self._ears.append((channel, Ears(self, channel)))
        return channel

    @property
    def throttle(self) -> float:
        """0 to 1."""
        return self._control.thrust / self._most if self.state.armed else 0.0

    def boot_us(self, now: Time) -> int:
        """Its own time, microseconds."""
        return (now + self._boot) // 1000

    def boot_ms(self, now: Time) -> int:
        return (now + self._boot) // 1_000_000 & 0xFFFF_FFFF

    def run_time(self, stamp_us: int) -> Time:
        """The run's time of one of its own."""
        return stamp_us * 1000 - self._boot

    def feel(self, measured: Measurement, now: Time) -> None:
        """What the simulated sensors measured; a pose from outside is not its own."""
        if isinstance(measured, Imu):
            self.state.estimator.feel(measured, now)
        elif isinstance(measured, Battery):
            self.state.battery = measured
        elif isinstance(measured, Position):
            self.fix = measured.position
            self.state.estimator.fix(measured.position, measured.time, now)

    def step(self, now: Time) -> None:
        """Hear, estimate, fly, tell."""
        self.now = now
        self._hear(now)
        self._sense(now)
        self._find_home(now)
        self._fly(now, (now - self._stepped) / NS)
        self._complain(now)
        self._tell(now)
        self._stepped = now

    def start(self, now: Time) -> None:
        """Arm."""
        state = self.state
        state.armed, state.armed_at, state.landed = True, now, Landed.GROUND
        state.home = state.estimator.position
        self.flight.arm(now)
        state.say("Armed by external command" if self.px4 else "Arming motors", INFO)

    def stop(self, now: Time, words: str) -> None:
        """Disarm, wherever it is."""
        state = self.state
        state.armed, state.landed, state.climb_to = False, Landed.GROUND, None
        state.failed_over, self.commanded = "", None
        if not self.px4:
            state.wanted = None
        if words:
            state.say(words, INFO)
        if self.px4 and state.mode != state.asked:
            self.change(state.asked, now, asked=False)
        self._body.drive(REST, now)

    def change(self, mode: int, now: Time, *, asked: bool) -> None:
        """Go into a mode. asked: whether somebody wants it, not a failsafe."""
        state, before = self.state, self.state.mode
        if asked:
            state.asked = mode
        if mode == before:
            return
        state.mode = mode
        state.climb_to = None
        if not self.px4:
            state.wanted = None
        self.flight.enter(now)
        for channel in self._channels:
            channel.send(MAKERS["HEARTBEAT"](self))
            if self.px4:
                channel.send(MAKERS["CURRENT_MODE"](self))

    def give_to_pilot(self, mode: str) -> None:
        """A transmitter is there, sticks in the middle, and its switch asks for a mode."""
        self.state.sticks = Sticks(NEVER, 0.0, 0.0, 0.0, 0.5)
        for number, known in self.state.firmware.modes.items():
            if known.name == mode.upper():
                self.change(number, self.now, asked=True)

    def _hear(self, now: Time) -> None:
        for channel, ears in self._ears:
            for message in channel.receive(now):
                ears.hear(message)

    def _sense(self, now: Time) -> None:
        if self._senses.read(now):
            self.height = self._senses.height
            self.state.estimator.press(self.height, now)
            self.state.estimator.aim(self._senses.heading, now)

    def _find_home(self, now: Time) -> None:
        """Where GPS was first seen, its frame has a place on earth."""
        state, zero = self.state, self.state.estimator.local_zero
        if not state.estimator.has_position(now):
            return
        if state.origin is None and zero is not None:
            latitude, longitude, height = self.origin.place(zero)
            state.origin = self.origin._replace(
                latitude=latitude, longitude=longitude, height=height
            )
        if state.home is None and state.origin is not None:
            state.home = state.estimator.position

    def _fly(self, now: Time, dt: float) -> None:
        state = self.state
        if not state.armed:
            return
        if forgets(state, now):
            state.wanted = None
            self.flight.enter(now)
        if state.flying.role is Role.TAKE_OFF and state.has_flown and state.climb_to is None:
            self.change(state.firmware.hold, now, asked=True)
        own = act(state, now)
        if own is not None:
            self._fail_over(own.mode, own.words, own.cause, now)
        elif state.failed_over == "set-points" and state.flying.role is Role.HOLD:
            self._resume(now)
        if state.armed:
            self.commanded = self.flight.step(now, dt)
            self._body.drive(self.commanded, now)
            self.flight.watch(now)

    def _fail_over(self, mode: int | None, words: str, cause: str, now: Time) -> None:
        if mode is None:
            self.stop(now, words)
            return
        self.state.failed_over = cause
        self.state.say(words, CRITICAL)
        self.change(mode, now, asked=False)

    def _resume(self, now: Time) -> None:
        """Hold ends when set-points are back; a landing doesn't."""
        if self.state.streams(now):
            self.state.failed_over = ""
            self.change(self.state.asked, now, asked=False)

    def _complain(self, now: Time) -> None:
        if self.px4 or self.state.armed or now - self._complained < REPEATS:
            return
        self._complained = now
        reason = refusal(self.state, now)
        if reason and not reason.endswith("not armable"):
            self._say(f"PreArm: {reason.partition(': ')[2]}", CRITICAL)

    def _say(self, words: str, severity: int) -> None:
        self._texts.append((words, severity))

    def _tell(self, now: Time) -> None:
        texts, self._texts = self._texts, []
        for words, severity in texts:
            self._speak(words, severity, now)
        for channel in self._channels:
            for name in channel.due(now):
                message = MAKERS[name](self)
                if message is not None:
                    channel.send(message)

    def _speak(self, words: str, severity: int, now: Time) -> None:
        """In chunks; PX4 only to ground stations, most of it with a tab at its end."""
        data = (f"{words}\t" if self.px4 else words).encode()
        chunks = [data[at : at + CHUNK] for at in range(0, len(data), CHUNK)]
        self._text_id = self._text_id % 0xFFFF + 1
        number = self._text_id if len(chunks) > 1 else 0
        for channel in self._channels:
            if not self.px4 or channel.has_station(now):
                for place, chunk in enumerate(chunks):
                    channel.send(mavlink.MAVLink_statustext_message(severity, chunk, number, place))
