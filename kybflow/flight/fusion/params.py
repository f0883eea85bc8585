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
    source: Source = param("Where measurements come from.", default="mocap", read_only=True)
    position_noise: Length = param(
        "Standard deviation of a measured position along each axis, beside what its source tells "
        "of itself; motion capture tells nothing.",
        default=0.002, above=0.0,
    )  # fmt: skip
    attitude_noise: Angle = param(
        "Standard deviation of a measured attitude about each axis.", default=0.2 * DEG, above=0.0
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
