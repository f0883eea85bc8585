"""The parameters of an AR.Drone, real or emulated, and the limits that they set."""

from __future__ import annotations

from typing import Literal, NamedTuple

from kybflow.core.params import param, params
from kybflow.core.units import DEG, Angle, AngularRate, Duration, Frequency, Length, Speed
from kybflow.world.vehicle_context import Airframe


@params
class ArdroneLinkParams:
    """Parameters that real and emulated drones share."""

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
        "Largest height, which the drone itself enforces.",
        default=3.0, at_least=0.5, at_most=100.0, read_only=True,
    )  # fmt: skip
    euler_angle_max: Angle | None = param(
        "Tilt of a full command; by default the airframe's largest.",
        default=None, at_least=1.0 * DEG, at_most=30.0 * DEG, read_only=True,
    )  # fmt: skip
    control_vz_max: Speed | None = param(
        "Climb rate of a full command; by default the airframe's largest.",
        default=None, at_least=0.2, at_most=2.0, read_only=True,
    )  # fmt: skip
    control_yaw: AngularRate = param(
        "Heading rate of a full command.",
        default=100.0 * DEG, at_least=40.0 * DEG, at_most=350.0 * DEG, read_only=True,
    )  # fmt: skip
    ultrasound: Literal["22 Hz", "25 Hz"] = param(
        "Rate of the ultrasound; drones that fly near each other need different rates.",
        default="25 Hz", read_only=True,
    )  # fmt: skip
    flat_trim: bool = param(
        "Calibrate level before the first take-off; the drone must stand on flat ground.",
        default=False, read_only=True,
    )  # fmt: skip
    compass: Angle | None = param(
        "Bearing of the world's x axis, clockwise from north; 90 deg if it points east. If given,"
        " tilts are sent relative to the compass (PCMD_MAG), otherwise relative to the drone's"
        " heading.",
        default=None, read_only=True,
    )  # fmt: skip
    maneuvers: bool = param(
        "Allow flight animations and the magnetometer's calibration, which interrupt the tracker.",
        default=False, read_only=True,
    )  # fmt: skip
    video: Literal["front", "down"] = param(
        "Which camera the drone sends; the sensor `ardrone_camera` receives the video.",
        default="front", read_only=True,
    )  # fmt: skip
    profile: str = param(
        "User name; the drone keeps a configuration for each.",
        default="kybflow", read_only=True,
    )  # fmt: skip
    application: str = param(
        "Application name; the drone keeps a configuration for each.",
        default="kybflow", read_only=True,
    )  # fmt: skip
    latency: Duration = param(
        "Delay until a command arrives on board, which the gains account for; tum_ardrone assumes"
        " 50 ms plus the ping.",
        default=0.06, at_least=0.0, at_most=0.5, read_only=True,
    )  # fmt: skip
    take_off_time: Duration = param(
        "Longest duration of the drone's own take-off.", default=12.0, at_least=3.0, read_only=True
    )


@params
class ArdroneParams(ArdroneLinkParams):
    host: str = param(
        "The drone's IPv4 address: 192.168.1.1 in its own network.",
        default="192.168.1.1", read_only=True,
    )  # fmt: skip


class Limits(NamedTuple):
    """What a full command (a fraction of 1) means. tilt: rad. climb: climb rate, m/s. turn: heading
    rate, rad/s."""

    tilt: float
    climb: float
    turn: float


def limits_of(params: ArdroneLinkParams, airframe: Airframe) -> Limits:
    """Return the limits to configure: the driver's parameters, or the airframe's limits by
    default."""
    p = params
    tilt = airframe.tilt if p.euler_angle_max is None else p.euler_angle_max
    climb = airframe.climb if p.control_vz_max is None else p.control_vz_max
    return Limits(tilt, climb, p.control_yaw)
