"""The parameters of an AR.Drone, real or emulated."""

from __future__ import annotations

from typing import Literal

from kybflow.core.params import param, params
from kybflow.core.units import DEG, Angle, AngularRate, Duration, Frequency, Length, Speed


@params
class ArdroneLinkParams:
    """What is asked of every drone, also of an emulated one."""

    rate: Frequency = param(
        "Commands a second.", default=50.0, at_least=25.0, at_most=200.0, read_only=True
    )
    navdata: Literal["full", "demo"] = param(
        "Navigation data: `full` at 200 Hz, with the inertial sensors, or `demo` at 15 Hz.",
        default="full", read_only=True,
    )  # fmt: skip
    outdoor: bool = param("Whether it flies outdoors.", default=False, read_only=True)
    hull: bool = param("Whether it has its indoor hull on.", default=True, read_only=True)
    altitude_max: Length = param(
        "Height that the drone itself does not leave.",
        default=3.0, at_least=0.5, at_most=100.0, read_only=True,
    )  # fmt: skip
    euler_angle_max: Angle | None = param(
        "Tilt of a whole command; by default the airframe's largest.",
        default=None, at_least=1.0 * DEG, at_most=30.0 * DEG, read_only=True,
    )  # fmt: skip
    control_vz_max: Speed | None = param(
        "Climb rate of a whole command; by default the airframe's largest.",
        default=None, at_least=0.2, at_most=2.0, read_only=True,
    )  # fmt: skip
    control_yaw: AngularRate = param(
        "Heading rate of a whole command.",
        default=100.0 * DEG, at_least=40.0 * DEG, at_most=350.0 * DEG, read_only=True,
    )  # fmt: skip
    ultrasound: Literal["22 Hz", "25 Hz"] = param(
        "Rate of the ultrasound; drones that fly beside each other need different ones.",
        default="25 Hz", read_only=True,
    )  # fmt: skip
    flat_trim: bool = param(
        "Take how it stands before the first take-off for level: on flat ground only.",
        default=False, read_only=True,
    )  # fmt: skip
    compass: Angle | None = param(
        "The bearing of the world's x axis, clockwise from north; 90 deg where it points east. With"
        " it tilts are given by the compass, which the drone has too (PCMD_MAG), by default in the"
        " drone's own directions.",
        default=None, read_only=True,
    )  # fmt: skip
    maneuvers: bool = param(
        "Whether it may be asked for what takes it from its tracker: flight animations, and the"
        " calibration of its magnetometer.",
        default=False, read_only=True,
    )  # fmt: skip
    video: Literal["front", "down"] = param(
        "Which of its cameras it sends; the sensor `ardrone_camera` takes the video.",
        default="front", read_only=True,
    )  # fmt: skip
    profile: str = param(
        "The user's name, by which the drone keeps a configuration of its own.",
        default="kybflow", read_only=True,
    )  # fmt: skip
    application: str = param("The application's name, likewise.", default="kybflow", read_only=True)
    latency: Duration = param(
        "How late a command arrives on board, for which the gains are made; tum_ardrone takes 50 ms"
        " and the ping.",
        default=0.06, at_least=0.0, at_most=0.5, read_only=True,
    )  # fmt: skip
    take_off_time: Duration = param(
        "How long the drone's own take-off may last.", default=12.0, above=0.0, read_only=True
    )


@params
class ArdroneParams(ArdroneLinkParams):
    host: str = param(
        "Its IPv4 address: 192.168.1.1 in its own network, in a lab's network one of its own.",
        default="192.168.1.1", read_only=True,
    )  # fmt: skip
