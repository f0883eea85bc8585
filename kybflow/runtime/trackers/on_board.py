"""The vehicle's own controllers follow the setpoint: an autopilot flies with its own tuning.

`by` selects the kind of setpoint that the on-board controller receives, in the world frame.
`position`: each setpoint unchanged, with its velocity and acceleration to feed forward. `velocity`:
a position setpoint becomes a velocity setpoint,

    v = v_des + P (p_des - p), the second part at most `correction` long,

so that the position is held by this program's estimate, and an autopilot stops when no more
setpoints arrive. `acceleration`: position and velocity setpoints become acceleration setpoints, by
the law of `cascade` with gains for a vehicle that responds later,

    a = a_des + D (v_des - v) + K (p_des - p) + I integral(p_des - p) + drag v_des,

where D is `damping`, K `stiffness`, and drag acts horizontally; a VELOCITY setpoint has no K term,
and leaves the integral as it is. The integral acts along all three axes, 1.5 times as fast along z,
because the mass is not estimated here; it is frozen on the ground, at a limit and in steps longer
than 40 ms. An autopilot that integrates accelerations to a height and holds that height
(`keeps_height`) needs no integral along z, and responds too late for a fast loop: D is then halved
and K divided by four along z. The on-board attitude lags the command and has the error of its own
filter. In the air, `tilt` times the horizontal acceleration that the estimated attitude lacks is
therefore added:

    sent = a + T (a - (g + a_z) (z_x, z_y) / z_z),   z the estimated body z axis

which makes the attitude loop (1 + T) times as fast and its error as many times smaller. A vehicle
with a fast loop shakes with T = 1. The result is limited to the airframe's tilt and thrust; if
these don't reduce it, the jerk is passed on for drivers that predict the setpoint.

Setpoints that the on-board controller can follow itself are passed on unchanged: velocity setpoints
with `velocity`, acceleration setpoints always. Heading and heading rate are sent with each.
"""

from __future__ import annotations

from math import hypot, tan
from typing import Literal

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    UP,
    ZERO,
    Quat,
    Vec3,
    add,
    heading_of,
    rotate,
    scale,
    sub,
)
from kybflow.core.signals import Command, CommandKind, Estimate, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Damping, Length, Number, Speed
from kybflow.flight.governor import shortened
from kybflow.flight.steering import LEAST_LIFT, LONGEST_STEP, MOST_THRUST
from kybflow.parts import Tracker, param, params
from kybflow.world.vehicle_context import VehicleContext

By = Literal["position", "velocity", "acceleration"]
_COMMANDS = {
    SetpointKind.POSITION: CommandKind.POSITION,
    SetpointKind.VELOCITY: CommandKind.VELOCITY,
    SetpointKind.ACCELERATION: CommandKind.ACCELERATION,
}
LEAST_UPRIGHT = 0.5
"""Cosine of the largest tilt (60 degrees) at which the tilt correction is applied."""
VERTICAL_INTEGRAL = 1.5
"""Ratio of the integral gain along z to that along x and y."""
KEPT_GAINS = (0.5, 0.25, 0.0)
"""Factors of D, K and I along z if the height is held on board. Such a loop, as Copter's with its
default gains, lags by 0.13 s at 3 rad/s and limits the jerk to 5 m/s^3; estimate and link add 0.1
s. That would leave a phase margin of 15 degrees; these factors leave 46."""
_GIVEN: dict[By, frozenset[CommandKind]] = {
    "position": frozenset(_COMMANDS.values()),
    "velocity": frozenset({CommandKind.VELOCITY, CommandKind.ACCELERATION}),
    "acceleration": frozenset({CommandKind.ACCELERATION}),
}


@params
class OnBoardParams:
    by: By = param(
        "Kind of setpoint that the on-board controller gets.", default="position", read_only=True
    )
    proportional: Damping = param(
        "Velocity per metre of position error, with `by: velocity`.", default=1.2, above=0
    )
    correction: Speed = param("Largest velocity that a position error adds.", default=0.5, above=0)
    stiffness: Number = param(
        "Acceleration per metre of position error, with `by: acceleration`.", default=4.0, above=0
    )
    damping: Number = param(
        "Acceleration per m/s of velocity error, with `by: acceleration`.", default=3.5, above=0
    )
    integral: Number = param(
        "Acceleration per metre and second of position error, with `by: acceleration`.",
        default=2.0, at_least=0,
    )  # fmt: skip
    integral_limit: Acceleration = param(
        "Limit of the integral term along each axis.", default=2.5, at_least=0
    )
    tilt: Number = param(
        "Share of the acceleration that the tilt still lacks which is requested in addition, "
        "with `by: acceleration`.",
        default=0.5, at_least=0,
    )  # fmt: skip
    keeps_height: bool = param(
        "Whether the on-board controller integrates accelerations to a height that it holds, "
        "instead of converting them to thrust.",
        default=False, read_only=True,
    )  # fmt: skip
    lift_off: Length = param(
        "Height above the ground from which the vehicle counts as flying.", default=0.05, at_least=0
    )


