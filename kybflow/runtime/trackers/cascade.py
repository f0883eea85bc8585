"""Position control: setpoint and estimate to attitude and thrust, for an on-board attitude loop.

The law of TeleKyb's standard tracker, per axis, with its gains:
a = a_des + D (v_des - v) + P (p_des - p) + I integral(p_des - p) + drag v_des, where the last two
are horizontal: drag v_des gives back what the rotors' drag takes, and vertically the estimated mass
does what an integral would, without winding up against it. A VELOCITY setpoint has no P term, an
ACCELERATION setpoint only its own; the integral is kept meanwhile, because it stands for a
disturbance that does not end with the kind.

The attitude that flies is the on-board one, which an accelerometer levels and which therefore errs
while the vehicle accelerates. The difference between the body z that was asked for and the one that
is estimated, integrated, turns the command against that error.

Thrust is the believed mass times the wanted specific force a + g along the body's z axis; attitude
points body z along it. The jerk turns it at the rate z x jerk / |a + g|, fed forward as body rates
(Mellinger and Kumar, ICRA 2011, eq. 11). Tilt and thrust are limited to the airframe's; while they
are, on the ground, and in steps longer than 40 ms, the integral stands still. On the ground the
thrust is raised from 60 % of what the believed mass asks for until the vehicle lifts; in the air
the mass is estimated.
"""

from __future__ import annotations

from math import sqrt, tan

from kybflow.geometry import (
    GRAVITY,
    ZERO,
    Quat,
    Vec3,
    body_z,
    from_thrust_direction,
    heading_of,
    rotate,
    wrap,
)
from kybflow.parts import Tracker, param, params
from kybflow.runtime.mass import MassEstimator
from kybflow.signals import Command, CommandKind, Estimate, Setpoint, SetpointKind, Tick
from kybflow.site import Site
from kybflow.units import Acceleration, Angle, Damping, Length, Number, Ratio

LONGEST_STEP = 0.04
WEIGH_EVERY = 0.015
"""Seconds between two updates of the mass, whose filter is far slower."""
MOST_TRIM = 0.1
"""About 6 degrees, as the slope that body z may be turned by."""
LEAST_LIFT, MOST_THRUST = 0.3, 0.95
"""Vertical force at least this part of the weight; thrust at most this part of all the rotors'."""


@params
class CascadeParams:
    proportional: Number = param("Acceleration per metre of position error.", default=9.0, above=0)
    derivative: Number = param("Acceleration per m/s of velocity error.", default=7.5, above=0)
    integral: Number = param(
        "Acceleration per metre and second of position error.", default=4.5, at_least=0
    )
    integral_limit: Acceleration = param(
        "The most that the integral may ask for, along each axis.", default=1.0, at_least=0
    )
    tilt: Angle = param(
        "Largest tilt; the airframe's own bound holds as well.", default=0.349, above=0, below=1.3
    )
    mass_guess: Ratio = param(
        "The mass believed at the start over the airframe's.",
        default=0.8, at_least=0.5, at_most=2.0, read_only=True,
    )  # fmt: skip
    trim: Damping = param(
        "How fast the on-board attitude's error is learnt from the estimate's attitude.",
        default=2.0, at_least=0.0, at_most=4.0,
    )  # fmt: skip
    lift_off: Length = param(
        "Height above the ground from which it flies.", default=0.02, at_least=0
    )


