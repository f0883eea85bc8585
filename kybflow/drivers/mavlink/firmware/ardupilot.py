"""ArduPilot Copter, as observed in version 4.5.7 with its own simulator."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from kybflow.drivers.mavlink.firmware import (
    DO_GRIPPER,
    DO_SET_RELAY,
    DO_SET_SERVO,
    GRAB,
    OWN,
    RELEASE,
    Danger,
    FirmwareProfile,
    Latency,
    Needed,
    Output,
    PayloadCommand,
    named,
)

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.protocol.framing import Message
    from kybflow.drivers.mavlink.telemetry.received_status import ReceivedStatus

NAMES = MappingProxyType(
    {
        0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL",
        7: "CIRCLE", 9: "LAND", 11: "DRIFT", 13: "SPORT", 14: "FLIP", 15: "AUTOTUNE",
        16: "POSHOLD", 17: "BRAKE", 18: "THROW", 19: "AVOID_ADSB", 20: "GUIDED_NOGPS",
        21: "SMART_RTL",
    }
)  # fmt: skip
HAS_POSITION, GUESSES_POSITION = 16, 128
"""Flags of its estimator: it has an absolute position; it only holds its last position."""
GRIPPER, RELAY, FREE_OUTPUT = 28, -1, 0
"""Functions of an output: the gripper; a relay, which is on or off; none, so that the output can be
commanded freely."""
FIRST_AUXILIARY = 9
"""The number of the first auxiliary output; as a relay it is number 0."""
OPEN_PULSE, CLOSED_PULSE = 1100.0, 1900.0
"""Pulse lengths in microseconds."""
INNOVATION_GATE = 0.6
"""The largest innovation that its estimator accepts, metres: three times 0.2 m, the smallest
standard deviation that the estimator assigns to an external position."""
MIN_SPREAD = 0.02
"""The smallest standard deviation that is reported, metres."""

_CLIMBS = "it would climb and return"
INDOORS = (
    Needed("VISO_TYPE", 1, "takes poses from kybflow", restart=True),
    Needed("EK3_SRC1_POSXY", 6, "its position is the one from kybflow"),
    Needed("EK3_SRC1_VELXY", 0, "no velocity of GPS"),
    Needed("EK3_SRC1_POSZ", 6, "heights are those of kybflow's world"),
    Needed("EK3_SRC1_VELZ", 0, "no velocity of GPS"),
    Needed("EK3_SRC1_YAW", 6, "its heading is the one from kybflow"),
    Needed("GPS_TYPE", 0, "no GPS indoors", restart=True),
    Needed("COMPASS_ENABLE", 0, "no compass near steel and currents", restart=True),
    Needed("FS_THR_ENABLE", 0, "it flies without a transmitter; with one, 3 (land) is as good",
            {3: "it lands when its transmitter is lost"}),
    Needed("FS_GCS_ENABLE", 5, "it lands when our heartbeat stops"),
    Needed("FS_GCS_TIMEOUT", 2.0, "it notices within two seconds that our heartbeat stopped",
            rule="at_most"),
    Needed("SYSID_MYGCS", OWN, "it waits for kybflow's heartbeat"),
    Needed("FS_EKF_ACTION", 1, "it lands when it has lost its position in a mode that needs one",
            {3: "it lands when it has lost its position, in every mode"}),
    Needed("GUID_TIMEOUT", 0.5, "it stops within half a second when accelerations, velocities or"
            " attitudes stop; it holds a position setpoint", rule="at_most"),
    Needed("GUID_OPTIONS", 8, "thrust values are thrusts, not climb rates", rule="bits"),
)  # fmt: skip

RENAMED = MappingProxyType({"GPS_TYPE": "GPS1_TYPE", "SYSID_MYGCS": "MAV_GCS_SYSID"})
"""Parameter names since the versions 4.6 and 4.7."""
_RETRACES, _FALLS = "it would fly back the way it came", "its rotors would stop in the air"
_EARLY_RETURN = MappingProxyType(
    dict.fromkeys((2, 6), f"on a low battery {_CLIMBS}")
    | dict.fromkeys((3, 4), f"on a low battery {_RETRACES}")
)
_EARLY_END = MappingProxyType({5: f"on a low battery {_FALLS}"})
DANGERS = (
    Danger(
        "FS_GCS_ENABLE",
        {0: "without our heartbeat it would hold the last position setpoint for ever"},
        "5 (land)",
    ),
    Danger(
        "FS_GCS_ENABLE",
        dict.fromkeys((1, 2, 6), f"without our heartbeat {_CLIMBS}")
        | dict.fromkeys((3, 4), f"without our heartbeat {_RETRACES}"),
        "5 (land)", indoors=True,
    ),
    Danger(
        "FS_GCS_TIMEOUT", cure="2", above=5.0,
        excess="it would fly on this long without our heartbeat",
    ),
    Danger("SYSID_MYGCS", others="it waits for another program's heartbeat, not for kybflow's"),
    Danger(
        "FS_EKF_ACTION",
        {
            0: "without a position it would fly on",
            2: "without a position it would follow a throttle stick, and fall without one",
        },
        "1 (land)",
    ),
    Danger(
        "GUID_TIMEOUT", cure="0.5", above=3.0,
        excess="it would fly on this long with the last velocity or acceleration",
    ),
    Danger("BATT_FS_LOW_ACT", _EARLY_END, "1 (land)"),
    Danger("BATT_FS_CRT_ACT", _EARLY_END, "1 (land)"),
    Danger("BATT_FS_LOW_ACT", _EARLY_RETURN, "1 (land)", indoors=True),
    Danger("BATT_FS_CRT_ACT", _EARLY_RETURN, "1 (land)", indoors=True),
)  # fmt: skip


def mode_params(custom_mode: int) -> tuple[float, float, float]:
    return (1.0, float(custom_mode), 0.0)


def default_address(system: int) -> str:
    return f"tcp:127.0.0.1:{5760 + 10 * (system - 1)}"


def output(channel: int, _simulator: bool) -> Output:
    number = FIRST_AUXILIARY - 1 + channel
    return Output(number, f"SERVO{number}_FUNCTION")


def grip(channel: int, is_open: bool, function: float | None) -> tuple[PayloadCommand, ...]:
    """Return the commands that open or close an output. A relay is open when it is off. The gripper
    is the first one."""
    servo = PayloadCommand(DO_SET_SERVO, (float(channel), OPEN_PULSE if is_open else CLOSED_PULSE))
    gripper = PayloadCommand(DO_GRIPPER, (1.0, RELEASE if is_open else GRAB))
    if function is None:
        return (servo, gripper)
    if function == RELAY:
        number = float(max(channel - FIRST_AUXILIARY, 0))
        return (PayloadCommand(DO_SET_RELAY, (number, 0.0 if is_open else 1.0), seen=False),)
    if function == GRIPPER:
        return (gripper,)
    return (servo,) if function == FREE_OUTPUT else ()


def ready(status: ReceivedStatus) -> str | None:
    """Return why the vehicle can't be armed yet; None if it can. In STABILIZE ArduPilot reports
    ready without a position, but in GUIDED it doesn't arm without one."""
    if status.mode is None or NAMES.get(status.mode) != "GUIDED":
        return "it reports its readiness only for its current mode, which is not GUIDED yet"
    if status.ekf is None:
        return "it has not reported its estimator"
    if not status.ekf & HAS_POSITION:
        return f"it has no position yet (EKF_STATUS_REPORT flags {status.ekf})"
    if status.ready is None:
        return "it has not reported its health"
    return None if status.ready else "its checks before arming have not passed"


