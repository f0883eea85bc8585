"""The position controller of an emulated computer: it converts a target to attitude and thrust.

Per axis: v = P (target - position) + target velocity; a = PV (v - velocity) + integral + target
acceleration; the thrust is along a + g. What the target leaves out is not controlled. While tilt or
thrust is limited, no integral grows. ENU, SI.

The thrust is T0 |a + g| / g, where T0 is the hover thrust. T0 is learnt in the air, because the
rotors' thrust depends on the battery's voltage: it is the mean of T z / (1 + a / g), where z is the
fraction of the thrust T that points up and a the measured vertical acceleration. The mean is over
the time since take-off at first, and over about 10 s later (PX4's hover thrust estimator, a Kalman
filter of one state, has this gain for its initial variance and process noise; 10 s is ArduPilot's
for MOT_THST_HOVER). After a sudden change, as with a load or a weak rotor, T0 is learnt again from
the start, as in PX4 when innovations have left its gate on one side for a quarter of a second. The
floor's support in a landing is not mistaken for a lighter vehicle.
"""

from __future__ import annotations

from math import hypot, tan
from typing import NamedTuple

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    Quat,
    Vec3,
    from_thrust_direction,
    norm,
    wrap,
)
from kybflow.core.signals import Command
from kybflow.core.units import DEG
from kybflow.world.vehicle_context import Airframe

Axes = tuple[float | None, float | None, float | None]
FREE: Axes = (None, None, None)
POSITION_GAINS = (1.2, 1.2, 1.5)
"""Gains from position error to velocity, 1/s."""
VELOCITY_GAINS = (3.5, 3.5, 5.0)
"""Gains from velocity error to acceleration, 1/s."""
INTEGRAL_GAINS = (1.0, 1.0, 2.5)
"""Gains of the integral of the velocity error, 1/s^2."""
MOST_INTEGRAL = (2.0, 2.0, 4.0)
"""Bounds of the integrals, m/s^2."""
MAX_TILT = 35.0 * DEG
MAX_TURN = 90.0 * DEG
"""The largest rate of the commanded heading, rad/s."""
INITIAL_LEARNING_S, LEARNING_S = 0.5, 10.0
"""Seconds over which the hover thrust is averaged: at first, when they act as the weight of the
initial value, and at most."""
STEADY_SPEED = 2.0
"""The vertical speed up to which the hover thrust is learnt, m/s, as in PX4."""
SUDDEN_CHANGE, DETECTION_S = 0.15, 0.25
"""A sudden change of the hover thrust as a fraction of the weight, and the seconds over which it is
detected."""
LEAST_HOVER, MOST_HOVER = 0.5, 2.0
"""Bounds of the learnt hover thrust, as fractions of the weight."""
MIN_THRUST = 0.15
"""The least thrust in the air, as a fraction of the weight: a quadrotor needs some to keep its
attitude."""


class PositionTarget(NamedTuple):
    """A target in the vehicle's own local ENU frame; None leaves an axis uncontrolled."""

    position: Axes = FREE
    velocity: Axes = FREE
    acceleration: Axes = FREE
    heading: float | None = None
    heading_rate: float | None = None


class Speeds(NamedTuple):
    """The largest speeds at which a position error may be corrected, m/s: horizontally, up, down.
    approach: the gain from the error to the velocity for targets that are only positions, 1/s; None
    if it is that of all targets."""

    along: float
    up: float
    down: float
    approach: float | None = None


