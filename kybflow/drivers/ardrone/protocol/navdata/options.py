"""The options of navigation data that a flight needs, as typed values.

Extra bytes of an option are ignored; an option that is too short counts as missing. Drone frame: x
forward, y right, z down, psi clockwise.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import NamedTuple

from kybflow.drivers.ardrone.protocol.navdata.layouts import OptionTag
from kybflow.drivers.ardrone.protocol.navdata.state import Phase, phase_of


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
WRAPS = 2048.0
"""Seconds after which the time of option TIME wraps."""


def demo(options: Mapping[int, bytes]) -> Demo | None:
    data = options.get(OptionTag.DEMO, b"")
    if len(data) < _DEMO.size:
        return None
    state, battery, theta, phi, psi, altitude, vx, vy, vz = _DEMO.unpack_from(data)
    return Demo(phase_of(state), battery, theta, phi, psi, altitude, (vx, vy, vz))


def write_demo(values: Demo, minor: int = 0, frame: int = 0) -> tuple[int, bytes]:
    state = values.phase << 16 | minor
    data = _DEMO.pack(
        state, values.battery, values.pitch, values.roll, values.heading, values.altitude,
        *values.velocity,
    )  # fmt: skip
    return OptionTag.DEMO, (data + _U32.pack(frame & 0xFFFF_FFFF)).ljust(_DEMO_SIZE, b"\0")


def drone_time(options: Mapping[int, bytes]) -> float | None:
    """Return the drone's time in seconds, which wraps after `WRAPS`; None without the option. The
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
