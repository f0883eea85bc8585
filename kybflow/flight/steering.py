"""Converts a desired specific force to attitude and thrust, for trackers with any control law.

The thrust is the estimated mass times the component of the desired specific force f along body z;
the attitude points body z along f. Tilt and thrust are limited to the airframe's. On the ground the
thrust rises from 60 % of the estimated weight until the vehicle lifts off; in the air the mass is
estimated (`kybflow.flight.force_estimates`).

The autopilot controls its own attitude estimate, which is levelled by an accelerometer and
therefore wrong while the vehicle accelerates. The integral of the difference between the commanded
and the estimated body z trims the command against that error.
"""

from __future__ import annotations

from math import cos, sin, sqrt, tan

from kybflow.core.geometry import (
    GRAVITY,
    ZERO,
    Quat,
    Vec3,
    from_thrust_facing,
    heading_of,
    rotate_back,
    wrap,
)
from kybflow.core.signals import Command, CommandKind, Estimate, Setpoint, made
from kybflow.flight.force_estimates import MassEstimator
from kybflow.flight.steering_params import SteeringParams
from kybflow.world.vehicle_context import VehicleContext

LONGEST_STEP = 0.04
"""Longest time step that is integrated, seconds."""
WEIGH_EVERY = 0.015
"""Seconds between two updates of the mass estimator, which is far slower than the control."""
LONGEST_SPOOL = 0.1
"""Longest time between two measurements that counts for the rise of the thrust on the ground,
seconds."""
LEAST_NEWS = 0.001
"""Least time by which the newest measurement must be newer than the last one weighed, seconds."""
DOUBTED, MOST_LIFT_OFF = 3.0, 0.05
"""How many times the spread of an estimate a lift-off exceeds, and the largest such height, m."""
LEAN_TIME_S, LEAN_EVERY_S = 1.5, 0.1
"""Time over which the lean is averaged, and that between two samples of it, seconds."""
MOST_TRIM = 0.1
"""Largest trim of the slope of body z, about 6 degrees."""
LEAST_LIFT, MOST_THRUST = 0.3, 0.95
"""Least vertical force as a share of the weight, and largest thrust as a share of the rotors'."""
LEAST_FORCE = LEAST_LIFT * GRAVITY
_ATTITUDE_THRUST = CommandKind.ATTITUDE_THRUST