class Cascade(Tracker[CascadeParams]):
    """See the module."""

    accepts = frozenset({SetpointKind.POSITION, SetpointKind.VELOCITY, SetpointKind.ACCELERATION})
    gives = CommandKind.ATTITUDE_THRUST

    def __init__(self, params: CascadeParams, site: Site) -> None:
        super().__init__(params, site)
        airframe = site.airframe
        self._drag, self._tilt = airframe.drag, airframe.tilt
        self._weight, self._airframe_mass = airframe.hover_thrust, airframe.mass
        self._most_thrust = MOST_THRUST * airframe.max_thrust
        self._heading = site.heading
        self._mass = MassEstimator(airframe.hover_thrust, params.mass_guess)
        self._integral = (0.0, 0.0)
        self._trim = (0.0, 0.0)
        self._slope: tuple[float, float] | None = None
        self._flies = self._limited = False
        self._floor: float | None = None
        self._lift = 0.0
        self._weighed = WEIGH_EVERY

    @property
    def hover_thrust(self) -> float:
        return self._weight * self._mass.ratio

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        estimate, dt = tick.known(), tick.dt
        self._weigh(setpoint, estimate, dt)
        mass = self._airframe_mass * self._mass.carried
        fx, fy, fz = self._bounded(self._wanted(setpoint, estimate, dt), self._most_thrust / mass)
        ux, uy, uz = up = body_z(estimate.attitude)
        tx, ty = self._trimmed(up, dt)
        length = sqrt(fx * fx + fy * fy + fz * fz)
        self._slope = (fx / length, fy / length)
        if setpoint.heading is not None:
            self._heading = setpoint.heading
        else:
            self._heading = wrap(self._heading + setpoint.heading_rate * dt)
        attitude = from_thrust_direction((fx + length * tx, fy + length * ty, fz), self._heading)
        thrust = mass * (fx * ux + fy * uy + fz * uz)
        most = self._most_thrust
        thrust = most if thrust > most else 0.0 if thrust < 0.0 else thrust
        self._lift = thrust * uz
        rates = _rates(setpoint, (fx, fy, fz), attitude)
        return Command(attitude, thrust, rates, heading_of(estimate.attitude))

    def _weigh(self, setpoint: Setpoint, estimate: Estimate, dt: float) -> None:
        height = estimate.position[2]
        if self._floor is None:
            self._floor = height
        above = self._floor + self.params.lift_off
        self._flies = height > above
        if self._flies:
            self._weighed += dt
            if self._weighed >= WEIGH_EVERY:
                self._mass.update(self._lift, estimate.velocity[2], self._weighed)
                self._weighed = 0.0
            return
        self._weighed = WEIGH_EVERY
        if _asks_up(setpoint, above):
            self._mass.spool_up(dt)

    def _wanted(self, setpoint: Setpoint, estimate: Estimate, dt: float) -> Vec3:
        """The specific force that the law asks for, world."""
        p = self.params
        ax, ay, az = setpoint.acceleration or ZERO
        ix, iy = self._integral
        az += GRAVITY
        if setpoint.velocity is not None:
            wx, wy, wz = setpoint.velocity
            vx, vy, vz = estimate.velocity
            d, drag = p.derivative, self._drag
            ax += d * (wx - vx) + drag * wx
            ay += d * (wy - vy) + drag * wy
            az += d * (wz - vz)
        if setpoint.position is not None:
            wx, wy, wz = setpoint.position
            px, py, pz = estimate.position
            k, ex, ey = p.proportional, wx - px, wy - py
            ax += k * ex
            ay += k * ey
            az += k * (wz - pz)
            if self._flies and not self._limited and dt < LONGEST_STEP:
                i, most = p.integral * dt, p.integral_limit
                ix, iy = ix + i * ex, iy + i * ey
                ix = most if ix > most else -most if ix < -most else ix
                iy = most if iy > most else -most if iy < -most else iy
                self._integral = (ix, iy)
        return (ax + ix, ay + iy, az)

    def _bounded(self, wanted: Vec3, most: float) -> Vec3:
        """The specific force within the tilt and the thrust, of which there is at most `most`."""
        fx, fy, fz = wanted
        self._limited = False
        if not LEAST_LIFT * GRAVITY <= fz <= most:
            fz = max(LEAST_LIFT * GRAVITY, min(most, fz))
            self._limited = True
        level = sqrt(fx * fx + fy * fy)
        widest = fz * tan(min(self.params.tilt, self._tilt))
        if level > widest:
            fx, fy = fx * widest / level, fy * widest / level
            self._limited = True
        return (fx, fy, fz)

    def _trimmed(self, up: Vec3, dt: float) -> tuple[float, float]:
        """By how much to turn the command's slope against the on-board attitude's error."""
        if self._slope is not None and self._flies and dt < LONGEST_STEP:
            k, (tx, ty), (sx, sy) = self.params.trim * dt, self._trim, self._slope
            x, y = tx + k * (sx - up[0]), ty + k * (sy - up[1])
            x = MOST_TRIM if x > MOST_TRIM else -MOST_TRIM if x < -MOST_TRIM else x
            y = MOST_TRIM if y > MOST_TRIM else -MOST_TRIM if y < -MOST_TRIM else y
            self._trim = (x, y)
        return self._trim


def _rates(setpoint: Setpoint, force: Vec3, attitude: Quat) -> Vec3:
    """Body rates at which the jerk and the heading rate turn the attitude."""
    turn = setpoint.heading_rate
    if setpoint.jerk is None:
        return (0.0, 0.0, turn)
    fx, fy, fz = force
    jx, jy, jz = setpoint.jerk
    k = 1.0 / (fx * fx + fy * fy + fz * fz)
    world = (k * (fy * jz - fz * jy), k * (fz * jx - fx * jz), k * (fx * jy - fy * jx) + turn)
    w, x, y, z = attitude
    return rotate((w, -x, -y, -z), world)


def _asks_up(setpoint: Setpoint, above: float) -> bool:
    if setpoint.position is not None:
        return setpoint.position[2] > above
    return setpoint.velocity is None or setpoint.velocity[2] > 0.0
