"""All messages that an emulated autopilot can send, with one function per message.

Each function returns None if the firmware sends nothing, for example without a position. SIM_STATE
and HIL_STATE_QUATERNION carry the ground truth of the firmware's own simulator; the emulated
autopilot itself never reads it."""

from __future__ import annotations

from collections.abc import Callable
from math import degrees, hypot
from typing import Any

from kybflow.core.geometry import conjugate, rotate, to_euler
from kybflow.drivers.emulated_autopilot.autopilot import OnboardAutopilot
from kybflow.drivers.emulated_autopilot.state import Role
from kybflow.drivers.emulation.control import FREE, PositionTarget
from kybflow.drivers.mavlink.protocol.frames import attitude_to_ned, to_frd, to_ned
from kybflow.drivers.mavlink.protocol.framing import mavlink

QUADROTOR = mavlink.MAV_TYPE_QUADROTOR
GYRO, ACCELEROMETER = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO, mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
COMPASS = mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
BAROMETER = mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
GPS, VISION = mavlink.MAV_SYS_STATUS_SENSOR_GPS, mavlink.MAV_SYS_STATUS_SENSOR_VISION_POSITION
AHRS, BATTERY = mavlink.MAV_SYS_STATUS_AHRS, mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
PREARM, MOTORS = mavlink.MAV_SYS_STATUS_PREARM_CHECK, mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
GOOD, NO_POSITION, LOST, PX4_VISION = 831, 167, 37, 303
"""Flags of the estimators."""
NOTHING = 65535


def heartbeat(a: OnboardAutopilot) -> Any:
    s = a.state
    role = s.flying.role
    base = 1 | 128 * s.armed | (64 | 16 if role is Role.PILOT else 16 | 8 | 4)
    idle = a.firmware.idle_status(s, a.now)
    status = (5 if s.failed_over else 4) if s.armed else idle
    return mavlink.MAVLink_heartbeat_message(
        QUADROTOR, a.firmware.profile.mav_autopilot, base, s.mode, status, 3
    )


def sys_status(a: OnboardAutopilot) -> Any:
    s, used = a.state, a.firmware.sources(a.state.parameters)
    present = GYRO | ACCELEROMETER | BAROMETER | AHRS | BATTERY | PREARM | MOTORS
    present |= COMPASS * used.compass | GPS * used.gps | VISION * used.vision
    health = present
    if s.armed or a.firmware.refuses_arming(s, a.now):
        health &= ~PREARM if not s.armed else ~0
    if used.vision and not s.estimator.sees(a.now):
        health &= ~VISION
    if not s.estimator.is_settled(a.now):
        health &= ~AHRS
    return mavlink.MAVLink_sys_status_message(
        present, present, health, 200, round(1000.0 * s.battery.voltage), -1,
        round(100.0 * s.battery.remaining), 0, 0, 0, 0, 0, 0,
    )  # fmt: skip


def extended_sys_state(a: OnboardAutopilot) -> Any:
    return mavlink.MAVLink_extended_sys_state_message(0, a.state.landed.value)


def battery_status(a: OnboardAutopilot) -> Any:
    voltages = [round(1000.0 * a.state.battery.voltage)] + [NOTHING] * 9
    remaining = round(100.0 * a.state.battery.remaining)
    return mavlink.MAVLink_battery_status_message(
        0, 0, 1, 32767, voltages, -1, -1, -1, remaining, 0, 1
    )


def current_mode(a: OnboardAutopilot) -> Any:
    return mavlink.MAVLink_current_mode_message(0, a.state.mode, a.state.asked)


def attitude_target(a: OnboardAutopilot) -> Any:
    command = a.commanded
    if command is None:
        return None
    return mavlink.MAVLink_attitude_target_message(
        a.boot_ms(a.now), 0, attitude_to_ned(command.attitude), *to_frd(command.rates), a.throttle
    )


def position_target_local_ned(a: OnboardAutopilot) -> Any:
    """Return the target that the vehicle follows; the mask marks the fields that the target
    lacks."""
    wanted = a.state.wanted
    if not isinstance(wanted, PositionTarget) or a.state.flying.role is not Role.FOLLOW:
        return None
    mask = 0xE00
    values: list[float] = []
    for ignored, axes in zip((0x007, 0x038, 0x1C0), wanted[:3], strict=True):
        mask |= ignored if axes == FREE else 0
        x, y, z = axes
        values += to_ned((x or 0.0, y or 0.0, z or 0.0))
    return mavlink.MAVLink_position_target_local_ned_message(
        a.boot_ms(a.now), 1, mask, *values, 0.0, 0.0
    )


