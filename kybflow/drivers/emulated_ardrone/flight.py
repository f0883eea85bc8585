"""How an emulated drone estimates its motion, takes off, moves, hovers, performs and lands.

The attitude comes from IMU and magnetometer (`kybflow.drivers.emulation.estimation`). Height and
speed are predicted with the accelerometer and corrected with ultrasound and optical flow, at the
rates below.

A move commands a tilt, a climb rate and a heading rate. The climb rate responds with a lag of
`CLIMB_TIME_CONSTANT` plus the delay of the velocity loop; together they match the response of a
real drone (`kybflow.drivers.ardrone.CLIMB_TIME`). When the drone hovers, it brakes by its optical
flow and holds its height. The SDK gives only the axis and the duration of an animation, so the
emulated drone hovers and rocks or turns about that axis, without flipping over. To calibrate its
magnetometer it turns around once. Units are radians and metres; the frames are ENU and FLU.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from math import hypot, pi, sin
from typing import NamedTuple

from kybflow.core.geometry import (
    GRAVITY,
    ZERO,
    Vec3,
    add,
    conjugate,
    from_euler,
    from_heading,
    heading_of,
    multiply,
    rotate,
    rotate_back,
    scale,
    to_euler,
    wrap,
)
from kybflow.core.signals import NS, Command, Imu, Time, Truth
from kybflow.drivers.ardrone.acts import FLIGHTS
from kybflow.drivers.ardrone.at import Move
from kybflow.drivers.ardrone.navdata import Phase
from kybflow.drivers.emulation.body import CompassAndBarometer, SimulatedBody
from kybflow.drivers.emulation.control import PositionControl, PositionTarget, Speeds
from kybflow.drivers.emulation.estimation import AttitudeFilter
from kybflow.world.vehicle_context import Airframe

FLOW_PERIOD_NS, FLOW_NOISE = NS // 60, 0.03
"""Period of the optical flow, and standard deviation of its speed, m/s."""
ECHO_PERIOD_NS, ECHO_NOISE = NS // 25, 0.01
"""Period of the ultrasound, and standard deviation of its height, m."""
FOLLOWS_FLOW, FOLLOWS_ECHO, CLIMB_BY_ECHO = 3.0, 6.0, 9.0
"""Correction gains: of the speed by the flow, 1/s; of the height, 1/s, and of the climb rate,
1/s^2, by the ultrasound."""


class DroneEstimator:
    """The estimated motion of one drone. height, climb: height above the start and its rate.
    velocity: horizontal, forward and left relative to its heading. imu: the latest IMU sample."""

    def __init__(self, look: Callable[[], Truth], generator: random.Random) -> None:
        self._look, self._generator = look, generator
        self.attitude = AttitudeFilter(heading_of(look().attitude))
        self._compass = CompassAndBarometer(look, generator)
        self._zero = look().position[2]
        self._flow: Time = 0
        self._echo: Time = 0
        self.height = self.climb = 0.0
        self.velocity: Vec3 = ZERO
        self.imu: Imu | None = None

    def add_imu(self, imu: Imu) -> None:
        """Predict the motion with an IMU sample."""
        self.imu = imu
        self.attitude.add_imu(imu, None)
        level = from_heading(self.attitude.heading)
        force = rotate(self.attitude.value, imu.specific_force)
        x, y, _ = rotate_back(level, force)
        spin = self.attitude.rate[2] * imu.dt
        vx, vy, _ = self.velocity
        self.velocity = (vx + x * imu.dt + spin * vy, vy + y * imu.dt - spin * vx, 0.0)
        pull = force[2] - GRAVITY
        self.height += imu.dt * (self.climb + 0.5 * imu.dt * pull)
        self.climb += imu.dt * pull

    def correct(self, now: Time) -> None:
        """Correct the estimate with every sensor that has a new measurement."""
        if self._compass.read(now):
            self.attitude.see(self._compass.heading)
        truth, noise = self._look(), self._generator.gauss
        if now >= self._flow:
            self._flow, share = now + FLOW_PERIOD_NS, FOLLOWS_FLOW * FLOW_PERIOD_NS / NS
            x, y, _ = rotate_back(from_heading(heading_of(truth.attitude)), truth.velocity)
            seen = (x + noise(0.0, FLOW_NOISE), y + noise(0.0, FLOW_NOISE), 0.0)
            self.velocity = add(scale(self.velocity, 1.0 - share), scale(seen, share))
        if now >= self._echo:
            self._echo, dt = now + ECHO_PERIOD_NS, ECHO_PERIOD_NS / NS
            off = truth.position[2] - self._zero + noise(0.0, ECHO_NOISE) - self.height
            self.height += FOLLOWS_ECHO * dt * off
            self.climb += CLIMB_BY_ECHO * dt * off

    def rest(self) -> None:
        """Reset the motion to that of a drone on the ground."""
        self.velocity, self.height, self.climb = ZERO, 0.0, 0.0


TAKEOFF_HEIGHT, CLIMB_SPEED, SINK_SPEED = 0.8, 0.6, 0.4
"""Height of the take-off, m, and speeds up and down, m/s."""
HEIGHT_TOLERANCE = 0.1
SPOOL_UP: Time = NS // 2
CLIMB_TIME_CONSTANT = 0.5
"""Time constant of the low-pass on the climb rate, s."""
HEIGHT_LEASH = 0.3
"""Largest difference between the height setpoint and the height, m."""
BRAKE_GAIN, BRAKE_TILT = 0.25, 0.2
"""Braking: tilt per speed, rad per m/s, and the largest tilt, rad."""
LANDED_AFTER_NS: Time = 3 * NS // 10
LANDED_HEIGHT, LANDED_RATE = 0.06, 0.08
"""Height, m, and climb rate, m/s, below which the drone counts as landed after
`LANDED_AFTER_NS`."""
TURN_LEASH = 0.5
"""Largest difference between the heading setpoint and the heading, rad."""
ROCK_TILT, SPIN = 0.15, 1.0
"""Amplitude of the tilt, which oscillates once a second, rad; and clockwise heading rate, rad/s."""
MIN_ANIMATION_NS: Time = NS
"""Shortest duration of an animation; the SDK's duration of a flip is not its real duration."""


