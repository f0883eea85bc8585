"""ArduPilot Copter 4.5.7 as it was observed: modes, parameters, when it gives up."""

from __future__ import annotations

from kybflow.drivers.emulated_autopilot.firmware.firmware import Firmware, Mode, Role, by_number
from kybflow.drivers.mavlink.protocol.frames import Tangent

AUTOPILOT_ARDUPILOT = 3
FAILED = 4
EARTH = 6_378_100.0
"""Radius of the sphere that it takes the earth for, metres."""

STABILIZE, GUIDED, LOITER, RETURN, LAND, BRAKE = 0, 4, 5, 6, 9, 17
SINKS = 2.4
"""How fast it comes down in a mode of a pilot's without a pilot: the throttle stick reads zero,
m/s."""

ARDUPILOT = Firmware(
    name="ardupilot",
    autopilot=AUTOPILOT_ARDUPILOT,
    version=(4, 5, 7),
    modes=by_number(
        Mode("STABILIZE", STABILIZE, Role.PILOT, needs_position=False),
        Mode("ALT_HOLD", 2, Role.PILOT, needs_position=False),
        Mode("AUTO", 3, Role.HOLD),
        Mode("GUIDED", GUIDED, Role.FOLLOW),
        Mode("LOITER", LOITER, Role.PILOT),
        Mode("RTL", RETURN, Role.RETURN),
        Mode("LAND", LAND, Role.LAND, needs_position=False),
        Mode("POSHOLD", 16, Role.PILOT),
        Mode("BRAKE", BRAKE, Role.HOLD),
        Mode("GUIDED_NOGPS", 20, Role.FOLLOW, needs_position=False),
        Mode("SMART_RTL", 21, Role.RETURN),
    ),
    start=STABILIZE,
    follow=GUIDED,
    hold=BRAKE,
    land=LAND,
    back=RETURN,
    parameters={
        "ARMING_CHECK": 1,
        "BATT_ARM_VOLT": 0.0,
        "BATT_CRT_VOLT": 0.0,
        "BATT_FS_CRT_ACT": 0,
        "BATT_FS_LOW_ACT": 0,
        "BATT_LOW_VOLT": 10.5,
        "BATT_MONITOR": 4,
        "COMPASS_ENABLE": 1,
        "DISARM_DELAY": 10,
        "EK3_ENABLE": 1,
        "EK3_SRC1_POSXY": 3,
        "EK3_SRC1_POSZ": 1,
        "EK3_SRC1_VELXY": 3,
        "EK3_SRC1_VELZ": 3,
        "EK3_SRC1_YAW": 1,
        "FRAME_CLASS": 1,
        "FRAME_TYPE": 0,
        "FS_EKF_ACTION": 1,
        "FS_EKF_THRESH": 0.8,
        "FS_GCS_ENABLE": 0,
        "FS_GCS_TIMEOUT": 5.0,
        "FS_OPTIONS": 16,
        "FS_THR_ENABLE": 1,
        "GPS_TYPE": 1,
        "GRIP_ENABLE": 0,
        "GRIP_GRAB": 1900,
        "GRIP_RELEASE": 1100,
        "GRIP_TYPE": 0,
        "GUID_OPTIONS": 0,
        "GUID_TIMEOUT": 3.0,
        "LAND_SPEED": 50,
        "MOT_THST_EXPO": 0.65,
        "MOT_THST_HOVER": 0.35,
        "RELAY1_FUNCTION": 0,
        "RTL_ALT": 1500,
        **{f"SERVO{channel}_FUNCTION": 32 + channel for channel in range(1, 5)},
        **{f"SERVO{channel}_FUNCTION": 0 for channel in range(5, 15)},
        "SYSID_MYGCS": 255,
        "SYSID_THISMAV": 1,
        "VISO_TYPE": 0,
        "WPNAV_SPEED": 1000.0,
        "WPNAV_SPEED_DN": 150.0,
        "WPNAV_SPEED_UP": 250.0,
    },
    bytewise=False,
    streams={},
    denied=FAILED,
    forgets=7.2,
    gives_up=7.9,
    waits=8.0,
    takes_off=0.5,
    obeys_on_ground=False,
    origin=Tangent.on_sphere(-35.363262, 149.165237, 584.0, EARTH),
)