def servo_output_raw(a: OnboardAutopilot) -> Any:
    motor = 1000 + round(1000.0 * a.throttle) if a.state.armed else 1000
    pulses = [a.outputs.pulses.get(c, motor if c <= 4 else 0) for c in range(1, 17)]
    return mavlink.MAVLink_servo_output_raw_message(
        a.boot_us(a.now) & 0xFFFFFFFF, 0, *pulses[:8], *pulses[8:]
    )


def ekf_status_report(a: OnboardAutopilot) -> Any:
    unseen = a.state.estimator.unseen(a.now)
    flags = NO_POSITION if unseen is None or a.state.origin is None else GOOD
    if unseen is not None and not a.state.estimator.has_position(a.now):
        flags = LOST if a.state.armed else NO_POSITION
    found = a.state.estimator.innovations
    far = 0.05 if unseen is None else max(found.position, min(1.0, 0.05 + 0.1 * unseen))
    return mavlink.MAVLink_ekf_status_report_message(
        flags, 0.0, far, found.height, found.heading, 0.0, 0.0
    )


def estimator_status(a: OnboardAutopilot) -> Any:
    e, held = a.state.estimator, a.state.estimator.has_position(a.now)
    flags = (GOOD if a.state.origin is not None else PX4_VISION) if held else LOST
    found = e.innovations
    return mavlink.MAVLink_estimator_status_message(
        a.boot_us(a.now), flags, 0.0, found.position, found.height, found.heading, 0.0, 0.0,
        spread(a) if e.imu else 1e3, 0.1,
    )  # fmt: skip


def rc_channels(a: OnboardAutopilot) -> Any:
    sticks = a.state.sticks
    if sticks is None or not a.state.has_pilot(a.now):
        return mavlink.MAVLink_rc_channels_message(a.boot_ms(a.now), 0, *[NOTHING] * 18, 255)
    pulses = [
        1500 + round(500.0 * sticks.roll), 1500 - round(500.0 * sticks.pitch),
        1000 + round(1000.0 * sticks.throttle), 1500 + round(500.0 * sticks.yaw),
        *[1500] * 4, *[NOTHING] * 10,
    ]  # fmt: skip
    return mavlink.MAVLink_rc_channels_message(a.boot_ms(a.now), 8, *pulses, 200)


def system_time(a: OnboardAutopilot) -> Any:
    return mavlink.MAVLink_system_time_message(0, a.boot_ms(a.now))


def autopilot_version(a: OnboardAutopilot) -> Any:
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    )
    major, minor, patch = a.firmware.version
    version = major << 24 | minor << 16 | patch << 8 | 255
    name = list(a.firmware.name.encode()[:8].ljust(8, b"\0"))
    return mavlink.MAVLink_autopilot_version_message(
        capabilities, version, 0, 0, 0, name, name, name, 0, 0, a.system, [0] * 18
    )


def spread(a: OnboardAutopilot) -> float:
    """Return the reported standard deviation of the position, metres."""
    unseen = a.state.estimator.unseen(a.now)
    least = 0.05 if a.state.estimator.sees(a.now) else 0.5
    return 1e3 if unseen is None else least + 0.5 * max(0.0, unseen - 0.3)


def local_position_ned(a: OnboardAutopilot) -> Any:
    if not _tells_position(a):
        return None
    e = a.state.estimator
    return mavlink.MAVLink_local_position_ned_message(
        a.boot_ms(a.now), *to_ned(e.position), *to_ned(e.velocity)
    )


def odometry(a: OnboardAutopilot) -> Any:
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


def attitude(a: OnboardAutopilot) -> Any:
    e = a.state.estimator.attitude
    return mavlink.MAVLink_attitude_message(
        a.boot_ms(a.now), *to_euler(attitude_to_ned(e.value)), *to_frd(e.rate)
    )


def attitude_quaternion(a: OnboardAutopilot) -> Any:
    e = a.state.estimator.attitude
    return mavlink.MAVLink_attitude_quaternion_message(
        a.boot_ms(a.now), *attitude_to_ned(e.value), *to_frd(e.rate), [0.0] * 4
    )


def highres_imu(a: OnboardAutopilot) -> Any:
    imu = a.state.estimator.imu
    if imu is None:
        return None
    return mavlink.MAVLink_highres_imu_message(
        a.boot_us(imu.time), *to_frd(imu.specific_force), *to_frd(imu.angular_velocity),
        0.2, 0.0, 0.4, 960.0, 0.0, a.height, 25.0, 0x3F,
    )  # fmt: skip


def raw_imu(a: OnboardAutopilot) -> Any:
    imu = a.state.estimator.imu
    if imu is None:
        return None
    force = [_saturated(v * 1000.0 / 9.80665) for v in to_frd(imu.specific_force)]
    turn = [_saturated(v * 1000.0) for v in to_frd(imu.angular_velocity)]
    return mavlink.MAVLink_raw_imu_message(a.boot_us(imu.time), *force, *turn, 0, 0, 0)


