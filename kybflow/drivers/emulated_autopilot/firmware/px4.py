"""PX4 1.18 as it was observed: modes, parameters, what it streams, when it gives up."""

from __future__ import annotations

from kybflow.drivers.emulated_autopilot.firmware.firmware import Firmware, Mode, Role, by_number
from kybflow.drivers.mavlink.protocol.frames import Tangent

AUTOPILOT_PX4 = 12
TEMPORARILY_REJECTED = 1


def number(main: int, sub: int = 0) -> int:
    """custom_mode of a main and a sub mode."""
    return main << 16 | sub << 24


OFFBOARD, TAKE_OFF, HOLD, RETURN, LAND = (
    number(6), number(4, 2), number(4, 3), number(4, 5), number(4, 6),
)  # fmt: skip

PX4 = Firmware(
    name="px4",
    autopilot=AUTOPILOT_PX4,
    version=(1, 18, 0),
    modes=by_number(
        Mode("MANUAL", number(1), Role.PILOT, needs_position=False),
        Mode("ALTCTL", number(2), Role.PILOT, needs_position=False),
        Mode("POSCTL", number(3), Role.PILOT),
        Mode("AUTO.TAKEOFF", TAKE_OFF, Role.TAKE_OFF),
        Mode("AUTO.LOITER", HOLD, Role.HOLD),
        Mode("AUTO.MISSION", number(4, 4), Role.HOLD),
        Mode("AUTO.RTL", RETURN, Role.RETURN),
        Mode("AUTO.LAND", LAND, Role.LAND, needs_position=False),
        Mode("ACRO", number(5), Role.PILOT, needs_position=False),
        Mode("OFFBOARD", OFFBOARD, Role.FOLLOW),
        Mode("STABILIZED", number(7), Role.PILOT, needs_position=False),
    ),
    start=HOLD,
    follow=OFFBOARD,
    hold=HOLD,
    land=LAND,
    back=RETURN,
    parameters={
        "BAT_CRIT_THR": 0.07,
        "BAT_EMERGEN_THR": 0.05,
        "BAT_LOW_THR": 0.15,
        "COM_ARM_WO_GPS": 1,
        "COM_DISARM_LAND": 2.0,
        "COM_DISARM_PRFLT": 10.0,
        "COM_DL_LOSS_T": 10,
        "COM_LOW_BAT_ACT": 0,
        "COM_OBL_RC_ACT": 0,
        "COM_OF_LOSS_T": 1.0,
        "COM_POS_FS_EPH": 5.0,
        "COM_RCL_EXCEPT": 0,
        "COM_RC_IN_MODE": 3,
        "EKF2_ACC_NOISE": 0.35,
        "EKF2_BARO_CTRL": 1,
        "EKF2_EVA_NOISE": 0.1,
        "EKF2_EVP_NOISE": 0.1,
        "EKF2_EVV_NOISE": 0.1,
        "EKF2_GYR_NOISE": 0.015,
        "EKF2_EV_CTRL": 0,
        "EKF2_EV_DELAY": 0.0,
        "EKF2_GPS_CTRL": 7,
        "EKF2_HGT_REF": 1,
        "EKF2_MAG_TYPE": 0,
        "EKF2_RNG_CTRL": 1,
        "SIH_KDV": 1.0,
        "EKF2_TAU_POS": 0.25,
        "EKF2_TAU_VEL": 0.25,
        "MAV_SYS_ID": 1,
        "MIS_TAKEOFF_ALT": 2.5,
        "MPC_LAND_SPEED": 0.7,
        "MPC_THR_HOVER": 0.5,
        "MPC_TILTMAX_AIR": 45.0,
        "MPC_XY_P": 0.95,
        "MPC_XY_VEL_MAX": 12.0,
        "MPC_Z_VEL_MAX_DN": 1.5,
        "MPC_Z_VEL_MAX_UP": 3.0,
        "NAV_DLL_ACT": 0,
        "NAV_RCL_ACT": 2,
        "PD_GRIPPER_EN": 0,
        "PD_GRIPPER_TO": 1.0,
        "PWM_MAIN_FUNC5": 0,
        "PWM_MAIN_FUNC6": 0,
        "PWM_MAIN_FUNC7": 0,
        "PWM_MAIN_FUNC8": 0,
        "RTL_RETURN_ALT": 60.0,
        "SENS_EN_GPSSIM": 1,
        "SENS_EN_MAGSIM": 1,
        "SYS_AUTOSTART": 10040,
        "SYS_HAS_GPS": 1,
        "SYS_HAS_MAG": 1,
    },
    bytewise=True,
    streams={
        "ALTITUDE": 10.0,
        "ATTITUDE": 99.0,
        "ATTITUDE_QUATERNION": 50.0,
        "ATTITUDE_TARGET": 10.0,
        "BATTERY_STATUS": 0.5,
        "ESTIMATOR_STATUS": 1.0,
        "EXTENDED_SYS_STATE": 5.0,
        "GLOBAL_POSITION_INT": 50.0,
        "GPS_RAW_INT": 1.0,
        "HIGHRES_IMU": 50.0,
        "HOME_POSITION": 0.5,
        "LOCAL_POSITION_NED": 30.0,
        "ODOMETRY": 30.0,
        "SERVO_OUTPUT_RAW": 10.0,
        "SYSTEM_TIME": 1.0,
        "SYS_STATUS": 5.0,
        "VFR_HUD": 10.0,
    },
    denied=TEMPORARILY_REJECTED,
    forgets=1.0,
    gives_up=5.0,
    waits=2.5,
    takes_off=1.5,
    obeys_on_ground=True,
    origin=Tangent.on_ellipsoid(47.397742, 8.545594, 488.0),
)
