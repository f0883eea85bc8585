"""The biases of the IMU's gyroscopes and accelerometers jump.

The step is added to the biases that the sensor already has, along each body axis. It affects the
on-board controller and every estimator that reads the IMU.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.geometry import ZERO
from kybflow.core.units import Accelerations, AngularVelocity
from kybflow.parts import Effect, Fault, param, params


@params
class ImuBiasStepParams:
    gyro: AngularVelocity = param(
        "Added to the turn rates about body x, y, z.", default=ZERO, read_only=True
    )
    accelerometer: Accelerations = param(
        "Added to the specific force along body x, y, z.", default=ZERO, read_only=True
    )


class ImuBiasStep(Fault[ImuBiasStepParams]):
    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        p = self.params
        return {vehicle: Effect(gyro_bias=p.gyro, accelerometer_bias=p.accelerometer)}
