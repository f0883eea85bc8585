"""An error-state Kalman filter: the IMU, with poses or positions that are slow, late and noisy.

Position, velocity, attitude and the biases of accelerometer and gyroscope with their covariance (J.
Solà, "Quaternion kinematics for the error-state Kalman filter", 2017, sec. 5 and 6). A measurement
counts at the time at which it was true, and the IMU is replayed from there to now; one that comes
out of order does no harm, one older than `memory` is left out (`kybflow.flight.fusion.replay`).

source: `mocap` takes poses, `tags` the poses that printed tags in camera frames tell, `position`
positions alone, as of GPS. With these the filter begins at rest: the tilt is what the accelerometer
feels, the heading is the declared one, `heading_error` off, and is learnt where the vehicle speeds
up. Until `samples` measurements have come that fit one another there is no estimate.

Refused is a measurement whose innovation a share `gate` of true ones exceeds (chi-square), and one
further than `widest_gate`, plus four times its own deviation, from where the vehicle is believed to
be, however wide the filter's own spread: by the estimate that it flies on where that is another's,
else by the filter. So a body that was exchanged with another's is not followed. The filter begins
anew when all was refused for longer than `doubt`, and the measurement is where a vehicle can be
(`kybflow.flight.pose_gate`, gone on from the other's estimate, else from the newest measurement
that passed), or when measurements elsewhere have been consistent for `settled` seconds in which
nothing else was flown on.

age: of the newest measurement that was not refused. spread, metres: standard deviation of the
position along its worst axis, and beside it what a share `position_wander` of the variance of
positions alone comes to, which errs the same way for many of them (GPS: minutes); with all refused
for longer than `doubt`, also as much as the last of them was off. No estimate while no IMU comes
for 0.1 s; motion is unknown over such a gap (standard deviations 3 m/s^2, 1 rad/s).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import (
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
from kybflow.core.units import DEG, Acceleration, Angle, AngularRate, Duration, Length, Ratio, Speed
from kybflow.parts import Estimator, param, params
from kybflow.runtime.estimators.inertial import SILENT
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    from kybflow.vision.locating.locator import Sighting

Source = Literal["mocap", "tags", "position"]
_KINDS = {
    "mocap": Pose,
    "tags": Frame,
    "position": Position,
}
MOST_FORCE, MOST_TURN = 500.0, 100.0
"""What an IMU on a vehicle can feel, m/s^2 and rad/s."""


@params
class FusionParams:
    source: Source = param("Where measurements come from.", default="mocap", read_only=True)
    position_noise: Length = param(
        "Standard deviation of a measured position along each axis, beside what its source tells "
        "of itself; motion capture tells nothing.",
        default=0.002, above=0.0,
    )  # fmt: skip
    attitude_noise: Angle = param(
        "The same of a measured attitude, about each axis.", default=0.2 * DEG, above=0.0
    )
    velocity_walk: Speed = param(
        "What the accelerometer's noise makes of a velocity in one second, standard deviation.",
        default=0.005, above=0.0,
    )  # fmt: skip
    attitude_walk: Angle = param(
        "What the gyroscope's noise makes of an attitude in one second, standard deviation.",
        default=0.01 * DEG, above=0.0,
    )  # fmt: skip
    accelerometer_bias: Acceleration = param(
        "Standard deviation of the accelerometer's bias at the start.", default=0.05, above=0.0
    )
    gyro_bias: AngularRate = param(
        "Standard deviation of the gyroscope's bias at the start.", default=0.2 * DEG, above=0.0
    )
    accelerometer_drift: Acceleration = param(
        "By how much the accelerometer's bias changes in one second, standard deviation.",
        default=0.0005, at_least=0.0,
    )  # fmt: skip
    gyro_drift: AngularRate = param(
        "By how much the gyroscope's bias changes in one second, standard deviation.",
        default=0.001 * DEG, at_least=0.0,
    )  # fmt: skip
    heading_error: Angle = param(
        "Standard deviation of the declared heading, where only positions come.",
        default=15.0 * DEG, above=0.0, at_most=0.8,
    )  # fmt: skip
    position_wander: Ratio = param(
        "Share of the variance of positions alone that wanders slowly, so that no average takes it "
        "away; as much stays in the spread.",
        default=0.5, at_least=0.0, at_most=1.0,
    )  # fmt: skip
    memory: Duration = param(
        "How late a measurement may come.", default=0.5, above=0.0, at_most=5.0, read_only=True
    )
    samples: int = param("Measurements before there is an estimate.", default=3, at_least=1)
    gate: Ratio = param(
        "Share of true measurements that the gate may refuse.",
        default=0.001, above=1e-9, below=0.5, read_only=True,
    )  # fmt: skip
    widest_gate: Length = param(
        "How far from where it is believed the vehicle may be seen, beside four times the "
        "measurement's deviation.",
        default=0.5, above=0.0, tightens="down", read_only=True,
    )  # fmt: skip
    doubt: Duration = param(
        "How long everything may be refused before the estimate is no longer believed.",
        default=0.3, above=0.0,
    )  # fmt: skip
    settled: Duration = param(
        "How long measurements must have been consistent elsewhere, nothing else being flown on, "
        "before the vehicle counts as carried there; longer than any landing.",
        default=20.0, above=0.0,
    )  # fmt: skip


class Fusion(Estimator[FusionParams]):
    """See the module."""

    needs = frozenset({Imu, *_KINDS.values()})
    needs_tags = True

    def __init__(self, params: FusionParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        from kybflow.flight.fusion.filter import Filter
        from kybflow.flight.fusion.sources import source

        self.filter = Filter(params, context.heading)
        self._read = source(params, context, self.filter.at, self._saw)
        self._turn: Vec3 = ZERO

    @classmethod
    def uses(cls, params: FusionParams) -> frozenset[MeasurementKind]:
        return frozenset({Imu, _KINDS[params.source]})

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        for measurement in measurements:
            if type(measurement) is Imu and _is_sound(measurement):
                self._turn = measurement.angular_velocity
                self.filter.feel(measurement)
        self.filter.take(self._read(measurements), now)
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
        if now - nominal.time > SILENT:
            return None
        (px, py, pz), (vx, vy, vz) = nominal.position, nominal.velocity
        (wx, wy, wz), (bx, by, bz) = self._turn, nominal.gyro_bias
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
    """Not for a number that is none, nor for one that no vehicle survives."""
    (fx, fy, fz), (wx, wy, wz) = imu.specific_force, imu.angular_velocity
    force, turn = fx * fx + fy * fy + fz * fz, wx * wx + wy * wy + wz * wz
    return force < MOST_FORCE**2 and turn < MOST_TURN**2 and 0.0 < imu.dt * NS <= SILENT