def spread(status: Message) -> float | None:
    """Return an upper bound on the standard deviation of the position, metres, from
    EKF_STATUS_REPORT; None without a position. The "variance" there is the last innovation divided
    by the largest accepted one, so the result is a bound and not an estimate."""
    if not status.flags & HAS_POSITION or status.flags & GUESSES_POSITION:
        return None
    return max(INNOVATION_GATE * float(status.pos_horiz_variance), MIN_SPREAD)


PROFILE = FirmwareProfile(
    mav_autopilot=3, names=NAMES, modes=named(NAMES, offboard="GUIDED", land="LAND", hold="BRAKE"),
    manual_modes=frozenset(
        {
            "STABILIZE", "ACRO", "ALT_HOLD", "LOITER", "POSHOLD", "SPORT", "DRIFT", "FLIP",
            "AUTOTUNE",
        }
    ),
    streams=frozenset(
        {
            "HEARTBEAT", "SYS_STATUS", "EXTENDED_SYS_STATE", "ATTITUDE_QUATERNION",
            "LOCAL_POSITION_NED", "RAW_IMU", "EKF_STATUS_REPORT", "BATTERY_STATUS",
            "SERVO_OUTPUT_RAW", "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED", "RC_CHANNELS",
            "GPS_RAW_INT", "SIM_STATE",
        }
    ),
    polled=frozenset(), indoors=INDOORS, dangers=DANGERS, renamed=RENAMED,
    streams_first=False, climbs=True, needs_descent=False, needs_origin=True, raises=True,
    integer_parameters_bytewise=False, hover_parameter="MOT_THST_HOVER", reaction="FS_GCS_ENABLE",
    feeds=("VISO_TYPE", "EK3_SRC1_POSXY", "EK3_SRC1_POSZ", "EK3_SRC1_YAW"),
    feeds_own=("GPS_TYPE", "EK3_SRC1_POSXY"), latency=Latency(position=0.1, acceleration=0.2),
    attitude_gain=4.5, gyro_filter=20.0,  # ATC_ANG_RLL_P, INS_GYRO_FILTER
    keeps_height=True, takeoff_height=0.5, sphere=6_378_100.0, mode_params=mode_params,
    default_address=default_address, output=output, grip=grip, ready=ready, spread=spread,
    battery_acts_at=2,
)  # fmt: skip
