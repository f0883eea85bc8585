"""The parameters of the fusion: the source of its measurements, their noise, and what is refused.
The compiler reads these without the filter, which loads NumPy.
"""

from __future__ import annotations

from typing import Literal

from kybflow.core.params import param, params
from kybflow.core.units import DEG, Acceleration, Angle, AngularRate, Duration, Length, Ratio, Speed

Source = Literal["mocap", "tags", "position"]


@params
class FilterParams:
    source: Source = param("Source of the measurements.", default="mocap", read_only=True)
    position_noise: Length = param(
        "Standard deviation of a measured position along each axis, in addition to the one that "
        "the source reports; motion capture reports none.",
        default=0.002, above=0.0,
    )  # fmt: skip
    attitude_noise: Angle = param(
        "Standard deviation of a measured attitude about each axis.", default=0.2 * DEG, above=0.0
    )
    velocity_walk: Speed = param(
        "Standard deviation of the velocity that the accelerometer's noise adds in one second.",
        default=0.005, above=0.0,
    )  # fmt: skip
    attitude_walk: Angle = param(
        "Standard deviation of the attitude that the gyroscope's noise adds in one second.",
        default=0.01 * DEG, above=0.0,
    )  # fmt: skip
    accelerometer_bias: Acceleration = param(
        "Standard deviation of the accelerometer's bias at the start.", default=0.05, above=0.0
    )
    gyro_bias: AngularRate = param(
        "Standard deviation of the gyroscope's bias at the start.", default=0.2 * DEG, above=0.0
    )
    accelerometer_drift: Acceleration = param(
        "Standard deviation of the accelerometer's bias change in one second.",
        default=0.0005, at_least=0.0,
    )  # fmt: skip
    gyro_drift: AngularRate = param(
        "Standard deviation of the gyroscope's bias change in one second.",
        default=0.001 * DEG, at_least=0.0,
    )  # fmt: skip
    heading_error: Angle = param(
        "Standard deviation of the declared heading, if only positions are measured.",
        default=15.0 * DEG, above=0.0, at_most=0.8,
    )  # fmt: skip
    position_wander: Ratio = param(
        "Share of a position's variance that drifts slowly, which averaging can't remove; the "
        "spread keeps it. Only without attitudes.",
        default=0.5, at_least=0.0, at_most=1.0,
    )  # fmt: skip
    memory: Duration = param(
        "Largest delay of a measurement.", default=0.5, above=0.0, at_most=5.0, read_only=True
    )
    samples: int = param("Number of measurements before the first estimate.", default=3, at_least=1)
    gate: Ratio = param(
        "Share of true measurements that the gate may refuse.",
        default=0.001, above=1e-9, below=0.5, read_only=True,
    )  # fmt: skip
    widest_gate: Length = param(
        "Allowed distance of a measurement from the estimate, in addition to four times the "
        "measurement's deviation.",
        default=0.5, above=0.0, tightens="down", read_only=True,
    )  # fmt: skip
    doubt: Duration = param(
        "Time without an accepted measurement after which the estimate is no longer trusted.",
        default=0.3, above=0.0,
    )  # fmt: skip
    settled: Duration = param(
        "Time for which measurements must agree on another place, without any other estimate in "
        "use, before the vehicle counts as carried there; longer than any landing.",
        default=20.0, above=0.0,
    )  # fmt: skip
