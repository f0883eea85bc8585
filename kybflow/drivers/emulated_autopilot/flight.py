"""The flight of an emulated autopilot: the targets of each mode, and landing detection.

Speeds are in m/s and heights in metres, in the autopilot's own local ENU frame.
"""

from __future__ import annotations

from math import hypot

from kybflow.core.geometry import ZERO, Quat, Vec3, body_z, from_heading, heading_of, integrate
from kybflow.core.signals import NS, Command, Time
from kybflow.drivers.emulated_autopilot.firmware import EmulatedFirmware
from kybflow.drivers.emulated_autopilot.setpoints import AttitudeTarget
from kybflow.drivers.emulated_autopilot.state import EmulatedState, Role
from kybflow.drivers.emulation.control import FREE, STEADY_SPEED, PositionControl, PositionTarget
from kybflow.drivers.mavlink.telemetry.received_status import LandedState

LANDED_AFTER_S, LANDED_THRUST, LANDED_RATE = 0.6, 0.65, 0.25
"""Landing: for this many seconds the thrust is less than this fraction of the hover thrust, and the
vertical speed less than this."""
CONTACT_AFTER_S, CONTACT_THRUST = 0.3, 0.9
"""Ground contact during a landing: in this many seconds the vehicle has hardly descended, with a
thrust of less than this fraction of the hover thrust. From then on it only stays level, as PX4 does
with `ground_contact` and ArduPilot with `land_complete_maybe`."""
LIFT_OFF_THRUST, LIFTED_HEIGHT = 0.9, 0.08
"""Lift-off: the thrust is more than this fraction of the hover thrust, and the vehicle this far
above the ground."""
CLEAR_HEIGHT = 0.5
"""Above this height nothing supports the vehicle from below, unless it is landing."""
HEIGHT_TOLERANCE = 0.15
SPOOL_UP_NS: Time = NS
"""How long the rotors spool up before a take-off."""
STICK_SPEED, STICK_TURN = 2.0, 1.0
"""The speed and the turn rate at full stick deflection, m/s and rad/s."""
SINK_SPEED = 2.4
"""The descent speed in a pilot's mode without a pilot, m/s: the throttle stick reads zero."""
FAST_ABOVE = 5.0
"""Above this height, metres, the vehicle descends twice as fast."""


