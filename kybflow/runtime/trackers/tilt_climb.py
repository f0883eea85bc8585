"""Position control by tilt, climb rate and heading rate, for a vehicle that keeps its own height.

The commanded horizontal acceleration, with e = p_des - p, world frame, is

    a = a_des + t j_des + D e' + P e + I integral(e) + drag v_des

and the tilt is that of the direction (a, g). The jerk leads by t, the delay of the loop on board
and of the way there. P, D and I follow from that loop where they are not given, as those of
`geometric` do (`kybflow.flight.loops.position_loop`); the integral is frozen on the ground, at its
limit and while the tilt is limited. Vertically and about the vertical

    climb = v_des + T a_des + `height` e,    turn = heading rate + `heading` (heading_des - heading)

where T is the time constant with which the vehicle follows climb rates. If a setpoint has no
heading, turn is its heading rate. A VELOCITY setpoint has no P, I and `height` terms.
"""

from __future__ import annotations

from math import hypot, tan

from kybflow.core.geometry import GRAVITY, ZERO, from_thrust_direction, heading_of, wrap
from kybflow.core.signals import Command, CommandKind, Estimate, Setpoint, SetpointKind, Tick
from kybflow.core.units import DEG, Acceleration, Angle, AngularRate, Damping, Length
from kybflow.flight.loops.position_loop import FASTEST, DesignedGains, OuterLoop, completed
from kybflow.parts import Tracker, param, params
from kybflow.world.vehicle_context import Airframe, InnerLoop, VehicleContext

LONGEST_STEP = 0.04
"""Longest step in seconds that is integrated."""


@params
class TiltClimbParams(DesignedGains):
    integral_limit: Acceleration = param(
        "Limit of the integral term along each axis.", default=1.0, at_least=0
    )
    height: Damping = param("Climb rate per metre of height error.", default=1.0, above=0)
    heading: Damping = param("Heading rate per radian of heading error.", default=1.5, above=0)
    turn_rate: AngularRate = param("Largest heading rate.", default=60.0 * DEG, above=0)
    tilt: Angle | None = param(
        "Largest tilt; at most, and by default, that of the airframe.",
        default=None, above=0, below=1.3,
    )  # fmt: skip
    lift_off: Length = param(
        "Height above the ground from which the vehicle counts as flying.", default=0.05, at_least=0
    )


class TiltClimb(Tracker[TiltClimbParams]):
    accepts = frozenset({SetpointKind.POSITION, SetpointKind.VELOCITY})
    emits = CommandKind.TILT_CLIMB

    def __init__(self, params: TiltClimbParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._airframe, self._inner, self._period = context.airframe, context.loop, context.dt
        self._tune(params)
        self._climb_time = 0.0 if self._inner is None else self._inner.climb_time
        self._lead = 0.0 if self._inner is None else delay(self._inner)
        self._integral = (0.0, 0.0)
        self._limited = False
        self._floor: float | None = None

    @classmethod
    def outer_loop(
        cls, params: TiltClimbParams, airframe: Airframe, inner: InnerLoop | None, period: float
    ) -> OuterLoop:
        law = OuterLoop(
            *FASTEST, trim=0.0, drag=airframe.drag, period=period, turning=0.0, climb=params.height
        )
        return completed(law, params, inner)

    @property
    def hover_thrust(self) -> float:
        return self._airframe.hover_thrust

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        estimate, p = tick.known(), self.params
        if p is not self._tuned:
            self._tune(p)
        heading = heading_of(estimate.attitude)
        ax, ay = self._level(setpoint, estimate, tick.dt)
        attitude = from_thrust_direction((ax, ay, GRAVITY), heading)
        turn = setpoint.heading_rate
        if setpoint.heading is not None:
            turn += p.heading * wrap(setpoint.heading - heading)
        turn = max(-p.turn_rate, min(p.turn_rate, turn))
        sent = Setpoint(SetpointKind.VELOCITY, velocity=(0.0, 0.0, self._climb(setpoint, estimate)))
        return Command(
            attitude, self.hover_thrust, (0.0, 0.0, turn), heading,
            kind=CommandKind.TILT_CLIMB, setpoint=sent._replace(heading_rate=turn),
        )  # fmt: skip

    def _tune(self, params: TiltClimbParams) -> None:
        loop = self.outer_loop(params, self._airframe, self._inner, self._period)
        most = self._airframe.tilt
        self._tilt = most if params.tilt is None else min(params.tilt, most)
        self._tuned, self._gains = params, (loop.proportional, loop.derivative, loop.integral)

    def _level(self, setpoint: Setpoint, estimate: Estimate, dt: float) -> tuple[float, float]:
        """Return the horizontal acceleration (m/s^2, world), limited by the largest tilt."""
        p, drag, lead = self.params, self._airframe.drag, self._lead
        k, d, i = self._gains
        _, position, velocity, acceleration, jerk, *_ = setpoint
        wx, wy, _ = velocity or ZERO
        vx, vy, _ = estimate.velocity
        ax, ay, _ = acceleration or ZERO
        jx, jy, _ = jerk or ZERO
        ix, iy = self._integral
        ax += lead * jx + d * (wx - vx) + drag * wx
        ay += lead * jy + d * (wy - vy) + drag * wy
        if position is not None:
            ex, ey = position[0] - estimate.position[0], position[1] - estimate.position[1]
            ax, ay = ax + k * ex, ay + k * ey
            if self._floor is None:
                self._floor = estimate.position[2]
            flies = estimate.position[2] > self._floor + p.lift_off
            if flies and not self._limited and dt < LONGEST_STEP:
                most = p.integral_limit
                ix = max(-most, min(most, ix + i * dt * ex))
                iy = max(-most, min(most, iy + i * dt * ey))
                self._integral = (ix, iy)
        ax, ay = ax + ix, ay + iy
        size, widest = hypot(ax, ay), GRAVITY * tan(self._tilt)
        self._limited = size > widest
        return (ax * widest / size, ay * widest / size) if self._limited else (ax, ay)

    def _climb(self, setpoint: Setpoint, estimate: Estimate) -> float:
        """Return the climb rate (m/s), limited to the airframe's."""
        speed = (setpoint.velocity or ZERO)[2]
        speed += self._climb_time * (setpoint.acceleration or ZERO)[2]
        if setpoint.position is not None:
            speed += self.params.height * (setpoint.position[2] - estimate.position[2])
        return max(-self._airframe.climb, min(self._airframe.climb, speed))


def delay(inner: InnerLoop) -> float:
    """Return the lag (s) of the tilt behind a slowly changing command, due to the on-board loop and
    the command link."""
    loop = inner.attitude
    return loop.derivative / loop.proportional + inner.dead_time + inner.command_latency
