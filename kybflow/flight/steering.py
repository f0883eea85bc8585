"""Converts a desired specific force to attitude and thrust, for trackers with any control law.

The thrust is the estimated mass times the desired specific force f along body z; the attitude
points body z along f. Tilt and thrust are limited to the airframe's. On the ground the thrust rises
from 60 % of the estimated weight until the vehicle lifts; in the air the mass is estimated
(`kybflow.flight.mass`).

The autopilot controls its own attitude estimate, which an accelerometer levels and which therefore
errs while the vehicle accelerates. The integral of the difference between the commanded and the
estimated body z trims the command against that error.
"""

from __future__ import annotations

from math import sqrt, tan

from kybflow.core.geometry import (
    GRAVITY,
    Quat,
    Vec3,
    from_thrust_direction,
    heading_of,
    wrap,
)
from kybflow.core.signals import Command, Estimate, Setpoint
from kybflow.flight.mass import MassEstimator
from kybflow.world.vehicle_context import VehicleContext

LONGEST_STEP = 0.04
"""Longest step in seconds that is integrated."""
WEIGH_EVERY = 0.015
"""Seconds between two updates of the mass estimator, which is far slower."""
MOST_TRIM = 0.1
"""Largest slope by which body z is trimmed, about 6 degrees."""
LEAST_LIFT, MOST_THRUST = 0.3, 0.95
"""Least vertical force as a share of the weight, and largest thrust as a share of the rotors'."""


class Steering:
    """Lives as long as its tracker, which calls `weigh`, `bounded`, `attitude` and `command` every
    tick.

    flies: above the ground. limited: the last force was limited. learns: integrals may be updated,
    which excludes the ground, a limited force and a long step. trim: the slope that corrects the
    autopilot's attitude error. force_along: the specific force of the last command along the
    estimated body z, m/s^2.
    """

    __slots__ = (
        "_airframe_mass", "_carried", "_floor", "_heading", "_lift", "_mass", "_most_thrust",
        "_slope", "_steepest", "_tilt", "_weighed", "_weight", "flies", "force_along", "learns",
        "limited", "trim",
    )  # fmt: skip

    def __init__(self, context: VehicleContext, mass_guess: float) -> None:
        airframe = context.airframe
        self._tilt = airframe.tilt
        self._steepest = (airframe.tilt, tan(airframe.tilt))
        self._weight, self._airframe_mass = airframe.hover_thrust, airframe.mass
        self._most_thrust = MOST_THRUST * airframe.max_thrust
        self._heading = context.heading
        self._mass = MassEstimator(airframe.hover_thrust, mass_guess)
        self._carried = airframe.mass * self._mass.carried
        self._slope: tuple[float, float] | None = None
        self._floor: float | None = None
        self._lift = 0.0
        self._weighed = WEIGH_EVERY
        self.trim = (0.0, 0.0)
        self.flies = self.limited = self.learns = False
        self.force_along = GRAVITY

    @property
    def hover_thrust(self) -> float:
        """The estimated hover thrust, N."""
        return self._weight * self._mass.ratio

    def weigh(self, setpoint: Setpoint, estimate: Estimate, lift_off: float, dt: float) -> None:
        """Estimate the mass. lift_off: height above the ground from which the vehicle flies, m."""
        height = estimate.position[2]
        if self._floor is None:
            self._floor = height
        above = self._floor + lift_off
        self.flies = flies = height > above
        self.learns = flies and not self.limited and dt < LONGEST_STEP
        if flies:
            self._weighed += dt
            if self._weighed < WEIGH_EVERY:
                return
            self._mass.update(self._lift, estimate.velocity[2], self._weighed)
            self._weighed = 0.0
        else:
            self._weighed = WEIGH_EVERY
            if _asks_up(setpoint, above):
                self._mass.spool_up(dt)
        self._carried = self._airframe_mass * self._mass.carried

    def bounded(self, wanted: Vec3, tilt: float) -> Vec3:
        """Return `wanted` limited to `tilt`, the airframe's tilt and its thrust."""
        fx, fy, fz = wanted
        self.limited = False
        most = self._most_thrust / self._carried
        if not LEAST_LIFT * GRAVITY <= fz <= most:
            fz = max(LEAST_LIFT * GRAVITY, min(most, fz))
            self.limited = True
        level = sqrt(fx * fx + fy * fy)
        if tilt != self._steepest[0]:
            self._steepest = (tilt, tan(min(tilt, self._tilt)))
        widest = fz * self._steepest[1]
        if level > widest:
            fx, fy = fx * widest / level, fy * widest / level
            self.limited = True
        return (fx, fy, fz)

    def attitude(
        self, force: Vec3, up: Vec3, setpoint: Setpoint, trim_rate: float, dt: float
    ) -> Quat:
        """Return the attitude with body z along `force`, corrected by `trim`, which it updates. up:
        the estimated body z."""
        fx, fy, fz = force
        tx, ty = self.trim
        if self._slope is not None and self.flies and dt < LONGEST_STEP:
            k, (sx, sy) = trim_rate * dt, self._slope
            x, y = tx + k * (sx - up[0]), ty + k * (sy - up[1])
            tx = MOST_TRIM if x > MOST_TRIM else -MOST_TRIM if x < -MOST_TRIM else x
            ty = MOST_TRIM if y > MOST_TRIM else -MOST_TRIM if y < -MOST_TRIM else y
            self.trim = (tx, ty)
        length = sqrt(fx * fx + fy * fy + fz * fz)
        self._slope = (fx / length, fy / length)
        heading = setpoint.heading
        if heading is None:
            heading = wrap(self._heading + setpoint.heading_rate * dt)
        self._heading = heading
        return from_thrust_direction((fx + length * tx, fy + length * ty, fz), heading)

    def command(
        self, force: Vec3, attitude: Quat, rates: Vec3, estimate: Estimate, up: Vec3
    ) -> Command:
        """Return the command of `attitude`, `rates` and the thrust of `force` along `up`."""
        mass, most = self._carried, self._most_thrust
        (fx, fy, fz), (ux, uy, uz) = force, up
        thrust = mass * (fx * ux + fy * uy + fz * uz)
        thrust = most if thrust > most else 0.0 if thrust < 0.0 else thrust
        self._lift = thrust * uz
        self.force_along = thrust / mass
        return Command(attitude, thrust, rates, heading_of(estimate.attitude))


def _asks_up(setpoint: Setpoint, above: float) -> bool:
    if setpoint.position is not None:
        return setpoint.position[2] > above
    return setpoint.velocity is None or setpoint.velocity[2] > 0.0