class PositionControl:
    """The controller of one vehicle. `thrust`: the last commanded thrust, newtons. `hover`: the
    learnt hover thrust, newtons, which is kept from flight to flight."""

    def __init__(self, airframe: Airframe, heading: float) -> None:
        self._airframe = airframe
        self._integral = [0.0, 0.0, 0.0]
        self._heading = heading
        self.thrust, self.hover = 0.0, airframe.hover_thrust
        self._averaged, self._surprise = INITIAL_LEARNING_S, 0.0
        self._saturates = False

    def begin(self, heading: float) -> None:
        """Reset the integrals and the heading."""
        self._integral, self._heading = [0.0, 0.0, 0.0], heading

    def ground(self, heading: float) -> Command:
        """Return the command that idles the rotors on the ground."""
        self.begin(heading)
        self.thrust = 0.1 * self._airframe.hover_thrust
        return Command(LEVEL, self.thrust, ZERO, None)

    def follow(
        self,
        target: PositionTarget,
        position: Vec3,
        velocity: Vec3,
        heading: float,
        speeds: Speeds,
        dt: float,
    ) -> Command:
        """Return the command of one step of `dt` seconds towards `target`. heading: the vehicle's
        heading, radians. speeds: bounds of the position correction."""
        wanted = self._velocity(target, position, speeds)
        ax, ay, az = self._acceleration(target, wanted, velocity, dt)
        up = max(MIN_THRUST * GRAVITY, az + GRAVITY)
        most = up * tan(MAX_TILT)
        along = hypot(ax, ay)
        if along > most:
            ax, ay = ax * most / along, ay * most / along
        turn = self._turn(target, dt)
        force = (ax, ay, up)
        attitude = from_thrust_direction(force, self._heading)
        asked = self.hover * norm(force) / GRAVITY
        self.thrust = self._bounded(asked)
        self._saturates = along > most or self.thrust != asked or up != az + GRAVITY
        return Command(attitude, self.thrust, (0.0, 0.0, turn), heading)

    def hold(self, attitude: Quat, thrust: float, rates: Vec3, heading: float) -> Command:
        """Return the command for a given attitude. thrust: newtons."""
        self._integral = [0.0, 0.0, 0.0]
        self.thrust = self._bounded(thrust)
        return Command(attitude, self.thrust, rates, heading)

    def learn(self, upright: float, acceleration: float, clear: bool, dt: float) -> None:
        """Learn the hover thrust from `dt` seconds in the air.

        upright: the fraction of the thrust that points up.
        acceleration: upward, m/s^2.
        clear: whether nothing can support the vehicle from below."""
        weight = self._airframe.hover_thrust
        lift = self.thrust * upright / max(MIN_THRUST, 1.0 + acceleration / GRAVITY)
        lacks = lift - self.hover
        surprise = lacks if clear else max(0.0, lacks)
        self._surprise += (surprise - self._surprise) * dt / DETECTION_S
        is_sudden = abs(self._surprise) > SUDDEN_CHANGE * weight
        self._averaged = INITIAL_LEARNING_S if is_sudden else min(LEARNING_S, self._averaged + dt)
        learnt = self.hover + lacks * dt / self._averaged
        self.hover = max(LEAST_HOVER * weight, min(MOST_HOVER * weight, learnt))

    def _bounded(self, thrust: float) -> float:
        return max(0.0, min(self._airframe.max_thrust, thrust))

    def _velocity(self, target: PositionTarget, position: Vec3, speeds: Speeds) -> Axes:
        asked: list[float | None] = [None, None, None]
        gains = POSITION_GAINS
        if speeds.approach is not None and target.velocity == FREE:
            gains = (speeds.approach,) * 3
        for axis, (to, at, gain) in enumerate(zip(target.position, position, gains, strict=True)):
            if to is not None:
                asked[axis] = gain * (to - at)
        x, y, z = asked
        if x is not None and y is not None and (speed := hypot(x, y)) > speeds.along:
            x, y = x * speeds.along / speed, y * speeds.along / speed
        if z is not None:
            z = max(-speeds.down, min(speeds.up, z))
        fx, fy, fz = target.velocity
        return (_sum(x, fx), _sum(y, fy), _sum(z, fz))

    def _acceleration(
        self, target: PositionTarget, wanted: Axes, velocity: Vec3, dt: float
    ) -> Vec3:
        out = [0.0, 0.0, 0.0]
        for axis, (to, at, fed) in enumerate(
            zip(wanted, velocity, target.acceleration, strict=True)
        ):
            out[axis] = 0.0 if fed is None else fed
            if to is not None:
                most = MOST_INTEGRAL[axis]
                grown = self._integral[axis] + INTEGRAL_GAINS[axis] * (to - at) * dt
                if not self._saturates or abs(grown) < abs(self._integral[axis]):
                    self._integral[axis] = max(-most, min(most, grown))
                out[axis] += VELOCITY_GAINS[axis] * (to - at) + self._integral[axis]
        return (out[0], out[1], out[2])

    def _turn(self, target: PositionTarget, dt: float) -> float:
        """Turn the commanded heading towards the target's. Return the heading rate to feed forward,
        rad/s."""
        rate = target.heading_rate or 0.0
        if target.heading is None:
            self._heading = wrap(self._heading + rate * dt)
            return rate
        left = wrap(target.heading - self._heading)
        self._heading = wrap(self._heading + max(-MAX_TURN * dt, min(MAX_TURN * dt, left)))
        return rate


def _sum(a: float | None, b: float | None) -> float | None:
    if a is None:
        return b
    return a if b is None else a + b
