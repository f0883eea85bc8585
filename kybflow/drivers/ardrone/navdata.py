"""Navigation data: datagrams with a state mask and options, little-endian and packed.

A datagram consists of u32 header 0x55667788, u32 state mask, u32 sequence and u32 vision flag; then
options of u16 tag, u16 size (including these four bytes) and data; finally the option 0xFFFF with
the sum of all bytes before it. The parser relies on the sizes in the datagram, since those in the
SDK's headers don't hold for every firmware.

`decoded` returns the fields of any option; missing fields of a shorter option are left out. The
options that a flight needs also have typed values, such as `demo`; an option that is too short for
them counts as missing. Extra bytes are ignored. Values are as on the wire, in the drone's frame (x
forward, y right, z down, psi clockwise); `telemetry` converts them.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from enum import IntEnum, IntFlag
from typing import NamedTuple


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
    DroneState.USER_EMERGENCY: "an emergency was requested",
    DroneState.TIMER_ELAPSED: "its timer has elapsed",
    DroneState.ANGLES_OUT_OF_RANGE: "it has tilted too far",
    DroneState.WIND: "the wind is too strong",
    DroneState.ULTRASOUND_DEAF: "its ultrasound hears nothing",
    DroneState.CUT_OUT: "a motor was stopped by force",
    DroneState.COMMUNICATION_LOST: "it has lost the connection",
    DroneState.EMERGENCY: "it is in emergency, its rotors stopped",
}
"""The bits that are reported when they become set, with their descriptions."""


def phase_of(control_state: int) -> Phase:
    """Return the flight phase; DEFAULT for an unknown one."""
    major = control_state >> 16
    return Phase(major) if major in Phase.__members__.values() else Phase.DEFAULT


def in_words(state: DroneState) -> list[str]:
    return [words for bit, words in ALARMS.items() if state & bit]


HEADER = 0x55667788
CHECKSUM = 0xFFFF
_HEAD, _OPTION, _SUM = struct.Struct("<IIII"), struct.Struct("<HH"), struct.Struct("<I")
SHORTEST = _HEAD.size + _OPTION.size + _SUM.size


class Packet(NamedTuple):
    """One parsed datagram. options: the data of each option by its tag."""

    state: DroneState
    sequence: int
    vision: int
    options: Mapping[int, bytes]


class Malformed(ValueError):
    """The datagram is not navigation data; the message gives the reason."""


def read_packet(data: bytes) -> Packet:
    """Return the parsed datagram. Raises Malformed."""
    if len(data) < SHORTEST:
        raise Malformed("too short")
    header, state, sequence, vision = _HEAD.unpack_from(data)
    if header != HEADER:
        raise Malformed("another header")
    options: dict[int, bytes] = {}
    at = _HEAD.size
    while at + _OPTION.size <= len(data):
        tag, size = _OPTION.unpack_from(data, at)
        if size < _OPTION.size or at + size > len(data):
            raise Malformed("an option that extends beyond the datagram")
        if tag == CHECKSUM:
            if size != _OPTION.size + _SUM.size:
                raise Malformed("a checksum of another size")
            if _SUM.unpack_from(data, at + _OPTION.size)[0] != sum(data[:at]):
                raise Malformed("a wrong checksum")
            return Packet(DroneState(state), sequence, vision, options)
        options[tag] = data[at + _OPTION.size : at + size]
        at += size
    raise Malformed("no checksum")


def write_packet(
    state: DroneState, sequence: int, options: Iterable[tuple[int, bytes]] = ()
) -> bytes:
    data = _HEAD.pack(HEADER, int(state), sequence & 0xFFFF_FFFF, 0)
    for tag, content in options:
        data += _OPTION.pack(tag, _OPTION.size + len(content)) + content
    return data + _OPTION.pack(CHECKSUM, _OPTION.size + _SUM.size) + _SUM.pack(sum(data))


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


class Demo(NamedTuple):
    """The option of the demo mode. battery: percent. pitch, roll, heading: theta, phi and psi in
    milli-degrees, positive nose up, right side down and clockwise. altitude: mm. velocity: mm/s,
    body."""

    phase: Phase
    battery: int
    pitch: float
    roll: float
    heading: float
    altitude: int
    velocity: tuple[float, float, float]


class PhysMeasures(NamedTuple):
    """Measurements of the inertial sensors. acceleration: mg, z down, -1000 at rest. rates:
    deg/s."""

    acceleration: tuple[float, float, float]
    rates: tuple[float, float, float]


_DEMO = struct.Struct("<IIfffifff")
_U32 = struct.Struct("<I")
_PHYS = struct.Struct("<fHffffff")
_DEMO_SIZE, _PHYS_SIZE, _RAW_SIZE, _RAW_BATTERY_AT = 144, 42, 48, 16
WRAP_S = 2048.0
"""Seconds after which the time of option TIME wraps."""


def demo(options: Mapping[int, bytes]) -> Demo | None:
    data = options.get(OptionTag.DEMO, b"")
    if len(data) < _DEMO.size:
        return None
    state, battery, theta, phi, psi, altitude, vx, vy, vz = _DEMO.unpack_from(data)
    return Demo(phase_of(state), battery, theta, phi, psi, altitude, (vx, vy, vz))


def write_demo(values: Demo, frame: int = 0) -> tuple[int, bytes]:
    data = _DEMO.pack(
        values.phase << 16, values.battery, values.pitch, values.roll, values.heading,
        values.altitude, *values.velocity,
    )  # fmt: skip
    return OptionTag.DEMO, (data + _U32.pack(frame & 0xFFFF_FFFF)).ljust(_DEMO_SIZE, b"\0")


def drone_time(options: Mapping[int, bytes]) -> float | None:
    """Return the drone's time in seconds, which wraps after `WRAP_S`; None without the option. The
    option has 11 bits of seconds and 21 of microseconds."""
    data = options.get(OptionTag.TIME, b"")
    if len(data) < _U32.size:
        return None
    packed = _U32.unpack_from(data)[0]
    return float((packed >> 21) + (packed & 0x1FFFFF) * 1e-6)


def write_time(microseconds: int) -> tuple[int, bytes]:
    seconds, rest = divmod(microseconds, 1_000_000)
    return OptionTag.TIME, _U32.pack((seconds & 0x7FF) << 21 | rest)


def phys_measures(options: Mapping[int, bytes]) -> PhysMeasures | None:
    data = options.get(OptionTag.PHYS_MEASURES, b"")
    if len(data) < _PHYS.size:
        return None
    _, _, ax, ay, az, gx, gy, gz = _PHYS.unpack_from(data)
    return PhysMeasures((ax, ay, az), (gx, gy, gz))


def write_phys_measures(values: PhysMeasures) -> tuple[int, bytes]:
    data = _PHYS.pack(40.0, 0, *values.acceleration, *values.rates)
    return OptionTag.PHYS_MEASURES, data.ljust(_PHYS_SIZE, b"\0")


def write_raw_measures(millivolts: int) -> tuple[int, bytes]:
    """Return the raw measures, all zero except the battery voltage."""
    data = b"\0" * _RAW_BATTERY_AT + _U32.pack(millivolts)
    return OptionTag.RAW_MEASURES, data.ljust(_RAW_SIZE, b"\0")