class EmulatedFlight:
    """The flight of one vehicle."""

    def __init__(
        self, state: EmulatedState, firmware: EmulatedFirmware, control: PositionControl
    ) -> None:
        self._state, self._firmware, self._control = state, firmware, control
        self._held: Vec3 = ZERO
        self._heading = 0.0
        self._attitude: Quat = from_heading(0.0)
        self._turning = False
        self._slight: Time | None = None
        self._contact_at: Time = 0
        self._was_at: float | None = None
        self._has_touched = False
        self._is_home = False
        self._return_height = 0.0
        self._began: Time = 0
        self._idle_at: Time = 0
        self._ramp = 1.0

    def enter(self, now: Time) -> None:
        """Enter the mode in force; at first the vehicle holds its position."""
        estimator = self._state.estimator
        vx, vy, vz = estimator.velocity
        x, y, z = estimator.position
        self._held = (x + 0.4 * vx, y + 0.4 * vy, z + 0.3 * vz)
        self._heading = estimator.attitude.heading
        self._attitude = estimator.attitude.value
        self._is_home, self._turning, self._began = False, False, now
        self._contact_at, self._was_at = now + round(CONTACT_AFTER_S * NS), None
        self._has_touched = False
        state = self._state
        if state.flying.role is Role.RETURN:
            hx, hy, hz = state.home or self._held
            away = hypot(hx - x, hy - y)
            up = self._firmware.return_height(state.parameters, away, z - hz)
            self._return_height = hz + up
        if state.flying.role is Role.FOLLOW:
            state.climb_to = None
        # the take-off mode begins a take-off, whether it was selected before or after arming
        if state.flying.role is Role.TAKE_OFF and state.armed and state.is_down:
            state.climb_to = state.ground + state.parameters[self._firmware.takeoff_parameter]

    def arm(self, now: Time) -> None:
        """Begin a flight: the rotors start to turn."""
        state, estimator = self._state, self._state.estimator
        state.ground, state.has_flown = estimator.position[2], False
        state.climb_to = None
        self._control.begin(estimator.attitude.heading)
        self.enter(now)

    def step(self, now: Time, dt: float) -> Command:
        """Return the current command for the attitude loop. Called while armed."""
        state = self._state
        if state.is_down and not self._starts(now):
            self._idle_at = now
            return self._control.ground(state.estimator.attitude.heading)
        if self._firmware.ramp:
            self._ramp = min(1.0, (now - self._idle_at) / NS / self._firmware.ramp)
        match state.flying.role:
            case Role.FOLLOW:
                return self._follow(now, dt)
            case Role.TAKE_OFF:
                return self._reach(self._climbing(dt), dt)
            case Role.LAND:
                return self._reach(self._landing(now), dt)
            case Role.RETURN:
                return self._reach(self._returning(), dt)
            case Role.PILOT:
                return self._reach(self._steered(now), dt)
        return self._reach(PositionTarget(self._held, ZERO, heading=self._heading), dt)

    def watch(self, now: Time, dt: float) -> None:
        """Detect lift-off and landing; in the air, learn the hover thrust."""
        state, control, estimator = self._state, self._control, self._state.estimator
        climb, height = estimator.velocity[2], estimator.position[2] - state.ground
        if not state.is_down and abs(climb) < STEADY_SPEED:
            clear = height > CLEAR_HEIGHT and state.flying.role not in (Role.LAND, Role.RETURN)
            up = body_z(estimator.attitude.value)[2]
            control.learn(up, estimator.acceleration[2], clear, dt)
        share = control.thrust / control.hover
        if now >= self._contact_at:
            self._detect_contact(now, share)
        if state.is_down:
            if share > LIFT_OFF_THRUST and height > LIFTED_HEIGHT:
                state.landed, state.has_flown, self._slight = LandedState.AIR, True, None
        elif share < LANDED_THRUST and abs(climb) < LANDED_RATE:
            self._slight = now if self._slight is None else self._slight
            if now - self._slight > LANDED_AFTER_S * NS:
                state.landed, state.landed_at, self._slight = LandedState.GROUND, now, None
                state.climb_to = None
        else:
            self._slight = None
            role = state.flying.role
            if state.climb_to is not None and role in (Role.TAKE_OFF, Role.FOLLOW):
                state.landed = LandedState.TAKING_OFF
            else:
                lands = role is Role.LAND or (
                    role is Role.RETURN and self._is_home and self._firmware.lands_to_return
                )
                state.landed = LandedState.LANDING if lands else LandedState.AIR

    def _detect_contact(self, now: Time, share: float) -> None:
        """Detect ground contact or its end. A vehicle that still climbed when the landing began may
        only have stopped climbing."""
        was, height = self._was_at, self._state.estimator.position[2]
        if was is not None and was - height >= LANDED_RATE * CONTACT_AFTER_S:
            self._has_touched = False
        elif was is not None and share < CONTACT_THRUST:
            self._has_touched = True
        self._contact_at, self._was_at = now + round(CONTACT_AFTER_S * NS), height

    def _starts(self, now: Time) -> bool:
        """Return whether the vehicle is commanded to leave the ground."""
        state = self._state
        if now - state.armed_at < SPOOL_UP_NS:
            return False
        if state.climb_to is not None and state.flying.role in (Role.TAKE_OFF, Role.FOLLOW):
            return now - self._began > SPOOL_UP_NS
        role = state.flying.role
        if role is Role.PILOT:
            sticks = state.sticks
            return state.has_pilot(now) and sticks is not None and sticks.throttle > 0.6
        if role is not Role.FOLLOW or state.wanted is None:
            return False
        if isinstance(state.wanted, AttitudeTarget):
            return state.wanted.throttle > 0.2
        return self._firmware.obeys_on_ground and self._rises(state.wanted)

    def _rises(self, target: PositionTarget) -> bool:
        z, climb = target.position[2], target.velocity[2]
        if z is not None:
            return z - self._state.estimator.position[2] > HEIGHT_TOLERANCE
        if climb is not None:
            return climb > 0.05
        return (target.acceleration[2] or 0.0) > 0.2

    def _follow(self, now: Time, dt: float) -> Command:
        state = self._state
        if state.climb_to is not None:
            return self._reach(self._climbing(dt), dt)
        wanted = state.wanted
        if isinstance(wanted, AttitudeTarget):
            return self._tilt(wanted, dt)
        self._turning = False
        if wanted is None:
            wanted = PositionTarget(self._held, ZERO, heading=self._heading)
        return self._reach(wanted, dt)

    def _tilt(self, wanted: AttitudeTarget, dt: float) -> Command:
        state, control, heading = self._state, self._control, self._state.estimator.attitude.heading
        rates = wanted.rates or ZERO
        if wanted.attitude is not None:
            self._attitude = wanted.attitude
        else:
            begun = self._attitude if self._turning else state.estimator.attitude.value
            self._attitude = integrate(begun, rates, dt)
        self._turning = wanted.attitude is None
        climb = self._firmware.climb_rate(state.parameters, wanted.throttle)
        if climb is not None:
            level = PositionTarget(velocity=(None, None, climb), heading=heading_of(self._attitude))
            speeds = self._firmware.speeds(state.parameters)
            control.follow(level, *self._where(), speeds, dt)
            return control.hold(self._attitude, control.thrust, rates, heading)
        thrust = wanted.throttle * state.airframe.max_thrust
        return control.hold(self._attitude, thrust, rates, heading)

    def _climbing(self, dt: float) -> PositionTarget:
        """Return the target of a take-off: a steady climb, then a hold at the height reached."""
        state, (x, y, z) = self._state, self._held
        to = self._held[2] if state.climb_to is None else state.climb_to
        up = self._firmware.takes_off
        if self._firmware.ramp:
            left = max(0.0, to - state.estimator.position[2])
            up = min(self._ramp * up, self._firmware.approach * left)
        z = min(to, max(z, state.estimator.position[2] - 0.3) + up * dt)
        self._held = (x, y, z)
        is_near = abs(state.estimator.position[2] - to) < HEIGHT_TOLERANCE
        if state.climb_to is not None and is_near and not state.is_down:
            state.climb_to, self._held = None, (x, y, to)
        return PositionTarget(self._held, (0.0, 0.0, up if z < to else 0.0), heading=self._heading)

    def _landing(self, now: Time) -> PositionTarget:
        """Return the target of a vertical descent. Without a position, or in ground contact, the
        vehicle only stays level."""
        state, (x, y, _) = self._state, self._held
        down = self._firmware.land_speed(state.parameters)
        if state.estimator.position[2] - state.ground > FAST_ABOVE:
            down *= 2.0
        if not state.estimator.has_position(now) or self._has_touched:
            return PositionTarget((None, None, None), (None, None, -down), heading=self._heading)
        return PositionTarget((x, y, None), (0.0, 0.0, -down), heading=self._heading)

    def _returning(self) -> PositionTarget:
        """Return the target of a return: first up, then to the home position, then down."""
        state, firmware = self._state, self._firmware
        hx, hy, _ = state.home or self._held
        x, y, z = state.estimator.position
        away, up = hypot(hx - x, hy - y), self._return_height
        if self._is_home or away < 0.5:
            self._is_home = True
            down = firmware.land_speed(state.parameters)
            down *= 2.0 if z - state.ground > FAST_ABOVE else 1.0
            return PositionTarget((hx, hy, None), (0.0, 0.0, -down), heading=self._heading)
        if z < up - 0.5:
            return PositionTarget((*self._held[:2], up), heading=self._heading)
        return PositionTarget((hx, hy, up), heading=self._heading)

    def _steered(self, now: Time) -> PositionTarget:
        """Return the target commanded by the pilot's sticks; without a pilot the throttle reads
        zero, unless the firmware knows that it has never had one."""
        state, sticks = self._state, self._state.sticks
        if sticks is None and state.mode in self._firmware.holds_unsteered:
            return PositionTarget(self._held, ZERO, heading=self._heading)
        if sticks is None or not state.has_pilot(now):
            return PositionTarget(
                (*self._held[:2], None), (0.0, 0.0, -SINK_SPEED), heading=self._heading
            )
        heading = state.estimator.attitude.heading
        vx, vy, vz = (
            STICK_SPEED * v for v in (sticks.pitch, -sticks.roll, 2.0 * sticks.throttle - 1.0)
        )
        if not state.is_down and max(abs(vx), abs(vy), abs(vz), abs(sticks.yaw)) < 0.1:
            return PositionTarget(self._held, ZERO, heading=self._heading)
        self.enter(now)
        w, _, _, z = from_heading(heading)
        c, s = w * w - z * z, 2.0 * w * z
        turn = -STICK_TURN * sticks.yaw
        return PositionTarget(velocity=(c * vx - s * vy, s * vx + c * vy, vz), heading_rate=turn)

    def _reach(self, target: PositionTarget, dt: float) -> Command:
        position, velocity, heading = self._where()
        speeds = self._firmware.speeds(self._state.parameters)
        if target.velocity == FREE:
            speeds = speeds._replace(up=self._ramp * speeds.up)
        return self._control.follow(target, position, velocity, heading, speeds, dt)

    def _where(self) -> tuple[Vec3, Vec3, float]:
        estimator = self._state.estimator
        return estimator.position, estimator.velocity, estimator.attitude.heading
