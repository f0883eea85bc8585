"""PX4 1.18 as observed: modes, parameters, streams, arming checks, failsafes."""

from __future__ import annotations

from math import tan

from kybflow.core.geometry import tilt_of
from kybflow.core.signals import NS, Time
from kybflow.core.units import DEG
from kybflow.drivers.emulated_autopilot.estimator import Sources
from kybflow.drivers.emulated_autopilot.firmware import EmulatedFirmware, by_number
from kybflow.drivers.emulated_autopilot.setpoints import AttitudeTarget
from kybflow.drivers.emulated_autopilot.state import (
    ACCEPTED,
    DENIED,
    FAILED,
    PILOT_LOST,
    UNSUPPORTED,
    EmulatedParameters,
    EmulatedState,
    FailsafeAction,
    FlightMode,
    Outputs,
    Role,
)
from kybflow.drivers.emulation.control import Speeds
from kybflow.drivers.mavlink.protocol.frames import Tangent
from kybflow.drivers.mavlink.protocol.framing import mavlink

TEMPORARILY_REJECTED: int = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
VISION, VISION_HEIGHT, VISION_HEADING = 1, 2, 8
"""Bits of EKF2_EV_CTRL."""
GRIPPER, FIRST_SET, SETS = 430, 301, 6
"""Functions of an output: the gripper, the first of the actuator sets, and the number of those
sets."""
MOST_TILT = 20.0 * DEG
"""The largest tilt at which it arms, radians."""


def number(main: int, sub: int = 0) -> int:
    """Return the custom_mode of a main and a sub mode."""
    return main << 16 | sub << 24


OFFBOARD, TAKE_OFF, HOLD, MISSION, RETURN, LAND = (
    number(6), number(4, 2), number(4, 3), number(4, 4), number(4, 5), number(4, 6),
)  # fmt: skip


def mode_number(p: tuple[float, ...]) -> int:
    return number(int(p[1]), int(p[2]))


def sources(p: EmulatedParameters) -> Sources:
    bits = int(p["EKF2_EV_CTRL"])
    gps = int(p["EKF2_GPS_CTRL"]) & 1 and p["SYS_HAS_GPS"]
    compass = p["SYS_HAS_MAG"] and p["EKF2_MAG_TYPE"] != 5
    return Sources(
        bool(bits & VISION), bool(bits & VISION_HEIGHT), bool(bits & VISION_HEADING), bool(gps),
        bool(compass),
    )  # fmt: skip


def refusal(state: EmulatedState, now: Time) -> str:
    estimator, mode = state.estimator, state.flying
    if not estimator.is_settled(now):
        return "Preflight Fail: ekf2 missing data"
    if (state.failures.tilt * DEG or tilt_of(estimator.attitude.value)) > MOST_TILT:
        return "Preflight Fail: Attitude failure (roll)"
    if state.battery.remaining < state.parameters["BAT_LOW_THR"]:
        return "Preflight Fail: low battery"
    if mode.role in (Role.LAND, Role.RETURN):
        return f"Arming denied: mode {mode.name} can't be armed in"
    return _mode_lacks(state, now)


def _mode_lacks(state: EmulatedState, now: Time) -> str:
    """Return what is missing for the current mode; empty if nothing is."""
    mode = state.flying
    if mode.role is Role.PILOT and not state.has_pilot(now):
        return "Preflight Fail: No manual control input"
    if mode.needs_position and not state.estimator.has_position(now):
        return "Preflight Fail: No valid local position estimate"
    if mode.role in (Role.HOLD, Role.TAKE_OFF) and state.origin is None:
        return "Preflight Fail: No valid global position estimate"
    if mode.role is Role.FOLLOW and not state.streams(now):
        return "Preflight Fail: No offboard signal"
    return ""


def refusal_texts(reason: str) -> tuple[str, ...]:
    if reason.startswith("Arming denied"):
        return (reason,)
    return (reason, "Arming denied: Resolve system health failures first")


def mode_refusal(state: EmulatedState, mode: FlightMode, now: Time) -> str:
    if mode.role is Role.FOLLOW and not state.streams(now):
        return "Switching to mode 'Offboard' is currently not available"
    if mode.role is Role.PILOT and not state.has_pilot(now):
        return f"Switching to mode '{mode.name}' is currently not available"
    if mode.number == MISSION:
        return "Switching to mode 'Mission' is currently not available"  # it has none
    return ""


