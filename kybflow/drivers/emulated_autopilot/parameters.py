"""The parameters of an emulated autopilot, and the messages that read and write them.

If integers are sent bytewise, the float in the message holds the bytes of an INT32 (param_type 6).
Otherwise they are sent as plain floats, with their type in the type field.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

from kybflow.drivers.mavlink.protocol.framing import mavlink

REAL = mavlink.MAV_PARAM_TYPE_REAL32
INTEGER = mavlink.MAV_PARAM_TYPE_INT32


class EmulatedParameters:
    """All parameters by name, in the order of their indices.

    own: the firmware's defaults.
    changes: values that differ from them.
    bytewise: whether integers are sent bytewise.
    dangling: names to which requests are never answered, for tests.
    """

    def __init__(
        self, own: Mapping[str, float], changes: Mapping[str, float], *, bytewise: bool
    ) -> None:
        values = dict(sorted({**own, **changes}.items()))
        self._bytewise = bytewise
        known = {**values, **own}
        self._integers = {name for name, value in known.items() if isinstance(value, int)}
        self._values: dict[str, float] = {name: float(value) for name, value in values.items()}
        self.dangling: set[str] = set()

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def get(self, name: str, default: float = 0.0) -> float:
        return self._values.get(name, default)

    def handle(self, message: Any) -> list[Any]:
        """Return the replies to a PARAM_REQUEST_LIST, PARAM_REQUEST_READ or PARAM_SET; none for an
        unknown name."""
        kind = message.get_type()
        if kind == "PARAM_REQUEST_LIST":
            return [self._value_message(name) for name in self._values if name not in self.dangling]
        name = message.param_id
        name = (name.decode("ascii", "replace") if isinstance(name, bytes) else name).rstrip("\0")
        if kind == "PARAM_REQUEST_READ" and message.param_index >= 0:
            names = list(self._values)
            name = names[message.param_index] if message.param_index < len(names) else ""
        if name not in self._values or name in self.dangling:
            return []
        if kind == "PARAM_SET":
            self._values[name] = self._read(message.param_value, message.param_type)
        return [self._value_message(name)]

    def _read(self, value: float, kind: int) -> float:
        if self._bytewise and kind == INTEGER:
            return float(struct.unpack("<i", struct.pack("<f", value))[0])
        return float(value)

    def _value_message(self, name: str) -> Any:
        value, kind = self._values[name], INTEGER if name in self._integers else REAL
        if self._bytewise and kind == INTEGER:
            value = struct.unpack("<f", struct.pack("<i", round(value)))[0]
        index = list(self._values).index(name)
        return mavlink.MAVLink_param_value_message(
            name.encode(), value, kind, len(self._values), index
        )
