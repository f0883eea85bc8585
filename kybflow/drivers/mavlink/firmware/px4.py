"""PX4, as observed in version 1.18 with its simulator SIH."""

from __future__ import annotations

from math import isfinite
from types import MappingProxyType
from typing import TYPE_CHECKING

from kybflow.drivers.mavlink.firmware import (
    DO_GRIPPER,
    DO_SET_ACTUATOR,
    GRAB,
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

AUTO = 4
NAMES = MappingProxyType(
    {
        main << 16 | sub << 24: name
        for main, sub, name in (
            (1, 0, "MANUAL"), (2, 0, "ALTITUDE"), (3, 0, "POSITION"), (5, 0, "ACRO"),
            (6, 0, "OFFBOARD"), (7, 0, "STABILIZED"), (AUTO, 2, "TAKEOFF"), (AUTO, 3, "HOLD"),
            (AUTO, 4, "MISSION"), (AUTO, 5, "RETURN"), (AUTO, 6, "LAND"), (AUTO, 8, "FOLLOW"),
            (AUTO, 9, "PRECISION_LAND"),
        )
    }
)  # fmt: skip
HAS_POSITION = 8 | 16
"""Flags of its estimator: it has a horizontal position, relative or absolute."""
MOTORS = 4
GRIPPER, FIRST_SET, SETS = 430, 301, 6
"""Functions of an output: the gripper, the first of the actuator sets, and the number of those
sets."""

INDOORS = (
    Needed("EKF2_EV_CTRL", 15, "takes position, height, velocity and heading from kybflow"),
    Needed("EKF2_EVP_NOISE", 0.01, "standard deviation of a position", rule="at_most"),
    Needed("EKF2_EVV_NOISE", 0.05, "standard deviation of a velocity", rule="at_most"),
    Needed("EKF2_EVA_NOISE", 0.03, "standard deviation of a heading", rule="at_most"),
    Needed("EKF2_HGT_REF", 3, "heights are those of kybflow's world", restart=True),
    Needed("EKF2_GPS_CTRL", 0, "no GPS indoors"),
    Needed("EKF2_MAG_TYPE", 5, "no compass near steel and currents", restart=True),
    Needed("EKF2_RNG_CTRL", 0, "a range finder would shift the height by 0.3 m"),
    Needed("EKF2_BARO_CTRL", 1, "without vision the barometer must still detect a landing"),
    Needed("SYS_HAS_GPS", 0, "it would not arm without one", restart=True),
    Needed("SYS_HAS_MAG", 0, "it would not arm without one", restart=True),
    Needed("COM_ARM_WO_GPS", 1, "it may be armed without GPS, and warns",
            {2: "it may be armed without GPS, without a warning"}),
    Needed("COM_OBL_RC_ACT", 4, "it lands when setpoints stop",
            {5: "it holds where it is when setpoints stop, and lands when it has no position"}),
    Needed("COM_OF_LOSS_T", 0.5, "it stops using the last setpoint within half a second",
            rule="at_most"),
    Needed("COM_RCL_EXCEPT", 4, "it follows setpoints without a transmitter", rule="bits"),
    Needed("NAV_RCL_ACT", 3, "it lands when a transmitter is lost in another mode",
            {1: "it holds where it is when a transmitter is lost in another mode"}),
    Needed("COM_LOW_BAT_ACT", 2, "it lands where it is on a critical battery",
            {0: "it only warns of a critical battery: only kybflow lands it"}),
    Needed("EKF2_ACC_NOISE", 1.0, "noise of the simulated accelerometer", simulator_only=True),
    Needed("EKF2_GYR_NOISE", 0.03, "noise of the simulated gyroscope", simulator_only=True),
    Needed("SIH_KDV", 0.25, "drag of the airframes in kybflow's library, a quarter of the default",
            simulator_only=True),
    Needed("EKF2_TAU_POS", 0.1, "its output follows the poses sooner", simulator_only=True),
    Needed("EKF2_TAU_VEL", 0.1, "its velocity follows them sooner", simulator_only=True),
    Needed("SENS_EN_GPSSIM", 0, "no GPS in the simulator either",
            simulator_only=True, restart=True),
    Needed("SENS_EN_MAGSIM", 0, "no compass in the simulator either",
            simulator_only=True, restart=True),
)  # fmt: skip

_CLIMBS, _FALLS = "it would climb and return", "its rotors would stop in the air"
_GIVEN_UP = {
    value: f"without setpoints it would change to {mode}, and without a transmitter climb and"
    " return"
    for value, mode in ((0, "POSITION"), (1, "ALTITUDE"), (2, "STABILIZED"))
}
_NO_HEARTBEAT = "3 (land), or 0 (nothing; the loss of setpoints then acts)"
DANGERS = (
    Danger(
        "COM_OBL_RC_ACT",
        _GIVEN_UP | dict.fromkeys((6, 7), f"without setpoints {_FALLS}"),
        "4 (land)",
    ),
    Danger("COM_OBL_RC_ACT", {3: f"without setpoints {_CLIMBS}"}, "4 (land)", indoors=True),
    Danger(
        "COM_OF_LOSS_T", cure="0.5", above=1.0,
        excess="it would fly on this long without setpoints",
    ),
    Danger("NAV_DLL_ACT", dict.fromkeys((5, 6), f"without our heartbeat {_FALLS}"), _NO_HEARTBEAT),
    Danger("NAV_DLL_ACT", {2: f"without our heartbeat {_CLIMBS}"}, _NO_HEARTBEAT, indoors=True),
    Danger(
        "COM_LOW_BAT_ACT", dict.fromkeys((1, 3), f"on a critical battery {_CLIMBS}"), "2 (land)",
        indoors=True,
    ),
)  # fmt: skip


def mode_params(custom_mode: int) -> tuple[float, float, float]:
    return (1.0, float(custom_mode >> 16 & 0xFF), float(custom_mode >> 24 & 0xFF))


def default_address(system: int) -> str:
    return f"udpin:127.0.0.1:{14540 + system - 1}"


def output(channel: int, simulator: bool) -> Output:
    """Return the payload's output. The simulator has main outputs only, the first four of which
    drive the motors."""
    if simulator:
        return Output(MOTORS + channel, f"PWM_MAIN_FUNC{MOTORS + channel}")
    return Output(channel, f"PWM_AUX_FUNC{channel}", shown=False)


def grip(_channel: int, is_open: bool, function: float | None) -> tuple[PayloadCommand, ...]:
    """Return the commands that open or close the payload. PX4's acknowledgement proves nothing;
    only the pulses do."""
    gripper = PayloadCommand(DO_GRIPPER, (1.0, RELEASE if is_open else GRAB))
    if function == GRIPPER:
        return (gripper,)
    if function is None:
        return (gripper, _actuator(1, is_open))
    number = int(function) - FIRST_SET + 1 if isfinite(function) else 0
    return (_actuator(number, is_open),) if 1 <= number <= SETS else ()


def ready(status: ReceivedStatus) -> str | None:
    if status.mode is None or NAMES.get(status.mode) != "OFFBOARD":
        return "it reports its readiness only for its current mode, which is not OFFBOARD yet"
    if status.ready:
        return None
    if status.ekf is not None and not status.ekf & HAS_POSITION:
        return f"it has no position yet (ESTIMATOR_STATUS flags {status.ekf})"
    return (
        "it reports that it is not ready to arm"
        if status.ready is False
        else "it has not reported its health"
    )


def spread(status: Message) -> float | None:
    """Return the standard deviation of the position from ESTIMATOR_STATUS, metres; None without a
    position."""
    return float(status.pos_horiz_accuracy) if status.flags & HAS_POSITION else None


def _actuator(number: int, is_open: bool) -> PayloadCommand:
    """Return the command that sets one of the six actuators, -1 to open and 1 to close. NaN leaves
    the others unchanged."""
    values = [float("nan")] * SETS
    values[number - 1] = -1.0 if is_open else 1.0
    return PayloadCommand(DO_SET_ACTUATOR, (*values, 0.0))


PROFILE = FirmwareProfile(
    mav_autopilot=12, names=NAMES,
    modes=named(NAMES, offboard="OFFBOARD", land="LAND", hold="HOLD"),
    manual_modes=frozenset({"MANUAL", "ALTITUDE", "POSITION", "ACRO", "STABILIZED"}),
    streams=frozenset(
        {
            "HEARTBEAT", "CURRENT_MODE", "SYS_STATUS", "EXTENDED_SYS_STATE", "ATTITUDE_QUATERNION",
            "LOCAL_POSITION_NED", "HIGHRES_IMU", "ESTIMATOR_STATUS", "BATTERY_STATUS",
            "SERVO_OUTPUT_RAW", "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED", "RC_CHANNELS",
            "GPS_RAW_INT", "HIL_STATE_QUATERNION",
        }
    ),
    polled=frozenset({"HEARTBEAT"}),
    indoors=INDOORS,
    dangers=DANGERS, renamed=MappingProxyType({}),
    streams_first=True, climbs=False, needs_descent=True, needs_origin=False, raises=False,
    integer_parameters_bytewise=True, hover_parameter="MPC_THR_HOVER", reaction="COM_OBL_RC_ACT",
    feeds=("EKF2_EV_CTRL", "EKF2_HGT_REF"), feeds_own=("EKF2_GPS_CTRL",),
    latency=Latency(position=0.12, acceleration=0.2), keeps_height=False, takeoff_height=0.5,
    attitude_gain=6.5, gyro_filter=40.0,  # MC_ROLL_P, IMU_GYRO_CUTOFF
    sphere=None,
    mode_params=mode_params, default_address=default_address, output=output, grip=grip, ready=ready,
    spread=spread, battery_acts_at=3,
)  # fmt: skip
