"""An emulated autopilot: it estimates, flies, changes modes, arms, and triggers failsafes.

It never reads the simulator's truth. `session.MavlinkEndpoint` connects it to MAVLink. Times are in
the run's time; the autopilot's own clock started `boot` earlier.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from functools import partial

from kybflow.core.geometry import LEVEL, ZERO, Vec3, conjugate, multiply
from kybflow.core.signals import NEVER, NS, Battery, Command, Imu, Measurement, Position, Time
from kybflow.drivers.emulated_autopilot.estimator import EmulatedEstimator
from kybflow.drivers.emulated_autopilot.firmware import EmulatedFirmware
from kybflow.drivers.emulated_autopilot.flight import EmulatedFlight
from kybflow.drivers.emulated_autopilot.state import (
    CRITICAL,
    INFO,
    AutopilotFailures,
    EmulatedParameters,
    EmulatedState,
    Outputs,
    PilotSticks,
    Role,
)
from kybflow.drivers.emulation.body import BatteryMonitor, CompassAndBarometer, SimulatedBody
from kybflow.drivers.emulation.control import PositionControl
from kybflow.drivers.mavlink.telemetry.received_status import LandedState
from kybflow.world.vehicle_context import VehicleContext

TEXT_PERIOD_NS: Time = 30 * NS
"""How often a firmware that reports unasked why it can't be armed repeats the reason."""
REST = Command(LEVEL, 0.0, ZERO, None, armed=False)


