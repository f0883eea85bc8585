"""An error-state Kalman filter: the IMU, with poses or positions that are slow, late and noisy.

Position, velocity, attitude and the biases of accelerometer and gyroscope with their covariance (J.
Solà, "Quaternion kinematics for the error-state Kalman filter", 2017, sec. 5 and 6). A measurement
counts at its own time, and the IMU is replayed from there to now; measurements may arrive out of
order, and one older than `memory` is ignored (`kybflow.flight.fusion.replay`).

source: `mocap` uses poses, `tags` the poses of printed tags in camera frames, `position` positions
alone, such as those of GPS. With these the filter starts at rest: the accelerometer gives the tilt,
and the declared heading, with `heading_error`, is corrected once the vehicle accelerates. There is
no estimate until `samples` measurements agree.

Poses from tags have the same error from frame to frame, by errors of lens, mount, map and stamps.
Its size follows for each frame (`kybflow.vision.locating.systematic`), and its causes are a part of
the state: the errors of each camera and of the stamps as constants, those of the map as a process
that forgets while the body moves on to other tags (`kybflow.flight.fusion.covariance`). So no frame
is refused for an error that all of them have; gravity and motion show how the camera is mounted and
how late frames are stamped; and what they don't show is in the spread. An IMU whose samples scatter
more than declared gets less weight (`kybflow.flight.fusion.vibration`).

A measurement is refused if a share `gate` of true ones exceeds its innovation (chi-square), or if
it is further than `widest_gate`, plus four times its own deviation, from the expected position,
however wide the filter's own spread: by the estimate that the vehicle flies on if that is another
estimator's, else by the filter. So a body that was exchanged with another's is not followed. The
filter starts anew from refused measurements that agree for `doubt` seconds and are where the
vehicle can be, or that agree for `settled` seconds in which nothing else was flown on
(`kybflow.flight.pose_gate`).

age: of the newest measurement that passed. spread, metres: standard deviation of the position along
its worst axis, and in addition a share `position_wander` of the variance of positions, an error
that many of them have in common (GPS: minutes); if all are refused for longer than `doubt`, also
the deviation of the last of them. There is no estimate while no IMU arrives for 0.1 s; motion is
unknown over such a gap (standard deviations 3 m/s^2, 1 rad/s).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import (
    IMU_TIMEOUT,
    NS,
    Estimate,
    Frame,
    Imu,
    Measurement,
    MeasurementKind,
    Pose,
    Position,
    Time,
)
from kybflow.flight.fusion.params import FilterParams
from kybflow.parts import Estimator, params
from kybflow.world.calibration_errors import CalibrationErrors
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    from kybflow.vision.locating.locator import Sighting

_KINDS = {
    "mocap": Pose,
    "tags": Frame,
    "position": Position,
}
MOST_FORCE, MOST_TURN = 500.0, 100.0
"""Largest plausible samples of an IMU, m/s^2 and rad/s."""


@params
class FusionParams(CalibrationErrors, FilterParams):
    """The parameters of the filter, and the errors of cameras and tags."""


class Fusion(Estimator[FusionParams]):
    needs = frozenset({Imu, *_KINDS.values()})
    needs_tags = True

    def __init__(self, params: FusionParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        from kybflow.flight.fusion.filter import Filter
        from kybflow.runtime.estimators._fusion_sources import source

        self.filter = Filter(params, context.heading)
        self._read = source(params, params, context, self.filter.at, self._saw)
        self._turn: Vec3 = ZERO

    @classmethod
    def uses(cls, params: FusionParams) -> frozenset[MeasurementKind]:
        return frozenset({Imu, _KINDS[params.source]})

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        for measurement in measurements:
            if type(measurement) is Imu and _is_sound(measurement):
                self._turn = measurement.angular_velocity
                self.filter.add_imu(measurement)
        self.filter.take(self._read(measurements), now)
        self.refusal = self.filter.refusal
        return self._estimate(now)

    def anchor(self, estimate: Estimate) -> None:
        self.filter.anchor(estimate)

    def _saw(self, sighting: Sighting | None) -> None:
        self.sighting = sighting

    def _estimate(self, now: Time) -> Estimate | None:
        nominal, state = self.filter.nominal, self.filter.state
        if nominal is None or state is None or not self.filter.is_known:
            return None
        ahead = (now - nominal.time) / NS
        if now - nominal.time > IMU_TIMEOUT:
            return None
        px, py, pz = nominal.position
        vx, vy, vz = nominal.velocity
        wx, wy, wz = self._turn
        bx, by, bz = nominal.gyro_bias
        return Estimate(
            now,
            (px + ahead * vx, py + ahead * vy, pz + ahead * vz),
            nominal.velocity,
            nominal.attitude,
            (wx - bx, wy - by, wz - bz),
            "fusion",
            (now - state.fused) / NS,
            self.filter.spread,
        )


def _is_sound(imu: Imu) -> bool:
    """Return whether a sample is finite and no vehicle would break by it."""
    fx, fy, fz = imu.specific_force
    wx, wy, wz = imu.angular_velocity
    force, turn = fx * fx + fy * fy + fz * fz, wx * wx + wy * wy + wz * wz
    return force < MOST_FORCE**2 and turn < MOST_TURN**2 and 0.0 < imu.dt * NS <= IMU_TIMEOUT
