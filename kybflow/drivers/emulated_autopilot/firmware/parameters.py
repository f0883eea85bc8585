"""The parameters of an emulated autopilot, and how they travel.

PX4's integers travel as the bytes of an INT32 in the float (param_type 6), ArduPilot's as plain
floats with the type beside them.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from kybflow.drivers.emulated_autopilot.firmware.firmware import Firmware

REAL = mavlink.MAV_PARAM_TYPE_REAL32
INTEGER = mavlink.MAV_PARAM_TYPE_INT32


class Parameters:
    """All parameters by name, in the order of their indices. `dangling`: names that are asked for
    but never answered, for tests."""

    def __init__(self, firmware: Firmware, changes: Mapping[str, float]) -> None:
        values = dict(sorted({**firmware.parameters, **changes}.items()))
        self._bytewise = firmware.bytewise
        known = {**values, **firmware.parameters}
        self._integers = {name for name, value in known.items() if isinstance(value, int)}
        self._values: dict[str, float] = {name: float(value) for name, value in values.items()}
        self.dangling: set[str] = set()

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def get(self, name: str, default: float = 0.0) -> float:
        return self._values.get(name, default)

    def hear(self, message: Any) -> list[Any]:
        """The answers to PARAM_REQUEST_LIST, PARAM_REQUEST_READ and PARAM_SET; none to a name that
        it doesn't have."""
        kind = message.get_type()
        if kind == "PARAM_REQUEST_LIST":
            return [self._said(name) for name in self._values if name not in self.dangling]
        name = _name(message.param_id)
        if kind == "PARAM_REQUEST_READ" and message.param_index >= 0:
            names = list(self._values)
            name = names[message.param_index] if message.param_index < len(names) else ""
        if name not in self._values or name in self.dangling:
            return []
        if kind == "PARAM_SET":
            self._values[name] = self._read(message.param_value, message.param_type)
        return [self._said(name)]

    def _read(self, value: float, kind: int) -> float:
        if self._bytewise and kind == INTEGER:
            return float(struct.unpack("<i", struct.pack("<f", value))[0])
        return float(value)

    def _said(self, name: str) -> Any:
        value, kind = self._values[name], INTEGER if name in self._integers else REAL
        if self._bytewise and kind == INTEGER:
            value = struct.unpack("<f", struct.pack("<i", round(value)))[0]
        index = list(self._values).index(name)
        return mavlink.MAVLink_param_value_message(
            name.encode(), value, kind, len(self._values), index
        )


def _name(given: str | bytes) -> str:
    text = given.decode("ascii", "replace") if isinstance(given, bytes) else given
    return text.rstrip("\0")
