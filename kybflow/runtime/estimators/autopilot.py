"""The estimate of the autopilot's own estimator, extrapolated to now.

Its newest odometry (position p, velocity v, attitude q, turn rate w, at time t) becomes

    p + (now - t) v,    q turned at w for (now - t),

with the same velocities. Odometry is extrapolated by `ahead` at most; after that, the estimate
stays where it is and its `age` grows. spread: as the autopilot reports it, metres. Odometry is
ignored if it is not newer than the last, not finite, or if its attitude is not a rotation.

If the autopilot gets its position from this program (external vision), its estimate is not
independent: it has the same age and errors, and is continued by the autopilot's IMU when that
position is no longer sent.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from kybflow.core.geometry import integrate
from kybflow.core.signals import NS, Estimate, Measurement, Odometry, Time
from kybflow.core.units import Duration
from kybflow.parts import Estimator, param, params
from kybflow.world.vehicle_context import VehicleContext


@params
class AutopilotEstimatorParams:
    ahead: Duration = param(
        "Largest time by which odometry is extrapolated.", default=0.2, at_least=0.0, at_most=2.0
    )


class AutopilotEstimator(Estimator[AutopilotEstimatorParams]):
    needs = frozenset({Odometry})
    own: ClassVar[bool] = True

    def __init__(self, params: AutopilotEstimatorParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._newest: Odometry | None = None

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        newest = self._newest
        for one in measurements:
            if not isinstance(one, Odometry) or not _is_sound(one):
                continue
            if newest is None or one.time > newest.time:
                newest = one
        self._newest = newest
        if newest is None:
            return None
        time, place, velocity, attitude, rates, spread = newest
        age = max(0.0, (now - time) / NS)
        dt = min(age, self.params.ahead)
        px, py, pz = place
        vx, vy, vz = velocity
        position = (px + dt * vx, py + dt * vy, pz + dt * vz)
        attitude = integrate(attitude, rates, dt)
        return Estimate(now, position, velocity, attitude, rates, "autopilot", age, spread)


def _is_sound(one: Odometry) -> bool:
    w, x, y, z = one.attitude
    spread = one.spread
    total = sum((*one.position, *one.velocity, *one.angular_velocity), spread)
    return total - total == 0.0 and spread >= 0.0 and 0.9 < w * w + x * x + y * y + z * z < 1.1
