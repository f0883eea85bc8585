"""Attitude control in this program, for an on-board controller that follows body rates and thrust.

Force, thrust and the desired attitude are those of `geometric`. Let e be the attitude error: the
rotation vector that turns the estimated attitude into the desired one, in the body frame. Let w_des
be the rates at which the desired attitude turns, in its own body frame. The commanded rates are

    w = k e + R_e w_des,

where k is `attitude` about body x and y and `turn` about body z, and R_e takes a vector from the
desired body frame to the estimated one. Rates are cut to `fastest`, as a whole vector, rad/s.
There is no integral: if the on-board loop misses the rates, an attitude error remains, which the
`trim` removes. The loop is closed on the estimate's attitude, which must therefore be as fast as an
attitude loop requires (about 100 Hz, at most about 20 ms old); a late one makes the vehicle shake.
"""

from __future__ import annotations

from math import atan2

from kybflow.core.geometry import Quat, Vec3, conjugate, multiply, norm, rotate
from kybflow.core.signals import Command, CommandKind, MeasurementKind, Setpoint, SetpointKind, Tick
from kybflow.core.units import AngularRate, Damping
from kybflow.flight.geometric_law import GeometricLaw, GeometricParams, outer_loop, used_by
from kybflow.flight.governor import shortened
from kybflow.flight.loops.position_loop import OuterLoop
from kybflow.parts import Tracker, param, params
from kybflow.world.vehicle_context import Airframe, InnerLoop, VehicleContext


@params
class BodyRatesParams(GeometricParams):
    attitude: Damping = param(
        "Body rate per angle of the attitude's error, roll and pitch.", default=8.0, above=0
    )
    turn: Damping = param(
        "Body rate per angle of the attitude's error, heading.", default=2.5, above=0
    )
    fastest: AngularRate = param("Largest commanded body rate.", default=4.0, above=0)


class BodyRates(Tracker[BodyRatesParams]):
    accepts = frozenset({SetpointKind.POSITION, SetpointKind.VELOCITY})
    emits = CommandKind.RATES_THRUST

    def __init__(self, params: BodyRatesParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._law = GeometricLaw(params, context, params.attitude)

    @classmethod
    def uses(cls, params: BodyRatesParams) -> frozenset[MeasurementKind]:
        return used_by(params)

    @classmethod
    def outer_loop(
        cls, params: BodyRatesParams, airframe: Airframe, inner: InnerLoop | None, period: float
    ) -> OuterLoop:
        return outer_loop(params, airframe, inner, period, params.attitude)

    @property
    def hover_thrust(self) -> float:
        return self._law.hover_thrust

    @property
    def lean(self) -> tuple[float, float]:
        return self._law.lean

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        p = self.params
        attitude, thrust, rates, heading, *_ = self._law.command(p, setpoint, tick)
        off = multiply(conjugate(tick.known().attitude), attitude)
        ex, ey, ez = _turn(off)
        fx, fy, fz = rotate(off, rates)
        rates = (p.attitude * ex + fx, p.attitude * ey + fy, p.turn * ez + fz)
        rates = shortened(rates, p.fastest)
        return Command(attitude, thrust, rates, heading, kind=CommandKind.RATES_THRUST)


def _turn(q: Quat) -> Vec3:
    """Return the rotation vector (rad) of `q`, for the shorter of the two rotations."""
    w, x, y, z = q if q[0] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])
    size = norm((x, y, z))
    k = 2.0 * atan2(size, w) / size if size > 1e-9 else 2.0
    return (k * x, k * y, k * z)
