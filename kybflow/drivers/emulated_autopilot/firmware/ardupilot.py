"""ArduPilot Copter 4.5.7 as observed: modes, parameters, arming checks, failsafes."""

from __future__ import annotations

from kybflow.core.geometry import tilt_of
from kybflow.core.signals import NS, Time
from kybflow.core.units import DEG
from kybflow.drivers.emulated_autopilot.estimator import Sources
from kybflow.drivers.emulated_autopilot.firmware import EmulatedFirmware, by_number
from kybflow.drivers.emulated_autopilot.state import (
    ACCEPTED,
    DENIED,
    FAILED,
    INFO,
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

RADIUS = 6_378_100.0
"""The radius of the earth in ArduPilot's simulator, a sphere, metres."""
DISARM_DELAY_NS: Time = NS
"""The time from a landing to disarming, in a mode that lands."""
GRIPPER, RELAY, FIRST_RELAY = 28, -1, 9
"""Functions of an output: the gripper, a relay; and the number of the output that is relay 0."""
MOST_TILT = 20.0 * DEG
"""The largest tilt at which it arms, radians."""
THRUST_IS_THRUST = 8
"""The bit of GUID_OPTIONS; without it a throttle is a climb rate."""
STABILIZE, ALT_HOLD, AUTO, GUIDED, LOITER, RETURN, LAND, POSHOLD, BRAKE = (
    0, 2, 3, 4, 5, 6, 9, 16, 17,
)  # fmt: skip
CONE_SLOPE, LOWEST_RETURN = 3.0, 2.0
"""A return rises to the first times the distance, and at least to the second, metres
(RTL_CONE_SLOPE, RTL_ALT_MIN)."""


def mode_number(p: tuple[float, ...]) -> int:
    return int(p[1])


def sources(p: EmulatedParameters) -> Sources:
    has_vision, source = p["VISO_TYPE"] > 0, "EK3_SRC1_"
    return Sources(
        has_vision and p[f"{source}POSXY"] == 6,
        has_vision and p[f"{source}POSZ"] == 6,
        has_vision and p[f"{source}YAW"] == 6,
        p["GPS_TYPE"] > 0 and p[f"{source}POSXY"] == 3,
        p["COMPASS_ENABLE"] > 0 and p[f"{source}YAW"] == 1,
    )


def refusal(state: EmulatedState, now: Time) -> str:
    estimator, mode, p = state.estimator, state.flying, state.parameters
    if p["ARMING_CHECK"] == 0:
        return ""
    if not estimator.is_settled(now):
        return "PreArm: AHRS: not healthy"
    if p["FS_THR_ENABLE"] and state.sticks is None:
        return "PreArm: RC not found"
    if 0.0 < state.battery.voltage < max(p["BATT_LOW_VOLT"], p["BATT_ARM_VOLT"]):
        return "PreArm: Battery 1 low voltage failsafe"
    if (state.failures.tilt * DEG or tilt_of(estimator.attitude.value)) > MOST_TILT:
        return "Arm: Leaning"
    if mode.role in (Role.LAND, Role.RETURN, Role.HOLD):
        return f"Arm: {mode.name} mode not armable"
    return _position_lacks(state, now)


def _position_lacks(state: EmulatedState, now: Time) -> str:
    """Return what is missing for a valid position; empty if nothing is."""
    estimator, has_vision = state.estimator, sources(state.parameters).vision
    if has_vision and not estimator.sees(now):
        return "PreArm: VisOdom: not healthy"
    if has_vision and state.origin is None:
        return "PreArm: AHRS: waiting for home"
    if state.flying.needs_position and not estimator.has_position(now):
        return "Arm: Need Position Estimate"
    return ""


def refusal_texts(reason: str) -> tuple[str, ...]:
    return (reason,)


def mode_refusal(_state: EmulatedState, mode: FlightMode, _now: Time) -> str:
    if mode.number == AUTO:
        return "Mode change to AUTO failed: init failed"  # it has no mission
    return ""


def disarms(state: EmulatedState, now: Time) -> FailsafeAction | None:
    p, stood = state.parameters, now - max(state.landed_at, state.armed_at)
    if not state.has_flown:
        is_idle = state.climb_to is None and 0.0 < p["DISARM_DELAY"] * NS <= stood
        return FailsafeAction(None, "", "idle") if is_idle else None
    lands = state.flying.role in (Role.LAND, Role.RETURN)
    wait = DISARM_DELAY_NS if lands else p["DISARM_DELAY"] * NS
    return FailsafeAction(None, "", "landed") if 0 < wait <= stood else None


def failsafe(state: EmulatedState, now: Time) -> FailsafeAction | None:
    p, role = state.parameters, state.flying.role
    unseen, voltage = state.estimator.unseen(now), state.battery.voltage
    if state.flying.needs_position and (unseen is None or unseen > EMULATED.gives_up):
        return FailsafeAction(LAND, "EKF Failsafe: changed to LAND Mode", "position")
    if 0.0 < voltage < p["BATT_LOW_VOLT"] and p["BATT_FS_LOW_ACT"] and role is not Role.LAND:
        mode = LAND if p["BATT_FS_LOW_ACT"] == 1 else RETURN
        return FailsafeAction(mode, "Battery Failsafe", "battery")
    station = state.stations.get(int(p["SYSID_MYGCS"]))
    if not p["FS_GCS_ENABLE"] or station is None or role is Role.LAND:
        return None
    if now - station <= p["FS_GCS_TIMEOUT"] * NS:
        return None
    mode = RETURN if p["FS_GCS_ENABLE"] in (1, 3, 4) else LAND
    return FailsafeAction(mode, "GCS Failsafe", "station")


def idle_status(state: EmulatedState, now: Time) -> int:
    return 3 if state.estimator.is_settled(now) else 1


def tells_position(state: EmulatedState, now: Time) -> bool:
    return state.estimator.unseen(now) is not None and state.origin is not None


def move_output(outputs: Outputs, command: int, p: tuple[float, ...], now: Time) -> int:
    parameters = outputs.state.parameters
    if command == mavlink.MAV_CMD_DO_SET_SERVO:
        if parameters.get(f"SERVO{int(p[0])}_FUNCTION", -2.0) != 0.0:
            return FAILED
        outputs.move(int(p[0]), round(p[1]), now)
        return ACCEPTED
    if command == mavlink.MAV_CMD_DO_SET_RELAY:
        channel = FIRST_RELAY + int(p[0])
        if parameters.get(f"SERVO{channel}_FUNCTION") != RELAY:
            return FAILED
        outputs.move(channel, 1900 if p[1] else 1100, now)
        return ACCEPTED
    if command != mavlink.MAV_CMD_DO_GRIPPER:
        return UNSUPPORTED
    if parameters["GRIP_ENABLE"] != 1 or parameters["GRIP_TYPE"] != 1:
        return FAILED
    pulse = parameters["GRIP_GRAB"] if p[1] else parameters["GRIP_RELEASE"]
    if not outputs.move_all("SERVO{}_FUNCTION", GRIPPER, round(pulse), now):
        return FAILED
    outputs.state.say("Gripper load grabbed" if p[1] else "Gripper load released", INFO)
    return ACCEPTED


def speeds(p: EmulatedParameters) -> Speeds:
    along, up, down = p["WPNAV_SPEED"], p["WPNAV_SPEED_UP"], p["WPNAV_SPEED_DN"]
    return Speeds(along / 100.0, up / 100.0, down / 100.0, EMULATED.approach)


def land_speed(p: EmulatedParameters) -> float:
    return p["LAND_SPEED"] / 100.0


def return_height(p: EmulatedParameters, away: float, height: float) -> float:
    """As `ModeRTL::compute_return_target` in ArduCopter."""
    lowest = max(LOWEST_RETURN, height)
    return min(max(p["RTL_ALT"] / 100.0, lowest), max(CONE_SLOPE * away, lowest))


def climb_rate(p: EmulatedParameters, throttle: float) -> float | None:
    if int(p["GUID_OPTIONS"]) & THRUST_IS_THRUST:
        return None
    return (throttle - 0.5) * p["WPNAV_SPEED_UP"] / 50.0


EMULATED = EmulatedFirmware(
    version=(4, 5, 7),
    modes=by_number(
        FlightMode("STABILIZE", STABILIZE, Role.PILOT, needs_position=False),
        FlightMode("ALT_HOLD", ALT_HOLD, Role.PILOT, needs_position=False),
        FlightMode("AUTO", AUTO, Role.HOLD),
        FlightMode("GUIDED", GUIDED, Role.FOLLOW),
        FlightMode("LOITER", LOITER, Role.PILOT),
        FlightMode("RTL", RETURN, Role.RETURN),
        FlightMode("LAND", LAND, Role.LAND, needs_position=False),
        FlightMode("POSHOLD", POSHOLD, Role.PILOT),
        FlightMode("BRAKE", BRAKE, Role.HOLD),
        FlightMode("GUIDED_NOGPS", 20, Role.FOLLOW, needs_position=False),
        FlightMode("SMART_RTL", 21, Role.RETURN),
    ),
    start=STABILIZE, follow=GUIDED, hold=BRAKE, land=LAND, back=RETURN, loiter=LOITER,
    parameters={
        "ARMING_CHECK": 1, "BATT_ARM_VOLT": 0.0, "BATT_CRT_VOLT": 0.0, "BATT_FS_CRT_ACT": 0,
        "BATT_FS_LOW_ACT": 0, "BATT_LOW_VOLT": 10.5, "BATT_MONITOR": 4, "COMPASS_ENABLE": 1,
        "DISARM_DELAY": 10, "EK3_ENABLE": 1, "EK3_SRC1_POSXY": 3, "EK3_SRC1_POSZ": 1,
        "EK3_SRC1_VELXY": 3, "EK3_SRC1_VELZ": 3, "EK3_SRC1_YAW": 1, "FRAME_CLASS": 1,
        "FRAME_TYPE": 0, "FS_EKF_ACTION": 1, "FS_EKF_THRESH": 0.8, "FS_GCS_ENABLE": 0,
        "FS_GCS_TIMEOUT": 5.0, "FS_OPTIONS": 16, "FS_THR_ENABLE": 1, "GPS_TYPE": 1,
        "GRIP_ENABLE": 0, "GRIP_GRAB": 1900, "GRIP_RELEASE": 1100, "GRIP_TYPE": 0,
        "GUID_OPTIONS": 0, "GUID_TIMEOUT": 3.0, "LAND_SPEED": 50, "MOT_THST_EXPO": 0.65,
        "MOT_THST_HOVER": 0.35, "RELAY1_FUNCTION": 0, "RTL_ALT": 1500,
        **{f"SERVO{channel}_FUNCTION": 32 + channel for channel in range(1, 5)},
        **{f"SERVO{channel}_FUNCTION": 0 for channel in range(5, 15)}, "SYSID_MYGCS": 255,
        "SYSID_THISMAV": 1, "VISO_TYPE": 0, "WPNAV_SPEED": 1000.0, "WPNAV_SPEED_DN": 150.0,
        "WPNAV_SPEED_UP": 250.0,
    },
    system_parameter="SYSID_THISMAV", setpoint_timeout="GUID_TIMEOUT", streams={},
    station_streams={}, without_transmitter=frozenset({"FS_THR_ENABLE"}),
    lacks=frozenset(
        {
            "ALTITUDE", "CURRENT_MODE", "ESTIMATOR_STATUS", "HIGHRES_IMU", "HIL_STATE_QUATERNION",
            "ODOMETRY",
        }
    ),
    stream_refused=DENIED, message_refused=DENIED, answers_pings=False, answers_for_all=True,
    tells_parameter_errors=False, denied=FAILED,
    unknown_mode=FAILED, armed_text="Arming motors", disarmed_text="Disarming motors",
    not_landed_text="Disarm: not landed", mode_messages=("HEARTBEAT",), servo_function=0,
    pulses=(1100, 1900), vision_frames=frozenset({mavlink.MAV_FRAME_LOCAL_FRD}),
    origin=Tangent.on_sphere(-35.363262, 149.165237, 584.0, RADIUS), forgets=7.2, gives_up=7.9,
    adopts=100, averages=0.0,
    waits=8.0, takes_off=0.5, approach=0.8, ramp=0.0, looks_ahead=True, lands_to_return=True,
    holds_unsteered=frozenset({ALT_HOLD, LOITER, POSHOLD}), obeys_on_ground=False,
    keeps_setpoints=False,
    returns_to_mode=False, by_axis=False, takes_mocap=True, speaks_to_all=True, complains=True,
    every_heartbeat_counts=True, sources=sources, refusal=refusal,
    refusal_texts=refusal_texts, mode_refusal=mode_refusal, failsafe=failsafe, disarms=disarms,
    idle_status=idle_status, tells_position=tells_position, mode_number=mode_number,
    move_output=move_output, speeds=speeds, land_speed=land_speed, return_height=return_height,
    climb_rate=climb_rate,
)  # fmt: skip