def _saturated(value: float) -> int:
    """Round a value and limit it to a signed 16-bit integer; collisions exceed that range."""
    return max(-32768, min(32767, round(value)))


def global_position_int(a: OnboardAutopilot) -> Any:
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


def gps_raw_int(a: OnboardAutopilot) -> Any:
    if not a.firmware.sources(a.state.parameters).gps:
        return None
    fix, origin = a.fix, a.origin
    latitude, longitude, height = origin.place(fix or (0.0, 0.0, 0.0))
    kind, satellites = (3, 12) if fix is not None else (1, 0)
    return mavlink.MAVLink_gps_raw_int_message(
        a.boot_us(a.now), kind, round(latitude * 1e7), round(longitude * 1e7), round(height * 1e3),
        70, 90, 0, NOTHING, satellites, round(height * 1e3), 500, 700, 100,
    )  # fmt: skip


def home_position(a: OnboardAutopilot) -> Any:
    home, origin = a.state.home, a.state.origin
    if home is None or origin is None:
        return None
    latitude, longitude, height = origin.place(home)
    return mavlink.MAVLink_home_position_message(
        round(latitude * 1e7), round(longitude * 1e7), round(height * 1e3), *to_ned(home),
        [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, a.boot_us(a.now),
    )  # fmt: skip


def gps_global_origin(a: OnboardAutopilot) -> Any:
    origin = a.state.origin
    if origin is None:
        return None
    return mavlink.MAVLink_gps_global_origin_message(
        round(origin.latitude * 1e7), round(origin.longitude * 1e7), round(origin.height * 1e3),
        a.boot_us(a.now),
    )  # fmt: skip


def vfr_hud(a: OnboardAutopilot) -> Any:
    x, y, up = a.state.estimator.velocity
    speed = hypot(x, y)
    return mavlink.MAVLink_vfr_hud_message(
        speed, speed, round(_course(a)) % 360, round(100.0 * a.throttle),
        a.state.estimator.position[2], up,
    )  # fmt: skip


def altitude(a: OnboardAutopilot) -> Any:
    height = a.state.estimator.position[2]
    sea = height + a.origin.height
    above = height - (a.state.home or (0.0, 0.0, 0.0))[2]
    return mavlink.MAVLink_altitude_message(a.boot_us(a.now), sea, sea, height, above, above, above)


def _tells_position(a: OnboardAutopilot) -> bool:
    return a.firmware.tells_position(a.state, a.now)


def _course(a: OnboardAutopilot) -> float:
    """Return the vehicle's heading, degrees clockwise from north."""
    return degrees(to_euler(attitude_to_ned(a.state.estimator.attitude.value))[2]) % 360.0


def sim_state(a: OnboardAutopilot) -> Any:
    """Return the ground truth, as ArduPilot's simulator sends it."""
    truth = a.look()
    latitude, longitude, height = a.origin.place(truth.position)
    q = attitude_to_ned(truth.attitude)
    return mavlink.MAVLink_sim_state_message(
        *q, *to_euler(q), 0.0, 0.0, -9.81, *to_frd(truth.angular_velocity), latitude, longitude,
        height, 0.1, 0.1, *to_ned(truth.velocity), round(latitude * 1e7), round(longitude * 1e7),
    )  # fmt: skip


def hil_state_quaternion(a: OnboardAutopilot) -> Any:
    """Return the ground truth, as PX4's simulator sends it; its time stamp is 0."""
    truth = a.look()
    latitude, longitude, height = a.origin.place(truth.position)
    speed = [round(100.0 * v) for v in to_ned(truth.velocity)]
    return mavlink.MAVLink_hil_state_quaternion_message(
        0, attitude_to_ned(truth.attitude), *to_frd(truth.angular_velocity),
        round(latitude * 1e7), round(longitude * 1e7), round(height * 1e3), *speed, 0, 0, 0, 0, 0,
    )  # fmt: skip


Maker = Callable[[OnboardAutopilot], Any]
_MAKERS: tuple[Maker, ...] = (
    heartbeat, sys_status, extended_sys_state, battery_status, current_mode, attitude_target,
    position_target_local_ned, servo_output_raw, ekf_status_report, estimator_status, rc_channels,
    system_time, autopilot_version, local_position_ned, odometry, attitude, attitude_quaternion,
    highres_imu, raw_imu, global_position_int, gps_raw_int, home_position, gps_global_origin,
    vfr_hud, altitude, sim_state, hil_state_quaternion,
)  # fmt: skip
MAKERS: dict[str, Maker] = {maker.__name__.upper(): maker for maker in _MAKERS}
"""The function that makes each message, by the message's name."""