class Performance(NamedTuple):
    """The motion of an animation. roll, pitch: amplitudes, rad. turn: heading rate, rad/s."""

    begins: Time
    ends: Time
    roll: float
    pitch: float
    turn: float

    def tilts(self, now: Time) -> tuple[float, float]:
        phase = sin(2.0 * pi * (now - self.begins) / NS)
        return self.roll * phase, self.pitch * phase


def animation(value: str, now: Time) -> Performance:
    """Return the animation that a value of `control:flight_anim` requests: its number and its
    duration in milliseconds. Raises ValueError."""
    number, milliseconds = map(int, value.split(","))
    if not 0 <= number < len(FLIGHTS):
        raise ValueError("no animation has this number")
    name = [*FLIGHTS][number]
    lasts = max(MIN_ANIMATION_NS, milliseconds * NS // 1000)
    roll, pitch = ROCK_TILT * ("roll" in name), ROCK_TILT * ("pitch" in name)
    return Performance(now, now + lasts, roll, pitch, -SPIN * ("turn" in name or "yaw" in name))


def calibration(now: Time) -> Performance:
    return Performance(now, now + round(2.0 * pi / SPIN * NS), 0.0, 0.0, -SPIN)


class DroneFlight:
    """Flies one drone. phase: the flight phase. moves: the move to follow; None to hover."""

    def __init__(self, airframe: Airframe, estimator: DroneEstimator, body: SimulatedBody) -> None:
        self.phase = Phase.LANDED
        self.moves: Move | None = None
        self.tilt_most = self.climb_most = self.turn_most = self.highest = 1.0
        self._estimator, self._body = estimator, body
        self._control = PositionControl(airframe, 0.0)
        self._held = self._climb = self._heading = 0.0
        self._since: Time = 0
        self._still: Time | None = None
        self._performs: Performance | None = None

    @property
    def flies(self) -> bool:
        return self.phase is not Phase.LANDED

    def take_off(self, now: Time) -> None:
        self._estimator.rest()
        self._heading = self._estimator.attitude.heading
        self._control.begin(self._heading)
        self._held = self._climb = 0.0
        self.moves = None
        self._change(Phase.TAKING_OFF, now)

    def land(self, now: Time) -> None:
        if self.phase not in (Phase.LANDED, Phase.LANDING):
            self.moves = None
            self._change(Phase.LANDING, now)

    def stop(self, now: Time) -> None:
        """Stop the rotors, even in the air."""
        self._change(Phase.LANDED, now)

    def perform(self, performance: Performance, now: Time) -> None:
        """Perform an animation or calibration instead of moves, if the drone is in the air."""
        if self.phase in (Phase.HOVERING, Phase.FLYING):
            self.moves, self._performs = None, performance
            self._change(Phase.LOOPING, now)

    def step(self, now: Time, dt: float) -> Command:
        """Return the command of a step of `dt` seconds."""
        if self._performs is not None and now >= self._performs.ends:
            self._change(Phase.HOVERING, now)
        climb = self._wanted_climb(now)
        self._climb += (climb - self._climb) * min(1.0, dt / CLIMB_TIME_CONSTANT)
        height = self._estimator.height
        held = min(self._held + self._climb * dt, max(self.highest, height - HEIGHT_LEASH))
        self._held = max(height - HEIGHT_LEASH, min(height + HEIGHT_LEASH, held))
        if self.phase in (Phase.FLYING, Phase.HOVERING) and self._estimator.imu is not None:
            roll, pitch, _ = to_euler(self._estimator.attitude.value)
            upright = 1.0 - 0.5 * (roll * roll + pitch * pitch)
            self._control.learn(upright, 0.0, True, dt)
        self._update_phase(now)
        return self._command(now, dt)

    def _wanted_climb(self, now: Time) -> float:
        if self.phase is Phase.TAKING_OFF:
            spooled = now - self._since > SPOOL_UP
            return CLIMB_SPEED if spooled else 0.0
        if self.phase is Phase.LANDING:
            return -SINK_SPEED
        return 0.0 if self.moves is None else self.climb_most * self.moves.up

    def _command(self, now: Time, dt: float) -> Command:
        """Return the command for attitude and thrust. The attitude is relative to the attitude
        loop's own estimate."""
        attitude, turn = self._estimator.attitude, 0.0
        if self._performs is not None:
            turn = self._performs.turn
        elif self.moves is not None:
            turn = -self.turn_most * self.moves.clockwise
        off = wrap(self._heading + turn * dt - attitude.heading)
        self._heading = attitude.heading + max(-TURN_LEASH, min(TURN_LEASH, off))
        roll, pitch = self._tilts(now)
        wanted = from_euler(roll, pitch, self._heading)
        place = (0.0, 0.0, self._estimator.height)
        target = PositionTarget((None, None, self._held), (None, None, self._climb))
        speeds = Speeds(1.0, 2.0, 2.0)
        motion = (0.0, 0.0, self._estimator.climb)
        self._control.follow(target, place, motion, attitude.heading, speeds, dt)
        thrust = self._control.thrust
        level = max(0.7, 1.0 - 0.5 * (roll * roll + pitch * pitch))
        believed = multiply(self._body.attitude(), multiply(conjugate(attitude.value), wanted))
        return Command(believed, thrust / level, (0.0, 0.0, turn), attitude.heading)

    def _tilts(self, now: Time) -> tuple[float, float]:
        """Return the commanded roll and pitch, rad."""
        if self.moves is not None:
            return self.tilt_most * self.moves.right, -self.tilt_most * self.moves.backward
        forward, left, _ = self._estimator.velocity
        size = max(1.0, BRAKE_GAIN * hypot(forward, left) / BRAKE_TILT)
        roll, pitch = BRAKE_GAIN * left / size, -BRAKE_GAIN * forward / size
        if self._performs is None:
            return roll, pitch
        right, down = self._performs.tilts(now)
        return roll + right, pitch + down

    def _update_phase(self, now: Time) -> None:
        """Detect that the drone has taken off or landed."""
        height, climb = self._estimator.height, self._estimator.climb
        if self.phase is Phase.TAKING_OFF and height > TAKEOFF_HEIGHT - HEIGHT_TOLERANCE:
            self._change(Phase.HOVERING, now)
        elif self.phase in (Phase.HOVERING, Phase.FLYING):
            self.phase = Phase.HOVERING if self.moves is None else Phase.FLYING
        is_down = (
            self.phase is Phase.LANDING and height < LANDED_HEIGHT and abs(climb) < LANDED_RATE
        )
        if not is_down:
            self._still = None
        elif self._still is None:
            self._still = now
        elif now - self._still > LANDED_AFTER_NS:
            self._change(Phase.LANDED, now)

    def _change(self, phase: Phase, now: Time) -> None:
        self.phase, self._since, self._still = phase, now, None
        self._performs = self._performs if phase is Phase.LOOPING else None
        self._held = self._estimator.height


LEVEL_ENOUGH = 1.0
"""The tilt, rad, beyond which the drone stops its rotors."""


def tilt_of_drone(estimator: DroneEstimator) -> float:
    roll, pitch, _ = to_euler(estimator.attitude.value)
    return hypot(roll, pitch)


REST = Command((1.0, 0.0, 0.0, 0.0), 0.0, ZERO, None, armed=False)
