"""The ground truth that a firmware's own simulator tells: SIM_STATE and HIL_STATE_QUATERNION. It
belongs to the simulator; the emulated autopilot never asks for it."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.geometry import to_euler
from kybflow.core.signals import Truth
from kybflow.drivers.mavlink.protocol.frames import Tangent, attitude_to_ned, to_frd, to_ned


def sim_state(truth: Truth, origin: Tangent) -> Any:
    """As ArduPilot's simulator tells it."""
    latitude, longitude, height = origin.place(truth.position)
    q = attitude_to_ned(truth.attitude)
    return mavlink.MAVLink_sim_state_message(
        *q, *to_euler(q), 0.0, 0.0, -9.81, *to_frd(truth.angular_velocity), latitude, longitude,
        height, 0.1, 0.1, *to_ned(truth.velocity), round(latitude * 1e7), round(longitude * 1e7),
    )  # fmt: skip


def hil_state(truth: Truth, origin: Tangent) -> Any:
    """As PX4's simulator tells it; its time is 0."""
    latitude, longitude, height = origin.place(truth.position)
    speed = [round(100.0 * v) for v in to_ned(truth.velocity)]
    return mavlink.MAVLink_hil_state_quaternion_message(
        0, attitude_to_ned(truth.attitude), *to_frd(truth.angular_velocity),
        round(latitude * 1e7), round(longitude * 1e7), round(height * 1e3), *speed, 0, 0, 0, 0, 0,
    )  # fmt: skip
