"""The actions of a drone: LED animations, flight animations, and the calibration of the
magnetometer.

Animations are values of the configuration (`leds:leds_anim`, `control:flight_anim`), in the order
of the SDK's ARDroneGeneratedTypes.h, with the durations of Parrot's own application. Each is sent
only once, so that none is flown twice; if the datagram is lost, so is the animation.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.at import Ids, Line, bits_of, calib, config, config_ids
from kybflow.parts import Act

LEDS = (
    "blink_green_red", "blink_green", "blink_red", "blink_orange", "snake_green_red", "fire",
    "standard", "red", "green", "red_snake", "blank", "right_missile", "left_missile",
    "double_missile", "front_left_green_others_red", "front_right_green_others_red",
    "rear_right_green_others_red", "rear_left_green_others_red", "left_green_right_red",
    "left_red_right_green", "blink_standard",
)  # fmt: skip
FLIGHTS: Mapping[str, int] = {
    "roll_left": 1000, "roll_right": 1000, "pitch_forward": 1000, "pitch_backward": 1000,
    "pitch_and_turn_right": 1000, "pitch_and_turn_left": 1000, "turn_around": 5000,
    "turn_around_down": 5000, "yaw_shake": 2000, "yaw_dance": 5000, "roll_dance": 5000,
    "pitch_dance": 5000, "climb_dance": 5000, "wave": 5000, "roll_and_pitch": 5000,
    "double_roll_and_pitch": 5000, "flip_forward": 15, "flip_backward": 15, "flip_left": 15,
    "flip_right": 15,
}  # fmt: skip
"""Duration of each flight animation, ms; the drone ignores that of a flip."""
CALIBRATE = "calibrate_magnetometer"
HERTZ, SECONDS = 2.0, 3
"""Frequency (Hz) and duration (s) of LED animations."""
SETTLING_TIME: Time = 3 * NS
"""How much longer than its duration an animation may last."""
CALIBRATION_TIME: Time = 10 * NS
"""Longest duration of the magnetometer's calibration."""
_MOVES = Act(moves=True, needs="maneuvers")
ACTS: Mapping[str, Act] = {
    **{f"leds_{name}": Act() for name in LEDS},
    **dict.fromkeys(FLIGHTS, _MOVES),
    CALIBRATE: _MOVES,
}


def lasts(act: str) -> Time:
    """Return the longest duration of an action that moves the drone."""
    return CALIBRATION_TIME if act == CALIBRATE else FLIGHTS[act] * NS // 1000 + SETTLING_TIME


def lines_of(act: str, ids: Ids) -> tuple[Line, ...]:
    """Return the AT commands that request an action."""
    if act == CALIBRATE:
        return (calib(),)
    if act in FLIGHTS:
        return (config("control:flight_anim", f"{[*FLIGHTS].index(act)},{FLIGHTS[act]}"),)
    number = LEDS.index(act.removeprefix("leds_"))
    value = f"{number},{bits_of(HERTZ)},{SECONDS}"
    return (config_ids(ids), config("leds:leds_anim", value))
