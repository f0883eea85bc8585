"""Every message that an emulated autopilot can tell, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from kybflow.drivers.emulated_autopilot.messages import motion, status
from kybflow.drivers.emulated_autopilot.messages.simulator import hil_state, sim_state

if TYPE_CHECKING:
    from kybflow.drivers.emulated_autopilot.autopilot import Autopilot

Maker = Callable[["Autopilot"], Any]
MAKERS: dict[str, Maker] = {
    maker.__name__.upper(): maker
    for maker in (
        status.heartbeat,
        status.sys_status,
        status.extended_sys_state,
        status.battery_status,
        status.current_mode,
        status.attitude_target,
        status.servo_output_raw,
        status.ekf_status_report,
        status.estimator_status,
        status.rc_channels,
        status.system_time,
        status.autopilot_version,
        motion.local_position_ned,
        motion.odometry,
        motion.attitude,
        motion.attitude_quaternion,
        motion.highres_imu,
        motion.raw_imu,
        motion.global_position_int,
        motion.gps_raw_int,
        motion.home_position,
        motion.gps_global_origin,
        motion.vfr_hud,
        motion.altitude,
    )
} | {
    "SIM_STATE": lambda a: sim_state(a.look(), a.origin),
    "HIL_STATE_QUATERNION": lambda a: hil_state(a.look(), a.origin),
}
"""Those of the last two are the simulator's own."""
