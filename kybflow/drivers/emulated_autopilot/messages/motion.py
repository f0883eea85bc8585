"""What an emulated autopilot tells of where it is and how it moves: a function for each message, by
its name. Each gives None where the firmware sends nothing: where there is no position, say."""

from __future__ import annotations

from math import degrees, hypot
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.geometry import conjugate, rotate, to_euler
from kybflow.drivers.emulated_autopilot.estimation.estimator import sources
from kybflow.drivers.emulated_autopilot.messages.status import NOTHING, spread
from kybflow.drivers.mavlink.protocol.frames import attitude_to_ned, to_frd, to_ned

if TYPE_CHECKING:
    from kybflow.drivers.emulated_autopilot.autopilot import Autopilot


def local_position_ned(a: Autopilot) -> Any:
    if not _tells_position(a):
        return None
    e = a.state.estimator
    return mavlink.MAVLink_local_position_ned_message(
        a.boot_ms(a.now), *to_ned(e.position), *to_ned(e.velocity)
    )


def odometry(a: Autopilot) -> Any:
    if not _tells_position(a):
        return None
    e = a.state.estimator
    turn = attitude_to_ned(e.attitude.value)
    speed = to_frd(rotate(conjugate(e.attitude.value), e.velocity))
    covariance = [0.0] * 21
    covariance[0] = covariance[6] = covariance[11] = spread(a) ** 2
    return mavlink.MAVLink_odometry_message(
        a.boot_us(a.now), 1, 12, *to_ned(e.position), turn, *speed, *to_frd(e.attitude.rate),
        covariance, covariance, 0, 5, 100,
    )  # fmt: skip


def attitude(a: Autopilot) -> Any:
    e = a.state.estimator.attitude
    return mavlink.MAVLink_attitude_message(
        a.boot_ms(a.now), *to_euler(attitude_to_ned(e.value)), *to_frd(e.rate)
    )


def attitude_quaternion(a: Autopilot) -> Any:
    e = a.state.estimator.attitude
    return mavlink.MAVLink_attitude_quaternion_message(
        a.boot_ms(a.now), *attitude_to_ned(e.value), *to_frd(e.rate), [0.0] * 4
    )


def highres_imu(a: Autopilot) -> Any:
    imu = a.state.estimator.imu
    if imu is None:
        return None
    return mavlink.MAVLink_highres_imu_message(
        a.boot_us(imu.time), *to_frd(imu.specific_force), *to_frd(imu.angular_velocity),
        0.2, 0.0, 0.4, 960.0, 0.0, a.height, 25.0, 0x3F,
    )  # fmt: skip


def raw_imu(a: Autopilot) -> Any:
    imu = a.state.estimator.imu
    if imu is None:
        return None
    force = [round(v * 1000.0 / 9.80665) for v in to_frd(imu.specific_force)]
    turn = [round(v * 1000.0) for v in to_frd(imu.angular_velocity)]
    return mavlink.MAVLink_raw_imu_message(a.boot_us(imu.time), *force, *turn, 0, 0, 0)


def global_position_int(a: Autopilot) -> Any:
    e, origin = a.state.estimator, a.state.origin
    if origin is None or not _tells_position(a):
        return None
    latitude, longitude, height = origin.place(e.position)
    above = e.position[2] - (a.state.home or e.position)[2]
    north, east, down = (round(100.0 * v) for v in to_ned(e.velocity))
    return mavlink.MAVLink_global_position_int_message(
        a.boot_ms(a.now), round(latitude * 1e7), round(longitude * 1e7), round(height * 1e3),
        round(above * 1e3), north, east, down, round(100.0 * _course(a)) % 36000,
    )  # fmt: skip


def gps_raw_int(a: Autopilot) -> Any:
    if not sources(a.state.parameters).gps:
        return None
    fix, origin = a.fix, a.origin
    latitude, longitude, height = origin.place(fix or (0.0, 0.0, 0.0))
    kind, satellites = (3, 12) if fix is not None else (1, 0)
    return mavlink.MAVLink_gps_raw_int_message(
        a.boot_us(a.now), kind, round(latitude * 1e7), round(longitude * 1e7), round(height * 1e3),
        70, 90, 0, NOTHING, satellites, round(height * 1e3), 500, 700, 100,
    )  # fmt: skip


def home_position(a: Autopilot) -> Any:
    home, origin = a.state.home, a.state.origin
    if home is None or origin is None:
        return None
    latitude, longitude, height = origin.place(home)
    return mavlink.MAVLink_home_position_message(
        round(latitude * 1e7), round(longitude * 1e7), round(height * 1e3), *to_ned(home),
        [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, a.boot_us(a.now),
    )  # fmt: skip


def gps_global_origin(a: Autopilot) -> Any:
    origin = a.state.origin
    if origin is None:
        return None
    return mavlink.MAVLink_gps_global_origin_message(
        round(origin.latitude * 1e7), round(origin.longitude * 1e7), round(origin.height * 1e3),
        a.boot_us(a.now),
    )  # fmt: skip


def vfr_hud(a: Autopilot) -> Any:
    x, y, up = a.state.estimator.velocity
    speed = hypot(x, y)
    return mavlink.MAVLink_vfr_hud_message(
        speed, speed, round(_course(a)) % 360, round(100.0 * a.throttle),
        a.state.estimator.position[2], up,
    )  # fmt: skip


def altitude(a: Autopilot) -> Any:
    height = a.state.estimator.position[2]
    sea = height + a.origin.height
    above = height - (a.state.home or (0.0, 0.0, 0.0))[2]
    return mavlink.MAVLink_altitude_message(a.boot_us(a.now), sea, sea, height, above, above, above)


def _tells_position(a: Autopilot) -> bool:
    e = a.state.estimator
    if a.state.firmware.name == "px4":
        return e.has_position(a.now)
    return e.unseen(a.now) is not None and a.state.origin is not None


def _course(a: Autopilot) -> float:
    """The nose, degrees clockwise from north."""
    return degrees(to_euler(attitude_to_ned(a.state.estimator.attitude.value))[2]) % 360.0