def disarms(state: EmulatedState, now: Time) -> FailsafeAction | None:
    p, stood = state.parameters, now - max(state.landed_at, state.armed_at)
    if state.has_flown:
        wait = p["COM_DISARM_LAND"] * NS
        return FailsafeAction(None, "Disarmed by landing", "landed") if 0 < wait <= stood else None
    if state.flying.role is Role.FOLLOW and state.streams(now):
        return None
    if state.climb_to is None and 0.0 < p["COM_DISARM_PRFLT"] * NS <= stood:
        return FailsafeAction(None, "Disarmed by auto preflight disarming", "idle")
    return None


def failsafe(state: EmulatedState, now: Time) -> FailsafeAction | None:
    p, role = state.parameters, state.flying.role
    unseen = state.estimator.unseen(now)
    needs = state.flying.needs_position and not isinstance(state.wanted, AttitudeTarget)
    if needs and (unseen is None or unseen > EMULATED.gives_up):
        return FailsafeAction(LAND, "Failsafe activated: switching to Descend", "position")
    if (low := _low_battery(state)) is not None:
        return low
    if role is Role.FOLLOW and not state.streams(now):
        action = {4: LAND, 5: HOLD}.get(int(p["COM_OBL_RC_ACT"]), RETURN)
        return FailsafeAction(action, "Failsafe activated: offboard signal lost", "setpoints")
    if (lost := _lost_pilot(state, now)) is not None:
        return lost
    alone = {1: HOLD, 2: RETURN, 3: LAND}.get(int(p["NAV_DLL_ACT"]))
    heard = max(state.stations.values(), default=None)
    if alone is not None and heard is not None and now - heard > p["COM_DL_LOSS_T"] * NS:
        return FailsafeAction(alone, "Failsafe activated: GCS connection lost", "station")
    return None


def _lost_pilot(state: EmulatedState, now: Time) -> FailsafeAction | None:
    """Return the hold that begins when a transmitter is lost, and what follows it."""
    p, wait = state.parameters, state.parameters["COM_FAIL_ACT_T"]
    if state.sticks is None or state.has_pilot(now):
        return None
    if state.flying.role is Role.PILOT:
        words = f"Failsafe activated: entering Hold for {wait:.0f} seconds"
        return FailsafeAction(HOLD, words, "pilot")
    is_over = now - state.sticks.time > PILOT_LOST + wait * NS
    if state.failed_over == "pilot" and is_over and (act := int(p["NAV_RCL_ACT"])) > 1:
        mode = RETURN if act == 2 else LAND
        return FailsafeAction(mode, "Failsafe activated: manual control lost", "pilot lost")
    return None


def _low_battery(state: EmulatedState) -> FailsafeAction | None:
    p, role = state.parameters, state.flying.role
    low, levels = p["COM_LOW_BAT_ACT"], ("BAT_CRIT_THR", "BAT_EMERGEN_THR")
    critical, empty = (state.battery.remaining < p[level] for level in levels)
    if low >= 2 and empty and role is not Role.LAND:
        return FailsafeAction(LAND, "Failsafe activated: emergency battery", "battery")
    if low in (1, 3) and critical and role not in (Role.LAND, Role.RETURN):
        return FailsafeAction(RETURN, "Failsafe activated: critical battery", "battery")
    if low == 2 and critical and role is not Role.LAND:
        return FailsafeAction(LAND, "Failsafe activated: critical battery", "battery")
    return None


def idle_status(state: EmulatedState, now: Time) -> int:
    return 0 if EMULATED.refuses_arming(state, now) else 3


def tells_position(state: EmulatedState, now: Time) -> bool:
    return state.estimator.has_position(now)


def move_output(outputs: Outputs, command: int, p: tuple[float, ...], now: Time) -> int:
    """Move an output and return the acknowledgement. While disarmed, outputs don't move, but the
    command is acknowledged all the same."""
    if command == mavlink.MAV_CMD_DO_GRIPPER:
        _move(outputs, GRIPPER, 2000 if p[1] else 1000, now)
        return ACCEPTED
    if command != mavlink.MAV_CMD_DO_SET_ACTUATOR:
        return UNSUPPORTED
    for place in range(SETS):
        if p[place] == p[place]:
            pulse = round(1500.0 + 500.0 * max(-1.0, min(1.0, p[place])))
            _move(outputs, FIRST_SET + place, pulse, now)
    return ACCEPTED


