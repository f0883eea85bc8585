"""An error-state Kalman filter: the IMU, with poses or positions that are slow, late and noisy.

The state is position, velocity, attitude and the biases of accelerometer and gyroscope, with their
covariance (J. Solà, "Quaternion kinematics for the error-state Kalman filter", 2017, sec. 5 and 6).
A measurement is applied at its own time, and the IMU is replayed from there to now. Measurements
may arrive out of order; one older than `memory` is ignored (`kybflow.flight.fusion.replay`).

source: `mocap` uses poses, `tags` the poses of printed tags in camera frames, `position` positions
alone, such as those of GPS. With positions alone the filter starts at rest: the accelerometer gives
the tilt, and the declared heading, with `heading_error`, is corrected once the vehicle accelerates.
There is no estimate until `samples` measurements agree.

Poses from tags have a common error from frame to frame, due to errors of lens, mount, map and
stamps. Its size is computed for each frame (`kybflow.vision.locating.systematic`), and its causes
are part of the state: the errors of each camera and of the stamps as constants, those of the map as
a process that forgets while the body moves on to other tags (`kybflow.flight.fusion.covariance`).
So no frame is refused because of an error that all frames share. Gravity and motion reveal how the
camera is mounted and how late frames are stamped; errors that they don't reveal are included in the
spread. An IMU whose samples scatter more than declared gets less weight
(`kybflow.flight.fusion.covariance`).

A measurement is refused if only a fraction `gate` of correct ones has a larger innovation
(chi-square), or if it is further than `widest_gate` plus four times its own deviation from the
expected position, however large the filter's own spread is. The expected position is that of the
estimate on which the vehicle flies if another estimator gives it, otherwise the filter's. So a body
that was exchanged with another's is not followed. The filter restarts from refused measurements
that agree for `doubt` seconds and are where the vehicle can be, or that agree for `settled` seconds
in which the vehicle flew on no other estimate (`kybflow.flight.pose_gate`).

age: the age of the newest measurement that was accepted. spread, metres: the standard deviation of
the position along its worst axis, plus a fraction `position_wander` of the variance of positions,
an error that many of them have in common (GPS: for minutes); if all have been refused for longer
than `doubt`, also the deviation of the last one. There is no estimate while no IMU sample arrives
for 0.1 s; motion over such a gap is unknown (standard deviations 3 m/s^2, 1 rad/s).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
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
from kybflow.world.cameras import CalibrationErrors
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    from kybflow.vision.locating.locator import Sighting

_KINDS = {
    "mocap": Pose,
    "tags": Frame,
    "position": Position,
}
MOST_FORCE, MOST_TURN = 500.0, 100.0
"""Largest plausible specific force (m/s^2) and body rate (rad/s) of an IMU sample."""


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

    @classmethod
    def least_spread(cls, params: FusionParams, error: float) -> float:
        return sqrt(params.position_wander) * error if params.source == "position" else 0.0

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        for measurement in measurements:
            if type(measurement) is Imu and _is_sound(measurement):
                self._turn = measurement.angular_velocity
                self.filter.add_imu(measurement)
        self.filter.take(self._read(measurements), now)
        self.refusal = self.filter.refusal
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

    def anchor(self, estimate: Estimate) -> None:
        self.filter.anchor(estimate)

    def _saw(self, sighting: Sighting | None) -> None:
        self.sighting = sighting


def _is_sound(imu: Imu) -> bool:
    """Return whether a sample is finite and plausible, and its interval is not too long."""
    fx, fy, fz = imu.specific_force
    wx, wy, wz = imu.angular_velocity
    force, turn = fx * fx + fy * fy + fz * fz, wx * wx + wy * wy + wz * wz
    return force < MOST_FORCE**2 and turn < MOST_TURN**2 and 0.0 < imu.dt * NS <= IMU_TIMEOUT