class OnboardAutopilot:
    """The autopilot of one vehicle.

    changes: parameters that differ from the firmware's defaults.
    failures: the injected failures.
    commanded: the command for its attitude loop, None while the rotors rest.
    texts: the texts to be sent, with their severity.
    on_mode_change: called after its mode has changed.
    """

    def __init__(
        self,
        firmware: EmulatedFirmware,
        context: VehicleContext,
        body: SimulatedBody,
        *,
        system: int = 1,
        changes: Mapping[str, float] | None = None,
        boot: Time = 3 * NS,
        generator: random.Random,
    ) -> None:
        is_bytewise = firmware.profile.integer_parameters_bytewise
        parameters = EmulatedParameters(
            firmware.parameters, changes or {}, bytewise=is_bytewise,
            tells_errors=firmware.tells_parameter_errors,
        )  # fmt: skip
        estimator = EmulatedEstimator(
            partial(firmware.sources, parameters),
            forgets=firmware.forgets, waits=firmware.waits, adopts=firmware.adopts,
            averages=firmware.averages,
        )  # fmt: skip
        self.failures = AutopilotFailures()
        self.state = EmulatedState(
            firmware.modes, firmware.loss_parameter, parameters, context.airframe, estimator,
            self.failures, BatteryMonitor(self.failures), self._say, firmware.start, firmware.start,
        )  # fmt: skip
        self.firmware, self.system = firmware, system
        self.origin, self.height = firmware.origin, 0.0
        self.fix: Vec3 | None = None
        self.look = body.look
        self.commanded: Command | None = None
        self.texts: list[tuple[str, int]] = []
        self.on_mode_change: Callable[[], None] = lambda: None
        self.now: Time = 0
        self._body, self._boot = body, boot
        self._sensors = CompassAndBarometer(body.look, generator)
        self._most = context.airframe.max_thrust
        parcel = context.payload
        place = firmware.profile.output
        channel = None if parcel is None else place(parcel.channel, True).number
        is_closed = parcel is not None and parcel.aboard
        self.outputs = Outputs(self.state, channel, firmware.pulses, is_closed, body.move)
        self._control = PositionControl(context.airframe, 0.0)
        self.flight = EmulatedFlight(self.state, firmware, self._control)
        self._stepped: Time = 0
        self._complained: Time = 0

    @property
    def throttle(self) -> float:
        """The commanded throttle, 0 to 1; zero while disarmed."""
        return self._control.thrust / self._most if self.state.armed else 0.0

    def boot_us(self, now: Time) -> int:
        """Return the time since the autopilot's boot, microseconds."""
        return (now + self._boot) // 1000

    def boot_ms(self, now: Time) -> int:
        return (now + self._boot) // 1_000_000 & 0xFFFF_FFFF

    def run_time(self, stamp_us: int) -> Time:
        """Convert a time stamp of the autopilot's clock to the run's time."""
        return stamp_us * 1000 - self._boot

    def add_measurement(self, measured: Measurement, now: Time) -> None:
        """Handle a measurement of the simulated sensors."""
        if isinstance(measured, Imu):
            self.state.estimator.add_imu(measured, now)
        elif isinstance(measured, Battery):
            self.state.battery.measure(measured)
        elif isinstance(measured, Position):
            self.fix = measured.position
            self.state.estimator.fix(measured.position, measured.time, now)

    def step(self, now: Time) -> None:
        """Update the estimate, then the flight."""
        self.now = now
        if self.failures.pilot:
            self.give_to_pilot(self.failures.pilot)
            self.failures.pilot = ""
        if self._sensors.read(now):
            self.height = self._sensors.height
            self.state.estimator.press(self.height, now)
            self.state.estimator.aim(self._sensors.heading, now)
        self._find_home(now)
        self._fly(now, (now - self._stepped) / NS)
        complains = self.firmware.complains and not self.state.armed
        if complains and now - self._complained >= TEXT_PERIOD_NS:
            self._complained = now
            reason = self.firmware.refuses_arming(self.state, now)
            if reason and not reason.endswith("not armable"):
                self._say(f"PreArm: {reason.partition(': ')[2]}", CRITICAL)
        self._stepped = now

    def start(self, now: Time) -> None:
        state = self.state
        state.armed, state.armed_at, state.landed = True, now, LandedState.GROUND
        state.home = state.estimator.position
        self.flight.arm(now)
        state.say(self.firmware.armed_text, INFO)

    def stop(self, now: Time, words: str) -> None:
        """Disarm, even in the air."""
        state = self.state
        state.armed, state.landed, state.climb_to = False, LandedState.GROUND, None
        state.failed_over, self.commanded = "", None
        if not self.firmware.keeps_setpoints:
            state.wanted = None
        if words:
            state.say(words, INFO)
        if self.firmware.returns_to_mode and state.mode != state.asked:
            self.change(state.asked, now, asked=False)
        self._body.drive(REST, now)

    def change(self, mode: int, now: Time, *, asked: bool) -> None:
        """Change to a mode. asked: whether the mode was requested, rather than chosen by a
        failsafe."""
        state, before = self.state, self.state.mode
        if asked:
            state.asked = mode
        if mode == before:
            return
        state.mode = mode
        state.climb_to = None
        if not self.firmware.keeps_setpoints:
            state.wanted = None
        self.flight.enter(now)
        self.on_mode_change()

    def give_to_pilot(self, mode: str) -> None:
        """Switch on a transmitter with centred sticks whose mode switch selects `mode`."""
        self.state.sticks = PilotSticks(NEVER, 0.0, 0.0, 0.0, 0.5)
        for number, known in self.firmware.modes.items():
            if known.name == mode.upper():
                self.change(number, self.now, asked=True)

    def _find_home(self, now: Time) -> None:
        """Fix the local frame on earth at the first GPS fix, and set the home position."""
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
        if self.firmware.drops_setpoint(state, now):
            state.wanted = None
            self.flight.enter(now)
        if state.flying.role is Role.TAKE_OFF and state.has_flown and state.climb_to is None:
            self.change(self.firmware.hold, now, asked=True)
        own = self.firmware.acts(state, now)
        if own is not None:
            if own.mode is None:
                self.stop(now, own.words)
            else:
                state.failed_over = own.cause
                state.say(own.words, CRITICAL)
                self.change(own.mode, now, asked=False)
        elif (
            state.failed_over == "setpoints"
            and state.flying.role is Role.HOLD
            and state.streams(now)
        ):
            state.failed_over = ""
            self.change(state.asked, now, asked=False)
        if state.armed:
            self.commanded = command = self.flight.step(now, dt)
            # relative to the attitude loop's own estimate; a real autopilot has only one estimator
            off = multiply(conjugate(state.estimator.attitude.value), command.attitude)
            seen = command._replace(attitude=multiply(self._body.attitude(), off))
            self._body.drive(seen, now)
            self.flight.watch(now, dt)

    def _say(self, words: str, severity: int) -> None:
        self.texts.append((words, severity))
