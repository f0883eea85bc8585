"""Simulated quadrotors in MuJoCo, all in one world.

Rotors have lag, saturation, drag torque, ground effect and downwash. Rotor drag, wind, gusts and
contacts act on the body. Mass, inertia and thrust differ from the airframe's, and the battery sags.
The on-board controller reads a noisy, biased IMU. Motion capture delivers noisy poses at its own
rate and with a delay; so does GPS with positions, if an estimator needs them. When commands stop,
the vehicle lands by itself. A payload adds to the mass and, once released, falls as a box. Faults
act on the vehicle through its link's `faults`. The same generator gives the same flight, bit for
bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

from kybflow.core.signals import Battery, CommandKind, Imu, Pose, Position
from kybflow.core.units import (
    DEG,
    Acceleration,
    Angle,
    AngularAcceleration,
    AngularRate,
    Duration,
    Frequency,
    Length,
    Number,
    Ratio,
    Speed,
    Velocity,
)
from kybflow.parts import Air, Charge, Driver, MeasuredPositions, Seat, Session, param, params
from kybflow.world.vehicle_context import Airframe, InnerLoop

if TYPE_CHECKING:
    import random


@params
class SimParams:
    physics: Frequency = param(
        "Rate of the physics and of the on-board controller.",
        default=500.0, at_least=200.0, at_most=5000.0, read_only=True,
    )  # fmt: skip
    model_error: Ratio = param(
        "Largest error of the airframe's mass, inertia, thrust, rotor time and drag.",
        default=0.05, at_least=0.0, at_most=0.2, read_only=True,
    )  # fmt: skip
    wind: Velocity = param(
        "Steady wind, world frame; along body z it acts on the rotors alone, by `inflow`.",
        default=(0.0, 0.0, 0.0), read_only=True,
    )  # fmt: skip
    gust: Speed = param(
        "Standard deviation of the gusts along each axis; they last about a second.",
        default=0.0, at_least=0.0, at_most=10.0, read_only=True,
    )  # fmt: skip
    gyro_noise: AngularRate = param(
        "Noise of each gyroscope sample, standard deviation.",
        default=0.2 * DEG, at_least=0.0, read_only=True,
    )  # fmt: skip
    gyro_bias: AngularRate = param(
        "Standard deviation of the gyroscope's bias.",
        default=0.2 * DEG, at_least=0.0, read_only=True,
    )  # fmt: skip
    accelerometer_noise: Acceleration = param(
        "Noise of each accelerometer sample, standard deviation.",
        default=0.1, at_least=0.0, read_only=True,
    )  # fmt: skip
    accelerometer_bias: Acceleration = param(
        "Standard deviation of the accelerometer's bias.",
        default=0.05, at_least=0.0, read_only=True,
    )  # fmt: skip
    mocap_rate: Frequency = param(
        "Poses per second from motion capture.", default=120.0, at_least=1.0, read_only=True
    )
    mocap_position_noise: Length = param(
        "Noise of a pose's position along each axis, standard deviation.",
        default=0.0005, at_least=0.0, read_only=True,
    )  # fmt: skip
    mocap_attitude_noise: Angle = param(
        "Noise of a pose's attitude about each axis, standard deviation.",
        default=0.1 * DEG, at_least=0.0, read_only=True,
    )  # fmt: skip
    mocap_latency: Duration = param(
        "Delay until a pose arrives.", default=0.010, at_least=0.0, at_most=1.0, read_only=True
    )
    position_rate: Frequency = param(
        "Positions per second, as from GPS; only if an estimator needs them.",
        default=5.0, at_least=1.0, read_only=True,
    )  # fmt: skip
    position_noise: Length = param(
        "Error of a position along each horizontal axis, standard deviation; half of its variance"
        " wanders within half a minute.",
        default=0.3, at_least=0.0, read_only=True,
    )  # fmt: skip
    position_noise_up: Length = param(
        "Error of the height, standard deviation; half of its variance wanders too.",
        default=0.5, at_least=0.0, read_only=True,
    )  # fmt: skip
    position_latency: Duration = param(
        "Delay until a position arrives.", default=0.12, at_least=0.0, at_most=1.0, read_only=True
    )
    battery: Ratio = param(
        "Charge of the battery at the start.", default=1.0, above=0.0, at_most=1.0, read_only=True
    )
    battery_rate: Frequency = param(
        "Battery reports per second.", default=10.0, at_least=0.1, at_most=100.0, read_only=True
    )
    calm: bool = param(
        "Still air and a perfect lab: sets the parameters from here to `stamp_jitter` to zero.",
        default=False, read_only=True,
    )  # fmt: skip
    force_noise: Acceleration = param(
        "Random force on the body over its mass along each axis, standard deviation; correlated"
        " over half a second, like eddies in a room.",
        default=0.08, at_least=0.0, at_most=5.0, read_only=True,
    )  # fmt: skip
    torque_noise: AngularAcceleration = param(
        "Random torque over the moment of inertia about each axis, standard deviation; correlated"
        " over half a second.",
        default=0.5, at_least=0.0, at_most=50.0, read_only=True,
    )  # fmt: skip
    drag_error: Ratio = param(
        "Largest error of the airframe's drag, on top of `model_error`.",
        default=0.5, at_least=0.0, at_most=0.9, read_only=True,
    )  # fmt: skip
    accelerometer_vibration: Acceleration = param(
        "Noise along body z that the rotors add to each accelerometer sample in hover, standard"
        " deviation; proportional to thrust, and 0.6 of it along body x and y. ArduPilot considers"
        " up to 5 m/s^2 along z and 3 across harmless (Measuring Vibration).",
        default=1.0, at_least=0.0, at_most=20.0, read_only=True,
    )  # fmt: skip
    gyro_vibration: AngularRate = param(
        "Noise that the rotors add to each gyroscope sample in hover, standard deviation; the"
        " estimators of EuRoC's flights assume 0.6 to 3 deg/s (VINS-Mono).",
        default=1.0 * DEG, at_least=0.0, at_most=60.0 * DEG, read_only=True,
    )  # fmt: skip
    ground_effect: Number = param(
        "Thrust gained near the floor, relative to a quadrotor's model (Cheeseman and Bennett,"
        " 1955; Sanchez-Cuevas, Heredia and Ollero, 2017).",
        default=1.0, at_least=0.0, at_most=3.0, read_only=True,
    )  # fmt: skip
    downwash: Number = param(
        "Speed of the jet below the vehicle, relative to a quadrotor's model (Bauersfeld et al.,"
        " RA-L 2025); it acts on vehicles below by their `inflow`.",
        default=1.0, at_least=0.0, at_most=3.0, read_only=True,
    )  # fmt: skip
    inflow: Number = param(
        "Drag along body z, relative to that in the rotors' plane: climbing rotors lose thrust "
        "(Svacha, Mohta and Kumar, ICUAS 2017).",
        default=2.0, at_least=0.0, at_most=10.0, read_only=True,
    )  # fmt: skip
    loop_error: Ratio = param(
        "Largest error of the inertia and rotor time for which the on-board gains are tuned.",
        default=0.1, at_least=0.0, at_most=0.3, read_only=True,
    )  # fmt: skip
    gyro_filter: Frequency = param(
        "Cut-off of the second-order low-pass before the on-board rate loop, as PX4's"
        " `IMU_GYRO_CUTOFF`.",
        default=50.0, at_least=10.0, at_most=1000.0, read_only=True,
    )  # fmt: skip
    dead_time: Duration = param(
        "Delay from a gyroscope sample to the motors: the loop and the ESC's protocol.",
        default=0.005, at_least=0.0, at_most=0.05, read_only=True,
    )  # fmt: skip
    command_latency: Duration = param(
        "Delay until a command arrives on board.", default=0.010, at_least=0.0, at_most=0.2,
        read_only=True,
    )  # fmt: skip
    command_jitter: Duration = param(
        "Standard deviation of that delay.",
        default=0.003, at_least=0.0, at_most=0.1, read_only=True,
    )  # fmt: skip
    mocap_misalignment: Angle = param(
        "Standard deviation of the angle about each axis between the body and its axes in motion"
        " capture.",
        default=1.0 * DEG, at_least=0.0, at_most=10.0 * DEG, read_only=True,
    )  # fmt: skip
    mocap_loss: Ratio = param(
        "Share of poses that are lost.", default=0.01, at_least=0.0, at_most=0.9, read_only=True
    )
    stamp_error: Duration = param(
        "Largest error of the poses' stamps, constant for a flight.",
        default=0.005, at_least=0.0, at_most=0.1, read_only=True,
    )  # fmt: skip
    stamp_jitter: Duration = param(
        "Standard deviation of each stamp.",
        default=0.001, at_least=0.0, at_most=0.05, read_only=True,
    )  # fmt: skip
    watchdog: bool = param(
        "Level out and land by itself when no command arrives for 250 ms.",
        default=True, read_only=True,
    )  # fmt: skip
    live: bool = param("Show the flight in MuJoCo's viewer.", default=False, read_only=True)


class Sim(Driver[SimParams]):
    accepts = frozenset({CommandKind.ATTITUDE_THRUST})
    provides = frozenset({Pose, Battery, Imu, Position})
    simulated: ClassVar[bool] = True
    moves_objects: ClassVar[bool] = True
    shared: ClassVar[bool] = False
    grips: ClassVar[bool] = True
    brings = ("simulated_camera",)

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        from kybflow.drivers.sim.world import SimulatedWorld

        return SimulatedWorld(seats, generator)

    @classmethod
    def watchdog(cls, params: SimParams) -> str | None:
        return (
            None
            if params.watchdog
            else "`watchdog` is off: nothing lands the vehicle if this program stops"
        )

    @classmethod
    def world(cls, params: SimParams) -> str:
        return "still air" if params.calm else "a lab"

    @classmethod
    def air(cls, params: SimParams) -> Air:
        return Air(params.wind, params.gust, 0.0 if params.calm else params.force_noise)

    @classmethod
    def charge(cls, params: SimParams) -> Charge:
        return Charge("battery", params.battery)

    @classmethod
    def inner_loop(cls, params: SimParams, airframe: Airframe) -> InnerLoop:
        """Return the inner loop with the lab's delays, without their random parts. The IMU measures
        before a step, so a gyroscope sample moves the rotors two steps later. From this delay, half
        a step is subtracted for each stage of the gyroscope's filter, and `lead - 1` steps for the
        lead, which is discretised as well."""
        p, loop, lag = params, airframe.attitude_loop, airframe.rotor_time
        steps, cut_off, command = 2.0 - (loop.lead - 1.0), 0.0, 0.0
        if not p.calm:
            steps += round(p.dead_time * p.physics) - 1.0
            cut_off, command = p.gyro_filter, p.command_latency
        dead, period, step = max(0.0, steps) / p.physics, 1.0 / p.mocap_rate, 1.0 / p.physics
        return InnerLoop(loop, lag, cut_off, dead, command, p.mocap_latency, period, step)

    @classmethod
    def positions(cls, params: SimParams) -> MeasuredPositions:
        p = params
        error = max(p.position_noise, p.position_noise_up)
        return MeasuredPositions(p.position_latency, 1.0 / p.position_rate, error)

    @classmethod
    def pose_error(cls, params: SimParams) -> float:
        return params.mocap_position_noise

    @classmethod
    def step_rate(cls, params: SimParams) -> float | None:
        return params.physics
