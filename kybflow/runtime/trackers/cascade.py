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
thrust is raised from half of what the believed mass asks for until the vehicle lifts; in the air
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
    conjugate,
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
        self._airframe = site.airframe
        self._heading = site.heading
        self._mass = MassEstimator(site.airframe.hover_thrust, params.mass_guess)
        self._integral = (0.0, 0.0)
        self._trim = (0.0, 0.0)
        self._slope: tuple[float, float] | None = None
        self._flies = False
        self._floor: float | None = None
        self._lift = 0.0

    @property
    def hover_thrust(self) -> float:
        return self._airframe.hover_thrust * self._mass.ratio

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        estimate = tick.known()
        self._weigh(setpoint, estimate, tick.dt)
        wanted = self._acceleration(setpoint, estimate)
        fx, fy, fz, free = self._limited(wanted)
        if setpoint.position is not None and free and tick.dt < LONGEST_STEP:
            self._integrate(setpoint.position, estimate.position, tick.dt)
        self._face(setpoint, tick.dt)
        ux, uy, uz = body_z(estimate.attitude)
        self._trim_tilt(ux, uy, tick.dt)
        length = sqrt(fx * fx + fy * fy + fz * fz)
        self._slope = (fx / length, fy / length)
        tx, ty = self._trim
        attitude = from_thrust_direction((fx + length * tx, fy + length * ty, fz), self._heading)
        mass = self._airframe.mass * self._mass.carried
        thrust = mass * (fx * ux + fy * uy + fz * uz)
        most = MOST_THRUST * self._airframe.max_thrust
        thrust = most if thrust > most else 0.0 if thrust < 0.0 else thrust
        self._lift = thrust * uz
        rates = self._rates(setpoint, (fx, fy, fz), attitude)
        return Command(attitude, thrust, rates, heading_of(estimate.attitude))

    def _weigh(self, setpoint: Setpoint, estimate: Estimate, dt: float) -> None:
        height = estimate.position[2]
        if self._floor is None:
            self._floor = height
        above = self._floor + self.params.lift_off
        self._flies = height > above
        if self._flies:
            self._mass.update(self._lift, estimate.velocity[2], dt)
        elif _asks_up(setpoint, above):
            self._mass.spool_up(dt)

    def _acceleration(self, setpoint: Setpoint, estimate: Estimate) -> Vec3:
        p = self.params
        ax, ay, az = setpoint.acceleration or ZERO
        ax += self._integral[0]
        ay += self._integral[1]
        if setpoint.velocity is not None:
            (wx, wy, wz), (vx, vy, vz) = setpoint.velocity, estimate.velocity
            d, drag = p.derivative, self._airframe.drag
            ax += d * (wx - vx) + drag * wx
            ay += d * (wy - vy) + drag * wy
            az += d * (wz - vz)
        if setpoint.position is not None:
            (wx, wy, wz), (px, py, pz) = setpoint.position, estimate.position
            k = p.proportional
            ax += k * (wx - px)
            ay += k * (wy - py)
            az += k * (wz - pz)
        return (ax, ay, az)

    def _limited(self, wanted: Vec3) -> tuple[float, float, float, bool]:
        """The specific force, within the tilt and the thrust, and whether it was within them."""
        fx, fy, fz = wanted[0], wanted[1], wanted[2] + GRAVITY
        most = MOST_THRUST * self._airframe.max_thrust / (self._airframe.mass * self._mass.carried)
        low = LEAST_LIFT * GRAVITY
        free = self._flies and low <= fz <= most
        fz = low if fz < low else most if fz > most else fz
        level = sqrt(fx * fx + fy * fy)
        widest = fz * tan(min(self.params.tilt, self._airframe.tilt))
        if level > widest:
            fx, fy, free = fx * widest / level, fy * widest / level, False
        return fx, fy, fz, free

    def _integrate(self, wanted: Vec3, position: Vec3, dt: float) -> None:
        limit, k = self.params.integral_limit, self.params.integral * dt
        x = self._integral[0] + k * (wanted[0] - position[0])
        y = self._integral[1] + k * (wanted[1] - position[1])
        self._integral = (min(limit, max(-limit, x)), min(limit, max(-limit, y)))

    def _trim_tilt(self, ux: float, uy: float, dt: float) -> None:
        """Turn the command against the difference of the on-board attitude from the estimate's."""
        if self._slope is None or not self._flies or dt >= LONGEST_STEP:
            return
        k = self.params.trim * dt
        tx, ty = self._trim
        tx += k * (self._slope[0] - ux)
        ty += k * (self._slope[1] - uy)
        self._trim = (min(MOST_TRIM, max(-MOST_TRIM, tx)), min(MOST_TRIM, max(-MOST_TRIM, ty)))

    def _face(self, setpoint: Setpoint, dt: float) -> None:
        if setpoint.heading is not None:
            self._heading = setpoint.heading
        else:
            self._heading = wrap(self._heading + setpoint.heading_rate * dt)

    def _rates(self, setpoint: Setpoint, force: Vec3, attitude: Quat) -> Vec3:
        turn = setpoint.heading_rate
        if setpoint.jerk is None:
            return (0.0, 0.0, turn)
        fx, fy, fz = force
        jx, jy, jz = setpoint.jerk
        scale = 1.0 / (fx * fx + fy * fy + fz * fz)
        world = (
            scale * (fy * jz - fz * jy), scale * (fz * jx - fx * jz),
            scale * (fx * jy - fy * jx) + turn,
        )  # fmt: skip
        return rotate(conjugate(attitude), world)


def _asks_up(setpoint: Setpoint, above: float) -> bool:
    if setpoint.position is not None:
        return setpoint.position[2] > above
    return setpoint.velocity is None or setpoint.velocity[2] > 0.0