def _move(outputs: Outputs, function: int, pulse: int, now: Time) -> None:
    if outputs.state.armed:
        outputs.move_all("PWM_MAIN_FUNC{}", function, pulse, now)


def speeds(p: EmulatedParameters) -> Speeds:
    return Speeds(
        p["MPC_XY_VEL_MAX"], p["MPC_Z_VEL_MAX_UP"], p["MPC_Z_VEL_MAX_DN"], EMULATED.approach
    )


def land_speed(p: EmulatedParameters) -> float:
    return p["MPC_LAND_SPEED"]


def return_height(p: EmulatedParameters, away: float, height: float) -> float:
    """As `RTL::computeReturnAltitude` in PX4."""
    most, accepted = p["RTL_RETURN_ALT"], p["NAV_ACC_RAD"]
    up = most
    if away <= accepted:
        up = 2.0 * away
    elif away <= p["RTL_MIN_DIST"]:
        up = max(away / tan(p["RTL_CONE_ANG"] * DEG), 2.0 * accepted)
    return min(max(up, height), max(most, height))


def climb_rate(_p: EmulatedParameters, _throttle: float) -> None:
    return None


EMULATED = EmulatedFirmware(
    version=(1, 18, 0),
    modes=by_number(
        FlightMode("MANUAL", number(1), Role.PILOT, needs_position=False),
        FlightMode("ALTCTL", number(2), Role.PILOT, needs_position=False),
        FlightMode("POSCTL", number(3), Role.PILOT),
        FlightMode("AUTO.TAKEOFF", TAKE_OFF, Role.TAKE_OFF),
        FlightMode("AUTO.LOITER", HOLD, Role.HOLD),
        FlightMode("AUTO.MISSION", MISSION, Role.HOLD),
        FlightMode("AUTO.RTL", RETURN, Role.RETURN),
        FlightMode("AUTO.LAND", LAND, Role.LAND, needs_position=False),
        FlightMode("ACRO", number(5), Role.PILOT, needs_position=False),
        FlightMode("OFFBOARD", OFFBOARD, Role.FOLLOW),
        FlightMode("STABILIZED", number(7), Role.PILOT, needs_position=False),
    ),
    start=HOLD, follow=OFFBOARD, hold=HOLD, land=LAND, back=RETURN, loiter=HOLD,
    parameters={
        "BAT_CRIT_THR": 0.07, "BAT_EMERGEN_THR": 0.05, "BAT_LOW_THR": 0.15, "COM_ARM_WO_GPS": 1,
        "COM_DISARM_LAND": 2.0, "COM_DISARM_PRFLT": 10.0, "COM_DL_LOSS_T": 10,
        "COM_FAIL_ACT_T": 5.0, "COM_LOW_BAT_ACT": 0, "COM_OBL_RC_ACT": 0, "COM_OF_LOSS_T": 1.0,
        "COM_POS_FS_EPH": 5.0, "COM_RCL_EXCEPT": 0,
        "COM_RC_IN_MODE": 3, "EKF2_ACC_NOISE": 0.35, "EKF2_BARO_CTRL": 1, "EKF2_EVA_NOISE": 0.1,
        "EKF2_EVP_NOISE": 0.1, "EKF2_EVV_NOISE": 0.1, "EKF2_GYR_NOISE": 0.015, "EKF2_EV_CTRL": 0,
        "EKF2_EV_DELAY": 0.0, "EKF2_GPS_CTRL": 7, "EKF2_HGT_REF": 1, "EKF2_MAG_TYPE": 0,
        "EKF2_RNG_CTRL": 1, "SIH_KDV": 1.0, "EKF2_TAU_POS": 0.25, "EKF2_TAU_VEL": 0.25,
        "MAV_SYS_ID": 1, "MIS_TAKEOFF_ALT": 2.5, "MPC_LAND_SPEED": 0.7, "MPC_THR_HOVER": 0.5,
        "MPC_TILTMAX_AIR": 45.0, "MPC_XY_P": 0.95, "MPC_XY_VEL_MAX": 12.0, "MPC_Z_VEL_MAX_DN": 1.5,
        "MPC_Z_VEL_MAX_UP": 3.0, "NAV_DLL_ACT": 0, "NAV_RCL_ACT": 2, "PD_GRIPPER_EN": 0,
        "PD_GRIPPER_TO": 1.0, "PWM_MAIN_FUNC5": 0, "PWM_MAIN_FUNC6": 0, "PWM_MAIN_FUNC7": 0,
        "PWM_MAIN_FUNC8": 0, "NAV_ACC_RAD": 10.0,
        "RTL_CONE_ANG": 45, "RTL_MIN_DIST": 10.0, "RTL_RETURN_ALT": 30.0,
        "SENS_EN_GPSSIM": 1, "SENS_EN_MAGSIM": 1,
        "SYS_AUTOSTART": 10040, "SYS_HAS_GPS": 1, "SYS_HAS_MAG": 1,
    },
    system_parameter="MAV_SYS_ID", loss_parameter="COM_OF_LOSS_T",
    without_transmitter=frozenset({"COM_RCL_EXCEPT", "NAV_RCL_ACT"}),
    takeoff_parameter="MIS_TAKEOFF_ALT",
    streams={
        "ALTITUDE": 10.0, "ATTITUDE": 99.0, "ATTITUDE_QUATERNION": 50.0, "ATTITUDE_TARGET": 10.0,
        "BATTERY_STATUS": 0.5, "ESTIMATOR_STATUS": 1.0, "EXTENDED_SYS_STATE": 5.0,
        "GLOBAL_POSITION_INT": 50.0, "GPS_RAW_INT": 1.0, "HIGHRES_IMU": 50.0, "HOME_POSITION": 0.5,
        "LOCAL_POSITION_NED": 30.0, "ODOMETRY": 30.0, "SERVO_OUTPUT_RAW": 10.0, "SYSTEM_TIME": 1.0,
        "SYS_STATUS": 5.0, "VFR_HUD": 10.0,
    },
    stations=("udpout:127.0.0.1:14550",),
    station_streams={
        "ALTITUDE": 1.0, "ATTITUDE": 50.0, "ATTITUDE_QUATERNION": 50.0, "ATTITUDE_TARGET": 50.0,
        "BATTERY_STATUS": 0.5, "CURRENT_MODE": 0.5, "ESTIMATOR_STATUS": 0.5,
        "EXTENDED_SYS_STATE": 1.0, "GLOBAL_POSITION_INT": 50.0, "GPS_GLOBAL_ORIGIN": 1.0,
        "GPS_RAW_INT": 5.0, "HOME_POSITION": 0.5, "LOCAL_POSITION_NED": 50.0,
        "POSITION_TARGET_LOCAL_NED": 50.0, "RC_CHANNELS": 5.0, "SERVO_OUTPUT_RAW": 50.0,
        "SYS_STATUS": 1.0, "SYSTEM_TIME": 1.0, "VFR_HUD": 4.0,
    },
    lacks=frozenset({"EKF_STATUS_REPORT", "RAW_IMU", "SIM_STATE"}),
    unsupported=frozenset(
        {
            mavlink.MAV_CMD_DO_PAUSE_CONTINUE, mavlink.MAV_CMD_NAV_LOITER_UNLIM,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
        }
    ),
    stream_refused=FAILED, message_refused=DENIED, answers_pings=True, answers_for_all=False,
    tells_parameter_errors=True, denied=TEMPORARILY_REJECTED, unknown_mode=DENIED,
    armed_text="Armed by external command", disarmed_text="Disarmed by external command",
    not_landed_text="Disarming denied: not landed",
    wrong_arming_text="Unsupported ARM_DISARM param: {:.3f}", text_end="\t",
    mode_messages=("HEARTBEAT", "CURRENT_MODE"), servo_function=GRIPPER, pulses=(1000, 2000),
    vision_frames=frozenset({mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_FRD}),
    origin=Tangent.on_ellipsoid(47.397742, 8.545594, 488.0), forgets=1.0, gives_up=5.0, adopts=None,
    averages=0.5, waits=2.5, takes_off=1.5, approach=0.62, ramp=8.0, looks_ahead=False,
    lands_to_return=False,
    holds_unsteered=frozenset(), obeys_on_ground=True, keeps_setpoints=True,
    returns_to_mode=True,
    by_axis=True, takes_mocap=False, speaks_to_all=False, complains=False,
    every_heartbeat_counts=False,
    sources=sources, refusal=refusal, refusal_texts=refusal_texts,
    mode_refusal=mode_refusal, failsafe=failsafe, disarms=disarms, idle_status=idle_status,
    tells_position=tells_position, mode_number=mode_number, move_output=move_output, speeds=speeds,
    land_speed=land_speed, return_height=return_height, climb_rate=climb_rate,
)  # fmt: skip
