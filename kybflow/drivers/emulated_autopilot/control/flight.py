"""How an emulated autopilot flies: what each mode makes of its goals, and when it is on the ground.

Speeds in m/s, heights in metres, ENU of its own local frame.
"""

from __future__ import annotations

from math import hypot

from kybflow.core.geometry import ZERO, Quat, Vec3, from_heading, heading_of, integrate
from kybflow.core.signals import NS, Command, Time
from kybflow.drivers.emulated_autopilot.control.arming import has_pilot
from kybflow.drivers.emulated_autopilot.control.control import Control, Goal, Speeds
from kybflow.drivers.emulated_autopilot.control.setpoints import Tilt
from kybflow.drivers.emulated_autopilot.firmware.ardupilot import SINKS
from kybflow.drivers.emulated_autopilot.firmware.firmware import Role
from kybflow.drivers.emulated_autopilot.state import Landed, State

TAKES_HOLD, SLIGHT, SLOW = 0.6, 0.65, 0.25
"""It stands when for so many seconds its thrust is less than this part of its weight and it climbs
or sinks less than so."""
LIFTS, LIFTED = 0.9, 0.08
"""It flies when its thrust is more than this part of its weight and it is so high above where it
stood."""
REACHED = 0.15
SPOOLS: Time = NS
"""How long rotors take to run up before a take-off."""
STICK_SPEED, STICK_TURN = 2.0, 1.0
"""What a full stick asks for, m/s and rad/s."""
FAST_ABOVE = 5.0
"""Above this height a landing is faster than it will be."""


