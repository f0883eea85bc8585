"""The flight controller of an emulated drone: take-off, moves, hovering, animations and landing.

A move commands a tilt, a climb rate and a heading rate. The climb rate responds with a lag of
`CLIMB_TIME_CONSTANT` plus the delay of the velocity loop; together they match the response of a
real drone (`kybflow.drivers.ardrone.CLIMB_TIME`). When the drone hovers, it brakes by its optical
flow and holds its height. The SDK gives only the axis and the duration of an animation, so the
emulated drone hovers and rocks or turns about that axis, without flipping over. To calibrate its
magnetometer it turns around once. Units are radians and metres; the body frame is FLU.
"""

from __future__ import annotations

from math import hypot, pi, sin
from typing import NamedTuple

from kybflow.core.geometry import ZERO, conjugate, from_euler, multiply, to_euler, wrap
from kybflow.core.signals import NS, Command, Time
from kybflow.drivers.ardrone.control.acts import FLIGHTS
from kybflow.drivers.ardrone.protocol.at import Move
from kybflow.drivers.ardrone.protocol.navdata.state import Phase
from kybflow.drivers.emulated_ardrone.onboard.estimator import DroneEstimator
from kybflow.drivers.emulation.body import SimulatedBody
from kybflow.drivers.emulation.control import PositionControl, PositionTarget, Speeds
from kybflow.world.vehicle_context import Airframe

HEIGHT, CLIMB_SPEED, SINK_SPEED = 0.8, 0.6, 0.4
"""Height of the take-off, m, and speeds up and down, m/s."""
REACHED = 0.1
SPOOL_UP: Time = NS // 2
CLIMB_TIME_CONSTANT = 0.5
"""Time constant of the low-pass on the climb rate, s."""
LEASH = 0.3
"""Largest difference between the height setpoint and the height, m."""
BRAKES, BRAKES_MOST = 0.25, 0.2
"""Braking: tilt per speed, rad per m/s, and the largest tilt, rad."""
STILL: Time = 3 * NS // 10
LOW, SLOW = 0.06, 0.08
"""Height, m, and climb rate, m/s, below which the drone counts as landed after `STILL`."""
TURN_LEASH = 0.5
"""Largest difference between the heading setpoint and the heading, rad."""
ROCKING, TURNS = 0.15, 1.0
"""Amplitude of the tilt, which oscillates once a second, rad; and clockwise heading rate, rad/s."""
SHORTEST: Time = NS
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
    lasts = max(SHORTEST, milliseconds * NS // 1000)
    roll, pitch = ROCKING * ("roll" in name), ROCKING * ("pitch" in name)
    return Performance(now, now + lasts, roll, pitch, -TURNS * ("turn" in name or "yaw" in name))


def calibration(now: Time) -> Performance:
    return Performance(now, now + round(2.0 * pi / TURNS * NS), 0.0, 0.0, -TURNS)


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
        held = min(self._held + self._climb * dt, max(self.highest, height - LEASH))
        self._held = max(height - LEASH, min(height + LEASH, held))
        self._learn(dt)
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
        size = max(1.0, BRAKES * hypot(forward, left) / BRAKES_MOST)
        roll, pitch = BRAKES * left / size, -BRAKES * forward / size
        if self._performs is None:
            return roll, pitch
        right, down = self._performs.tilts(now)
        return roll + right, pitch + down

    def _learn(self, dt: float) -> None:
        estimator = self._estimator
        if self.phase in (Phase.FLYING, Phase.HOVERING) and estimator.imu is not None:
            roll, pitch, _ = to_euler(estimator.attitude.value)
            upright = 1.0 - 0.5 * (roll * roll + pitch * pitch)
            self._control.learn(upright, 0.0, True, dt)

    def _update_phase(self, now: Time) -> None:
        """Detect that the drone has taken off or landed."""
        height, climb = self._estimator.height, self._estimator.climb
        if self.phase is Phase.TAKING_OFF and height > HEIGHT - REACHED:
            self._change(Phase.HOVERING, now)
        elif self.phase in (Phase.HOVERING, Phase.FLYING):
            self.phase = Phase.HOVERING if self.moves is None else Phase.FLYING
        is_down = self.phase is Phase.LANDING and height < LOW and abs(climb) < SLOW
        if not is_down:
            self._still = None
        elif self._still is None:
            self._still = now
        elif now - self._still > STILL:
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