class OnBoard(Tracker[OnBoardParams]):
    accepts = frozenset(_COMMANDS)
    emits = CommandKind.POSITION

    def __init__(self, params: OnBoardParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._airframe = airframe = context.airframe
        self._most_climb = MOST_THRUST * airframe.max_thrust / airframe.mass - GRAVITY
        self._steepest = tan(airframe.tilt)
        self._climb = KEPT_GAINS if params.keeps_height else (1.0, 1.0, VERTICAL_INTEGRAL)
        self._integral = ZERO
        self._floor: float | None = None

    @classmethod
    def kinds(cls, params: OnBoardParams) -> frozenset[CommandKind]:
        return _GIVEN[params.by]

    @property
    def hover_thrust(self) -> float:
        return self._airframe.hover_thrust

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        estimate = tick.known()
        followed = self._followed(setpoint, estimate, tick.dt)
        heading = heading_of(estimate.attitude)
        kind = _COMMANDS[followed.kind]
        return Command(LEVEL, self.hover_thrust, ZERO, heading, kind=kind, setpoint=followed)

    def _followed(self, setpoint: Setpoint, estimate: Estimate, dt: float) -> Setpoint:
        """Return the setpoint for the on-board controller."""
        by = self.params.by
        kind, _, _, _, jerk, heading, rate, _ = setpoint
        if by == "velocity" and kind is SetpointKind.POSITION:
            p = self.params
            gap = sub(setpoint.position or estimate.position, estimate.position)
            correction = shortened(scale(gap, p.proportional), p.correction)
            velocity = add(setpoint.velocity or ZERO, correction)
            return setpoint._replace(kind=SetpointKind.VELOCITY, position=None, velocity=velocity)
        if by == "acceleration" and kind is not SetpointKind.ACCELERATION:
            acceleration, is_free = self._acceleration(setpoint, estimate, dt)
            jerk, kind = jerk if is_free else None, SetpointKind.ACCELERATION
            return Setpoint(kind, None, None, acceleration, jerk, heading, rate)
        return setpoint

    def _acceleration(self, setpoint: Setpoint, estimate: Estimate, dt: float) -> tuple[Vec3, bool]:
        """Return the acceleration (m/s^2, world), and whether the airframe's limits don't reduce
        it."""
        p, drag = self.params, self._airframe.drag
        _, goal, velocity, acceleration, *_ = setpoint
        position = px, py, pz = estimate.position
        wx, wy, wz = velocity or ZERO
        vx, vy, vz = estimate.velocity
        ax, ay, az = acceleration or ZERO
        ix, iy, iz = self._integral
        gx, gy, gz = goal or position
        ex, ey, ez, k, d = gx - px, gy - py, gz - pz, p.stiffness, p.damping
        quick, stiff, lift = self._climb
        total = (
            ax + drag * wx + d * (wx - vx) + k * ex + ix,
            ay + drag * wy + d * (wy - vy) + k * ey + iy,
            az + quick * d * (wz - vz) + stiff * k * ez + iz,
        )
        bounded = self._bounded(total)
        if self._floor is None:
            self._floor = pz
        if pz <= self._floor + p.lift_off:
            return bounded, bounded == total
        if bounded == total and dt < LONGEST_STEP:
            i, most = p.integral * dt, p.integral_limit
            ix, iy, iz = ix + i * ex, iy + i * ey, iz + lift * (i * ez)
            self._integral = (_within(ix, most), _within(iy, most), _within(iz, most))
        tilted = self._tilted(bounded, estimate.attitude)
        sent = self._bounded(tilted)
        return sent, bounded == total and sent == tilted

    def _tilted(self, wanted: Vec3, attitude: Quat) -> Vec3:
        """Return the acceleration with the correction for the estimated tilt added; unchanged if
        the vehicle is tilted by more than 60 degrees."""
        zx, zy, zz = rotate(attitude, UP)
        if zz < LEAST_UPRIGHT:
            return wanted
        x, y, z = wanted
        more, up = self.params.tilt, (GRAVITY + z) / zz
        return (x + more * (x - up * zx), y + more * (y - up * zy), z)

    def _bounded(self, acceleration: Vec3) -> Vec3:
        """Return the acceleration, limited to the airframe's thrust and tilt."""
        x, y, z = acceleration
        z = max((LEAST_LIFT - 1.0) * GRAVITY, min(self._most_climb, z))
        widest, level = (GRAVITY + z) * self._steepest, hypot(x, y)
        if level > widest:
            x, y = x * widest / level, y * widest / level
        return (x, y, z)


def _within(value: float, most: float) -> float:
    return most if value > most else -most if value < -most else value
