"""Motion capture measures the vehicle with more noise.

Normally distributed noise is added to that of the simulator: to the position along each world axis,
and to the attitude about each body axis.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.geometry import Vec3, add, integrate
from kybflow.core.signals import Measurement, Pose
from kybflow.core.units import DEG, Angle, Length
from kybflow.parts import Effect, Fault, param, params


@params
class MocapNoiseParams:
    position: Length = param(
        "Standard deviation along each axis.", default=0.02, at_least=0.0, read_only=True
    )
    attitude: Angle = param(
        "Standard deviation about each axis.", default=1.0 * DEG, at_least=0.0, read_only=True
    )


class MocapNoise(Fault[MocapNoiseParams]):
    spoils = Pose
    ours = True

    @classmethod
    def is_nothing(cls, params: MocapNoiseParams) -> bool:
        return params.position == 0.0 and params.attitude == 0.0

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(filter=self._shake)}

    def _shake(self, measurement: Measurement) -> Measurement | None:
        if not isinstance(measurement, Pose):
            return measurement
        position = add(measurement.position, self._draw(self.params.position))
        turn = self._draw(self.params.attitude)
        return Pose(measurement.time, position, integrate(measurement.attitude, turn, 1.0))

    def _draw(self, deviation: float) -> Vec3:
        draw = self.generator.gauss
        return (draw(0.0, deviation), draw(0.0, deviation), draw(0.0, deviation))