class Flight:
    """The flight of one vehicle. `attitude` is what the sent attitude means, for rates."""

    def __init__(self, state: State, control: Control) -> None:
        self._state, self._control = state, control
        self._held: Vec3 = ZERO
        self._heading = 0.0
        self._attitude: Quat = from_heading(0.0)
        self._turning = False
        self._slight: Time | None = None
        self._is_home = False
        self._began: Time = 0

    def enter(self, now: Time) -> None:
        """A mode begins: what it holds is where the vehicle is."""
        estimator = self._state.estimator
        vx, vy, vz = estimator.velocity
        x, y, z = estimator.position
        self._held = (x + 0.4 * vx, y + 0.4 * vy, z + 0.3 * vz)
        self._heading = estimator.attitude.heading
        self._attitude = estimator.attitude.value
        self._is_home, self._turning, self._began = False, False, now
        if self._state.flying.role is Role.FOLLOW:
            self._state.climb_to = None
        self._leave_the_ground()

    def arm(self, now: Time) -> None:
        """The rotors begin to turn."""
        state, estimator = self._state, self._state.estimator
        state.ground, state.has_flown = estimator.position[2], False
        state.climb_to = None
        self._control.begin(estimator.attitude.heading)
        self.enter(now)

    def _leave_the_ground(self) -> None:
        """By PX4's mode for it, armed before or after."""
        state = self._state
        if state.flying.role is Role.TAKE_OFF and state.armed and state.is_down:
            state.climb_to = state.ground + state.parameters["MIS_TAKEOFF_ALT"]

    def step(self, now: Time, dt: float) -> Command:
        """What the attitude loop is to do now, while armed."""
        state = self._state
        if state.is_down and not self._starts(now):
            return self._control.ground(state.estimator.attitude.heading)
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
        return self._reach(Goal(self._held, ZERO, heading=self._heading), dt)

    def watch(self, now: Time) -> None:
        """Notice that it has left the ground, or stands on it."""
        state, climb = self._state, self._state.estimator.velocity[2]
        share = self._control.thrust / state.airframe.hover_thrust
        if state.is_down:
            high = state.estimator.position[2] - state.ground > LIFTED
            if share > LIFTS and high:
                state.landed, state.has_flown, self._slight = Landed.AIR, True, None
        elif share < SLIGHT and abs(climb) < SLOW:
            self._slight = now if self._slight is None else self._slight
            if now - self._slight > TAKES_HOLD * NS:
                state.landed, state.landed_at, self._slight = Landed.GROUND, now, None
                state.climb_to = None
        else:
            self._slight = None
            self._tell()

    def _tell(self) -> None:
        role, climbing = self._state.flying.role, self._state.climb_to is not None
        taking_off = climbing and role in (Role.TAKE_OFF, Role.FOLLOW)
        down = Landed.LANDING if role is Role.LAND else Landed.AIR
        self._state.landed = Landed.TAKING_OFF if taking_off else down

    def _starts(self, now: Time) -> bool:
        """Whether it is asked to leave the ground."""
        state = self._state
        if now - state.armed_at < SPOOLS:
            return False
        if state.climb_to is not None and state.flying.role in (Role.TAKE_OFF, Role.FOLLOW):
            return now - self._began > SPOOLS
        role = state.flying.role
        if role is Role.PILOT:
            sticks = state.sticks
            return has_pilot(state, now) and sticks is not None and sticks.throttle > 0.6
        if role is not Role.FOLLOW or not state.firmware.obeys_on_ground or state.wanted is None:
            return False
        if isinstance(state.wanted, Tilt):
            return state.wanted.throttle > 0.2
        return self._rises(state.wanted)

    def _rises(self, goal: Goal) -> bool:
        z, climb = goal.position[2], goal.velocity[2]
        if z is not None:
            return z - self._state.estimator.position[2] > REACHED
        if climb is not None:
            return climb > 0.05
        return (goal.acceleration[2] or 0.0) > 0.2

    def _follow(self, now: Time, dt: float) -> Command:
        state = self._state
        if state.climb_to is not None:
            return self._reach(self._climbing(dt), dt)
        wanted = state.wanted
        if isinstance(wanted, Tilt):
            return self._tilt(wanted, dt)
        self._turning = False
        if wanted is None:
            wanted = Goal(self._held, ZERO, heading=self._heading)
        return self._reach(wanted, dt)

    def _tilt(self, wanted: Tilt, dt: float) -> Command:
        state, control, heading = self._state, self._control, self._state.estimator.attitude.heading
        rates = wanted.rates or ZERO
        if wanted.attitude is not None:
            self._attitude = wanted.attitude
        else:
            begun = self._attitude if self._turning else state.estimator.attitude.value
            self._attitude = integrate(begun, rates, dt)
        self._turning = wanted.attitude is None
        if state.firmware.name == "ardupilot" and not int(state.parameters["GUID_OPTIONS"]) & 8:
            climb = (wanted.throttle - 0.5) * state.parameters["WPNAV_SPEED_UP"] / 50.0
            level = Goal(velocity=(None, None, climb), heading=heading_of(self._attitude))
            control.follow(level, *self._where(), self._speeds(), dt)
            return control.hold(self._attitude, control.thrust, rates, heading)
        thrust = wanted.throttle * state.airframe.max_thrust
        return control.hold(self._attitude, thrust, rates, heading)

    def _climbing(self, dt: float) -> Goal:
        """Up at a steady speed, then hold."""
        state, (x, y, z) = self._state, self._held
        to = self._held[2] if state.climb_to is None else state.climb_to
        up = state.firmware.takes_off
        z = min(to, max(z, state.estimator.position[2] - 0.3) + up * dt)
        self._held = (x, y, z)
        is_near = abs(state.estimator.position[2] - to) < REACHED
        if state.climb_to is not None and is_near and not state.is_down:
            state.climb_to, self._held = None, (x, y, to)
        return Goal(self._held, (0.0, 0.0, up if z < to else 0.0), heading=self._heading)

    def _landing(self, now: Time) -> Goal:
        """Straight down; without a position level."""
        state, (x, y, _) = self._state, self._held
        down = self._land_speed()
        if state.estimator.position[2] - state.ground > FAST_ABOVE:
            down *= 2.0
        if not state.estimator.has_position(now):
            return Goal((None, None, None), (None, None, -down), heading=self._heading)
        return Goal((x, y, None), (0.0, 0.0, -down), heading=self._heading)

    def _land_speed(self) -> float:
        p = self._state.parameters
        return p["MPC_LAND_SPEED"] if self._state.firmware.bytewise else p["LAND_SPEED"] / 100.0

    def _returning(self) -> Goal:
        """Up, home, down."""
        state, p = self._state, self._state.parameters
        hx, hy, _ = state.home or self._held
        x, y, z = state.estimator.position
        away = hypot(hx - x, hy - y)
        up = p["RTL_RETURN_ALT"] if state.firmware.bytewise else p["RTL_ALT"] / 100.0
        if self._is_home or away < 0.5:
            self._is_home = True
            down = self._land_speed() * (2.0 if z - state.ground > FAST_ABOVE else 1.0)
            return Goal((hx, hy, None), (0.0, 0.0, -down), heading=self._heading)
        if z < state.ground + up - 0.5:
            return Goal((*self._held[:2], state.ground + up), heading=self._heading)
        return Goal((hx, hy, state.ground + up), heading=self._heading)

    def _steered(self, now: Time) -> Goal:
        """A pilot flies, or nobody does: then the throttle reads zero."""
        state, sticks = self._state, self._state.sticks
        if sticks is None or not has_pilot(state, now):
            return Goal((*self._held[:2], None), (0.0, 0.0, -SINKS), heading=self._heading)
        heading = state.estimator.attitude.heading
        vx, vy, vz = (
            STICK_SPEED * v for v in (sticks.pitch, -sticks.roll, 2.0 * sticks.throttle - 1.0)
        )
        if not state.is_down and max(abs(vx), abs(vy), abs(vz), abs(sticks.yaw)) < 0.1:
            return Goal(self._held, ZERO, heading=self._heading)
        self.enter(now)
        w, _, _, z = from_heading(heading)
        c, s = w * w - z * z, 2.0 * w * z
        turn = -STICK_TURN * sticks.yaw
        return Goal(velocity=(c * vx - s * vy, s * vx + c * vy, vz), heading_rate=turn)

    def _reach(self, goal: Goal, dt: float) -> Command:
        position, velocity, heading = self._where()
        return self._control.follow(goal, position, velocity, heading, self._speeds(), dt)

    def _where(self) -> tuple[Vec3, Vec3, float]:
        estimator = self._state.estimator
        return estimator.position, estimator.velocity, estimator.attitude.heading

    def _speeds(self) -> Speeds:
        p = self._state.parameters
        if self._state.firmware.bytewise:
            along, up, down = "MPC_XY_VEL_MAX", "MPC_Z_VEL_MAX_UP", "MPC_Z_VEL_MAX_DN"
            return Speeds(p[along], p[up], p[down])
        along, up, down = "WPNAV_SPEED", "WPNAV_SPEED_UP", "WPNAV_SPEED_DN"
        return Speeds(p[along] / 100.0, p[up] / 100.0, p[down] / 100.0)
