"""The fields of every option in order (SDK 2.0, `navdata_common.h`), each as `name:format` with a
format of `struct`.

If a firmware sends a shorter option, the missing fields are left out; extra bytes are not decoded.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

Value = float | tuple[float, ...]


class OptionTag(IntEnum):
    """The tags of the options (SDK 2.0, `navdata_keys.h`)."""

    DEMO = 0
    TIME = 1
    RAW_MEASURES = 2
    PHYS_MEASURES = 3
    GYROS_OFFSETS = 4
    EULER_ANGLES = 5
    REFERENCES = 6
    TRIMS = 7
    RC_REFERENCES = 8
    PWM = 9
    ALTITUDE = 10
    VISION_RAW = 11
    VISION_OF = 12
    VISION = 13
    VISION_PERF = 14
    TRACKERS_SEND = 15
    VISION_DETECT = 16
    WATCHDOG = 17
    ADC_DATA_FRAME = 18
    VIDEO_STREAM = 19
    GAMES = 20
    PRESSURE_RAW = 21
    MAGNETO = 22
    WIND_SPEED = 23
    KALMAN_PRESSURE = 24
    HDVIDEO_STREAM = 25
    WIFI = 26
    GPS = 27


class OptionField(NamedTuple):
    """One field of an option. at: its offset after the option's header, bytes."""

    name: str
    at: int
    layout: struct.Struct


_FIELDS: Mapping[OptionTag, str] = {
    OptionTag.DEMO: (
        "control_state:I battery_percent:I theta:f phi:f psi:f altitude:i velocity:3f frame:I"
        " camera_rotation:9f camera_translation:3f tag:I camera_type:I detection_rotation:9f"
        " detection_translation:3f"
    ),
    OptionTag.TIME: "time:I",
    OptionTag.RAW_MEASURES: (
        "accelerometers:3H gyroscopes:3h gyroscopes_110:2h battery_millivolts:I echo_start:H"
        " echo_end:H echo_association:H echo_distance:H curve_time:H curve_value:H curve_ref:H"
        " echo_flag:H echo_number:H echo_sum:I altitude:i"
    ),
    OptionTag.PHYS_MEASURES: (
        "accelerometer_temperature:f gyroscope_temperature:H accelerometers:3f gyroscopes:3f"
        " supply:I reference_epson:I reference_idg:I"
    ),
    OptionTag.GYROS_OFFSETS: "offsets:3f",
    OptionTag.EULER_ANGLES: "theta:f phi:f",
    OptionTag.REFERENCES: (
        "theta:i phi:i theta_integral:i phi_integral:i pitch:i roll:i yaw:i psi:i velocity:2f"
        " theta_mod:f phi_mod:f gain_velocity:2f gain_mode:I time:f asked_theta:f asked_phi:f"
        " asked_psi:f psi_accuracy:f sequence:i"
    ),
    OptionTag.TRIMS: "yaw_rate:f theta:f phi:f",
    OptionTag.RC_REFERENCES: "pitch:i roll:i yaw:i gaz:i ag:i",
    OptionTag.PWM: (
        "motors:4B saturations:4B gaz_feed_forward:f gaz_altitude:f altitude_integral:f"
        " climb_reference:f pitch:i roll:i yaw:i yaw_integral:f planned_pitch:i planned_roll:i"
        " planned_yaw:i planned_gaz:f currents:4H altitude_proportional:f altitude_derivative:f"
    ),
    OptionTag.ALTITUDE: (
        "vision:i velocity:f reference:i raw:i acceleration:f observed:f observer:3f state:I"
        " estimated_velocity:2f estimated_state:I"
    ),
    OptionTag.VISION_RAW: "translation:3f",
    OptionTag.VISION_OF: "dx:5f dy:5f",
    OptionTag.VISION: (
        "state:I misc:i phi_trim:f phi_reference:f theta_trim:f theta_reference:f new_picture:i"
        " theta:f phi:f psi:f altitude:i time:I velocity:3f delta_phi:f delta_theta:f delta_psi:f"
        " gold_defined:I gold_reset:I gold_x:f gold_y:f"
    ),
    OptionTag.VISION_PERF: "szo:f corners:f compute:f tracking:f translation:f update:f custom:20f",
    OptionTag.TRACKERS_SEND: "locked:30i points:60i",
    OptionTag.VISION_DETECT: (
        "detected:I type:4I x:4I y:4I width:4I height:4I distance:4I orientation:4f rotation:36f"
        " translation:12f camera:4I"
    ),
    OptionTag.WATCHDOG: "watchdog:I",
    OptionTag.ADC_DATA_FRAME: "version:I frame:32B",
    OptionTag.VIDEO_STREAM: (
        "quantisation:B frame_size:I frame_number:I command_sequence:I command_gap:I"
        " command_gap_variance:f command_quality:I bitrate:I desired_bitrate:I data:5i"
        " tcp_queue:I fifo_queue:I"
    ),
    OptionTag.GAMES: "double_tap:I finish_line:I",
    OptionTag.PRESSURE_RAW: "up:i ut:h temperature:i pressure:i",
    OptionTag.MAGNETO: (
        "field:3h raw:3f rectified:3f offset:3f heading:f gyro_heading:f fused_heading:f"
        " calibrated:B state:I radius:f error_mean:f error_variance:f"
    ),
    OptionTag.WIND_SPEED: (
        "speed:f angle:f compensation_theta:f compensation_phi:f state:6f debug:3f"
    ),
    OptionTag.KALMAN_PRESSURE: (
        "offset:f altitude:f velocity:f angle_pwm:f angle_pressure:f ultrasound_offset:f"
        " ultrasound_prediction:f covariance_altitude:f covariance_pwm:f covariance_velocity:f"
        " ground_effect:I sum:f reject:I multisinus:f gaz_altitude:f flag_multisinus:I"
        " flag_multisinus_start:I"
    ),
    OptionTag.HDVIDEO_STREAM: (
        "state:I fifo_packets:I fifo_size:I usb_size:I usb_free:I frame:I usb_time:I"
    ),
    OptionTag.WIFI: "link_quality:I",
    OptionTag.GPS: (
        "latitude:d longitude:d elevation:d hdop:d available:i zero_validated:i wpt_validated:i"
        " latitude_0:d longitude_0:d latitude_fused:d longitude_fused:d state:I"
    ),
}


def _compiled(text: str) -> tuple[OptionField, ...]:
    fields, at = [], 0
    for part in text.split():
        name, _, code = part.partition(":")
        layout = struct.Struct(f"<{code}")
        fields.append(OptionField(name, at, layout))
        at += layout.size
    return tuple(fields)


LAYOUTS: Mapping[int, tuple[OptionField, ...]] = {
    int(tag): _compiled(text) for tag, text in _FIELDS.items()
}


def decoded(tag: int, data: bytes) -> dict[str, Value]:
    """Return the fields of an option by name; none for an unknown tag."""
    values: dict[str, Value] = {}
    for name, at, layout in LAYOUTS.get(tag, ()):
        if at + layout.size > len(data):
            break
        unpacked = layout.unpack_from(data, at)
        values[name] = unpacked[0] if len(unpacked) == 1 else unpacked
    return values
