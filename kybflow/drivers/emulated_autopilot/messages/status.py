"""What an emulated autopilot tells of its state: a function for each message, by its name.

Each gives None where the firmware sends nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import all as mavlink

from kybflow.drivers.emulated_autopilot.control.arming import has_pilot, refusal
from kybflow.drivers.emulated_autopilot.estimation.estimator import sources
from kybflow.drivers.emulated_autopilot.firmware.firmware import Role
from kybflow.drivers.mavlink.protocol.frames import attitude_to_ned, to_frd

if TYPE_CHECKING:
    from kybflow.drivers.emulated_autopilot.autopilot import Autopilot

QUADROTOR = 2
GYRO, ACCELEROMETER, COMPASS, BAROMETER, GPS, VISION = 1, 2, 4, 8, 0x20, 0x80
AHRS, BATTERY, PREARM, MOTORS = 0x20_0000, 0x200_0000, 0x1000_0000, 0x8000
GOOD, NO_POSITION, LOST, PX4_VISION = 831, 167, 37, 303
"""Flags of the estimators."""
NOTHING = 65535


def heartbeat(a: Autopilot) -> Any:
    s = a.state
    role = s.flying.role
    base = 1 | 128 * s.armed | (64 | 16 if role is Role.PILOT else 16 | 8 | 4)
    if s.firmware.name == "px4":
        idle = 0 if refusal(s, a.now) else 3
    else:
        idle = 3 if s.estimator.is_settled(a.now) else 1
    status = (5 if s.failed_over else 4) if s.armed else idle
    return mavlink.MAVLink_heartbeat_message(
        QUADROTOR, s.firmware.autopilot, base, s.mode, status, 3
    )


def sys_status(a: Autopilot) -> Any:
    s, heeded = a.state, sources(a.state.parameters)
    present = GYRO | ACCELEROMETER | BAROMETER | AHRS | BATTERY | PREARM | MOTORS
    present |= COMPASS * heeded.compass | GPS * heeded.gps | VISION * heeded.vision
    health = present
    if s.armed or refusal(s, a.now):
        health &= ~PREARM if not s.armed else ~0
    if heeded.vision and not s.estimator.sees(a.now):
        health &= ~VISION
    if not s.estimator.is_settled(a.now):
        health &= ~AHRS
    return mavlink.MAVLink_sys_status_message(
        present, present, health, 200, round(1000.0 * s.voltage), -1, round(100.0 * s.remaining),
        0, 0, 0, 0, 0, 0,
    )  # fmt: skip


def extended_sys_state(a: Autopilot) -> Any:
    return mavlink.MAVLink_extended_sys_state_message(0, int(a.state.landed))


def battery_status(a: Autopilot) -> Any:
    voltages = [round(1000.0 * a.state.voltage)] + [NOTHING] * 9
    remaining = round(100.0 * a.state.remaining)
    return mavlink.MAVLink_battery_status_message(
        0, 0, 1, 32767, voltages, -1, -1, -1, remaining, 0, 1
    )


def current_mode(a: Autopilot) -> Any:
    return mavlink.MAVLink_current_mode_message(0, a.state.mode, a.state.asked)


def attitude_target(a: Autopilot) -> Any:
    command = a.commanded
    if command is None:
        return None
    return mavlink.MAVLink_attitude_target_message(
        a.boot_ms(a.now), 0, attitude_to_ned(command.attitude), *to_frd(command.rates), a.throttle
    )


def servo_output_raw(a: Autopilot) -> Any:
    motor = 1000 + round(1000.0 * a.throttle) if a.state.armed else 1000
    pulses = [a.outputs.pulses.get(c, motor if c <= 4 else 0) for c in range(1, 17)]
    return mavlink.MAVLink_servo_output_raw_message(
        a.boot_us(a.now) & 0xFFFFFFFF, 0, *pulses[:8], *pulses[8:]
    )


def ekf_status_report(a: Autopilot) -> Any:
    unseen = a.state.estimator.unseen(a.now)
    flags = NO_POSITION if unseen is None or a.state.origin is None else GOOD
    if unseen is not None and not a.state.estimator.has_position(a.now):
        flags = LOST if a.state.armed else NO_POSITION
    far = 0.05 if unseen is None else min(1.0, 0.05 + 0.1 * unseen)
    return mavlink.MAVLink_ekf_status_report_message(flags, 0.05, far, 0.05, 0.05, 0.0, 0.0)


def estimator_status(a: Autopilot) -> Any:
    e, held = a.state.estimator, a.state.estimator.has_position(a.now)
    flags = (GOOD if a.state.origin is not None else PX4_VISION) if held else LOST
    return mavlink.MAVLink_estimator_status_message(
        a.boot_us(a.now), flags, 0.1, 0.1, 0.1, 0.1, 0.1, 0.0, spread(a) if e.imu else 1e3, 0.1
    )


def rc_channels(a: Autopilot) -> Any:
    sticks = a.state.sticks
    if sticks is None or not has_pilot(a.state, a.now):
        return mavlink.MAVLink_rc_channels_message(a.boot_ms(a.now), 0, *[NOTHING] * 18, 255)
    pulses = [
        1500 + round(500.0 * sticks.roll), 1500 - round(500.0 * sticks.pitch),
        1000 + round(1000.0 * sticks.throttle), 1500 + round(500.0 * sticks.yaw),
        *[1500] * 4, *[NOTHING] * 10,
    ]  # fmt: skip
    return mavlink.MAVLink_rc_channels_message(a.boot_ms(a.now), 8, *pulses, 200)


def system_time(a: Autopilot) -> Any:
    return mavlink.MAVLink_system_time_message(0, a.boot_ms(a.now))


def autopilot_version(a: Autopilot) -> Any:
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    )
    major, minor, patch = a.state.firmware.version
    version = major << 24 | minor << 16 | patch << 8 | 255
    name = list(a.state.firmware.name.encode()[:8].ljust(8, b"\0"))
    return mavlink.MAVLink_autopilot_version_message(
        capabilities, version, 0, 0, 0, name, name, name, 0, 0, a.system, [0] * 18
    )


def spread(a: Autopilot) -> float:
    """What it believes the standard deviation of its position to be, metres."""
    unseen = a.state.estimator.unseen(a.now)
    least = 0.05 if a.state.estimator.sees(a.now) else 0.5
    return 1e3 if unseen is None else least + 0.5 * max(0.0, unseen - 0.3)
