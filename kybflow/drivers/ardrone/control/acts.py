"""What a drone performs on request: animations of its LEDs and of its flight, and the calibration
of its magnetometer.

Animations are values of the configuration (`leds:leds_anim`, `control:flight_anim`), in the order
of the SDK's ARDroneGeneratedTypes.h, with the durations that Parrot's own application gives them.
Each is sent once: one that is lost is not shown, and none is flown twice.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.protocol.at import Ids, Line, bits_of, calib, config, config_ids
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
"""Milliseconds of each flight animation; a flip takes as long as it does."""
CALIBRATE = "calibrate_magnetometer"
HERTZ, SECONDS = 2.0, 3
"""How fast and how long the LEDs play."""
SETTLES: Time = 3 * NS
"""How long after its duration a drone may still be at it."""
TURNS: Time = 10 * NS
"""How long it turns to calibrate its magnetometer, at most."""
_MOVES = Act(moves=True, needs="maneuvers")
ACTS: Mapping[str, Act] = {
    **{f"leds_{name}": Act() for name in LEDS},
    **dict.fromkeys(FLIGHTS, _MOVES),
    CALIBRATE: _MOVES,
}


def lasts(act: str) -> Time:
    """How long an act that moves the drone may last."""
    return TURNS if act == CALIBRATE else FLIGHTS[act] * NS // 1000 + SETTLES


def lines_of(act: str, ids: Ids) -> tuple[Line, ...]:
    """What asks for an act."""
    if act == CALIBRATE:
        return (calib(),)
    if act in FLIGHTS:
        return (config("control:flight_anim", f"{[*FLIGHTS].index(act)},{FLIGHTS[act]}"),)
    number = LEDS.index(act.removeprefix("leds_"))
    value = f"{number},{bits_of(HERTZ)},{SECONDS}"
    return (config_ids(ids), config("leds:leds_anim", value))