class Steering:
    """Turns a tracker's force into commands. Has the lifetime of its tracker, which calls
    `weigh`, `attitude` and `command` every tick.

    flies: whether the vehicle is above the ground. limited: whether the last force was limited.
    learns: whether integrals may be updated: not on the ground, while the force is limited, or
    after a long step. trim: the slope along x and y that corrects the autopilot's attitude error.
    force_along: the specific force of the last command along the estimated body z, m/s^2. lean: the
    slope along x and y that is commanded where the vehicle stands still, for wind and for attitudes
    that are wrong by a constant: the average of what the commands add to the setpoint.
    """

    __slots__ = (
        "_age", "_airframe", "_carried", "_drag", "_facing", "_floor", "_heading", "_leant",
        "_lift", "_mass", "_most_force", "_most_thrust", "_slope", "_steepest", "_tilt", "_weighed",
        "flies", "force_along", "lean", "learns", "limited", "trim",
    )  # fmt: skip

    def __init__(self, context: VehicleContext, mass_guess: float) -> None:
        self._airframe = airframe = context.airframe
        self._tilt, self._steepest = airframe.tilt, tan(airframe.tilt)
        self._most_thrust = MOST_THRUST * airframe.max_thrust
        self._heading = context.heading
        self._facing = (cos(context.heading), sin(context.heading))
        self._mass = MassEstimator(airframe.hover_thrust, mass_guess)
        self._carry()
        self._slope = (0.0, 0.0)
        self._floor: float | None = None
        self._lift = 0.0
        self._weighed = 0.0
        self._age = 0.0
        self.trim = self.lean = (0.0, 0.0)
        self._drag, self._leant = airframe.drag, 0.0
        self.flies = self.limited = self.learns = False
        self.force_along = GRAVITY

    @property
    def hover_thrust(self) -> float:
        """The estimated hover thrust, N."""
        return self._airframe.hover_thrust * self._mass.ratio

    def weigh(self, setpoint: Setpoint, estimate: Estimate, lift_off: float, dt: float) -> None:
        """Update the mass estimate. lift_off: the height above the ground from which the vehicle
        counts as flying, m; more, up to `MOST_LIFT_OFF`, if the estimate is too noisy for it."""
        height, doubt = estimate.position[2], DOUBTED * estimate.spread
        if self._floor is None:
            self._floor = height
        if doubt > lift_off:
            lift_off = max(lift_off, min(doubt, MOST_LIFT_OFF))
        above = self._floor + lift_off
        flew, flies = self.flies, height > above
        self.flies = flies
        self.learns = flies and not self.limited and dt < LONGEST_STEP
        self._weighed = weighed = self._weighed + dt
        if flew and flies and weighed < WEIGH_EVERY:
            return
        age = estimate.age
        if weighed - age + self._age < LEAST_NEWS:
            return  # without a newer measurement, the thrust has no visible effect
        self._weighed, self._age = 0.0, age
        if flies:
            self._mass.update(self._lift, estimate.velocity[2], weighed)
        else:
            position, velocity = setpoint.position, setpoint.velocity
            asks_up = velocity is None or velocity[2] > 0.0
            if asks_up if position is None else position[2] > above:
                self._mass.spool_up(min(weighed, LONGEST_SPOOL))
        self._carry()

    def _carry(self) -> None:
        """Update the mass to carry and the largest specific force from the mass estimator."""
        self._carried = self._airframe.mass * self._mass.carried
        self._most_force = self._most_thrust / self._carried

    def attitude(
        self, wanted: Vec3, up: Vec3, setpoint: Setpoint, p: SteeringParams, dt: float
    ) -> tuple[Vec3, Quat]:
        """Limit the specific force `wanted`. Return it and the attitude whose body z points along
        it, corrected by `trim`, which is updated. up: the estimated body z."""
        fx, fy, fz = wanted
        if p.tilt != self._tilt:
            self._tilt, self._steepest = p.tilt, tan(min(p.tilt, self._airframe.tilt))
        widest = fz * self._steepest
        square = fx * fx + fy * fy
        self.limited = not LEAST_FORCE <= fz <= self._most_force or square > widest * widest
        if self.limited:
            wanted = fx, fy, fz = self._bounded(wanted)
            square = fx * fx + fy * fy
        tx, ty = self.trim
        if self.flies and dt < LONGEST_STEP:
            k = p.trim * dt
            sx, sy = self._slope
            ux, uy, _ = up
            tx, ty = tx + k * (sx - ux), ty + k * (sy - uy)
            tx = MOST_TRIM if tx > MOST_TRIM else -MOST_TRIM if tx < -MOST_TRIM else tx
            ty = MOST_TRIM if ty > MOST_TRIM else -MOST_TRIM if ty < -MOST_TRIM else ty
            self.trim = (tx, ty)
            self._leant += dt
            if self._leant >= LEAN_EVERY_S:
                self._average((fx / fz + tx, fy / fz + ty), setpoint)
        length = sqrt(square + fz * fz)
        self._slope = (fx / length, fy / length)
        heading = setpoint.heading
        if heading is None:
            heading = wrap(self._heading + setpoint.heading_rate * dt)
        if heading != self._heading:
            self._heading, self._facing = heading, (cos(heading), sin(heading))
        leaned = (fx + length * tx, fy + length * ty, fz)
        return wanted, from_thrust_facing(leaned, self._facing)

    def _average(self, slope: tuple[float, float], setpoint: Setpoint) -> None:
        """Update `lean` by a commanded slope."""
        sx, sy = slope
        ax, ay, _ = setpoint.acceleration or ZERO
        vx, vy, _ = setpoint.velocity or ZERO
        x, y = self.lean
        share, drag = self._leant / (LEAN_TIME_S + self._leant), self._drag
        self._leant = 0.0
        x += share * (sx - (ax + drag * vx) / GRAVITY - x)
        y += share * (sy - (ay + drag * vy) / GRAVITY - y)
        self.lean = (x, y)

    def _bounded(self, wanted: Vec3) -> Vec3:
        """Return the force limited by the airframe's thrust, then by the tilt."""
        fx, fy, fz = wanted
        fz = max(LEAST_FORCE, min(self._most_force, fz))
        level, widest = sqrt(fx * fx + fy * fy), fz * self._steepest
        if level > widest:
            fx, fy = fx * widest / level, fy * widest / level
        return (fx, fy, fz)

    def command(
        self, force: Vec3, attitude: Quat, rates: Vec3, estimate: Estimate, up: Vec3
    ) -> Command:
        """Return the command with this attitude, these rates, and the thrust of `force` along
        `up`."""
        mass, most = self._carried, self._most_thrust
        fx, fy, fz = force
        ux, uy, uz = up
        thrust = mass * (fx * ux + fy * uy + fz * uz)
        thrust = most if thrust > most else 0.0 if thrust < 0.0 else thrust
        self._lift = thrust * uz
        self.force_along = thrust / mass
        heading = heading_of(estimate.attitude)
        return made(Command, (attitude, thrust, rates, heading, True, _ATTITUDE_THRUST, None))


def turning(force: Vec3, jerk: Vec3, heading_rate: float, attitude: Quat) -> Vec3:
    """Return the body rates, rad/s, with which the jerk and the heading rate turn the attitude
    along `force`: force x jerk / |force|^2, plus the heading rate about world z."""
    if jerk == ZERO and heading_rate == 0.0:
        return ZERO
    fx, fy, fz = force
    jx, jy, jz = jerk
    k = 1.0 / (fx * fx + fy * fy + fz * fz)
    x, y, z = k * (fy * jz - fz * jy), k * (fz * jx - fx * jz), k * (fx * jy - fy * jx)
    return rotate_back(attitude, (x, y, z + heading_rate))
