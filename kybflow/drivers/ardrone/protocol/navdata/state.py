"""The state mask of navigation data, and the flight phases of the demo option."""

from __future__ import annotations

from enum import IntEnum, IntFlag


class DroneState(IntFlag):
    """The bits of the state mask (SDK 2.0, `config.h`)."""

    FLYING = 1 << 0
    VIDEO = 1 << 1
    VISION = 1 << 2
    ANGULAR_SPEED_CONTROL = 1 << 3
    ALTITUDE_CONTROL = 1 << 4
    START_BUTTON = 1 << 5
    COMMAND_ACKNOWLEDGED = 1 << 6
    CAMERA = 1 << 7
    TRAVELLING = 1 << 8
    USB = 1 << 9
    DEMO = 1 << 10
    BOOTSTRAP = 1 << 11
    MOTORS_PROBLEM = 1 << 12
    COMMUNICATION_LOST = 1 << 13
    SOFTWARE_FAULT = 1 << 14
    BATTERY_LOW = 1 << 15
    USER_EMERGENCY = 1 << 16
    TIMER_ELAPSED = 1 << 17
    MAGNETOMETER_UNCALIBRATED = 1 << 18
    ANGLES_OUT_OF_RANGE = 1 << 19
    WIND = 1 << 20
    ULTRASOUND_DEAF = 1 << 21
    CUT_OUT = 1 << 22
    PIC_VERSION_OK = 1 << 23
    AT_THREAD = 1 << 24
    NAVDATA_THREAD = 1 << 25
    VIDEO_THREAD = 1 << 26
    ACQUISITION_THREAD = 1 << 27
    CONTROL_WATCHDOG = 1 << 28
    ADC_WATCHDOG = 1 << 29
    COMMUNICATION_WATCHDOG = 1 << 30
    EMERGENCY = 1 << 31


class Phase(IntEnum):
    """The flight phase, which is the upper half of the demo option's first field."""

    DEFAULT = 0
    INIT = 1
    LANDED = 2
    FLYING = 3
    HOVERING = 4
    TEST = 5
    TAKING_OFF = 6
    GOING = 7
    LANDING = 8
    LOOPING = 9


FOLLOWING = frozenset({Phase.FLYING, Phase.HOVERING, Phase.GOING})
"""The phases in which a drone follows PCMD."""
ALARMS = {
    DroneState.MOTORS_PROBLEM: "its motors have a problem",
    DroneState.SOFTWARE_FAULT: "its software has a fault",
    DroneState.BATTERY_LOW: "its battery is low",
    DroneState.USER_EMERGENCY: "an emergency was asked for",
    DroneState.TIMER_ELAPSED: "its timer has elapsed",
    DroneState.ANGLES_OUT_OF_RANGE: "it has tilted too far",
    DroneState.WIND: "the wind is too strong",
    DroneState.ULTRASOUND_DEAF: "its ultrasound hears nothing",
    DroneState.CUT_OUT: "a motor was stopped by force",
    DroneState.COMMUNICATION_LOST: "it has lost the communication",
    DroneState.EMERGENCY: "it is in emergency, its rotors stopped",
}
"""The bits that are reported when they become set, with their descriptions."""


def phase_of(control_state: int) -> Phase:
    """Return the flight phase; DEFAULT for an unknown one."""
    major = control_state >> 16
    return Phase(major) if major in Phase.__members__.values() else Phase.DEFAULT


def in_words(state: DroneState) -> list[str]:
    return [words for bit, words in ALARMS.items() if state & bit]
