"""Reading and writing the parameters of an autopilot, by name, a few at a time.

A value is a float32 in the message. Some firmwares send an integer bytewise: the four bytes of the
float are those of the integer. Others send it as a plain float. A parameter counts as missing if
three requests are not answered, or if the autopilot reports so (PARAM_ERROR). It is then requested
by its name in other firmware versions, if there is one. A value counts as written once the
autopilot sends it back.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from math import isnan
from types import MappingProxyType

from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.protocol.framing import Message, mavlink

MOST_TRIES = 3
FIRST_WAIT: Time = NS // 2
AT_ONCE = 5
"""The largest number of unanswered requests at a time."""
DOES_NOT_EXIST = mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
ERRORS = {
    mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE: "out of its range",
    mavlink.MAV_PARAM_ERROR_PERMISSION_DENIED: "not permitted",
    mavlink.MAV_PARAM_ERROR_COMPONENT_NOT_FOUND: "no such component",
    mavlink.MAV_PARAM_ERROR_READ_ONLY: "read-only",
}
WHOLE = {
    mavlink.MAV_PARAM_TYPE_UINT8: "<B3x", mavlink.MAV_PARAM_TYPE_INT8: "<b3x",
    mavlink.MAV_PARAM_TYPE_UINT16: "<H2x", mavlink.MAV_PARAM_TYPE_INT16: "<h2x",
    mavlink.MAV_PARAM_TYPE_UINT32: "<I", mavlink.MAV_PARAM_TYPE_INT32: "<i",
}  # fmt: skip
"""The format (`struct`) in which the four bytes hold an integer of each MAV_PARAM_TYPE."""


class _Exchange:
    """A parameter that is being read, or written if `value` is not None. `next`: when the request
    is sent again; 0 before the first time."""

    def __init__(self, value: float | None) -> None:
        self.value = value
        self.tries = 0
        self.next: Time = 0

    def begin_anew(self) -> None:
        self.tries, self.next = 0, 0


class AutopilotParameters:
    """The requested parameters of one autopilot.

    bytewise: whether integers are sent bytewise.
    target: the autopilot's system and component id.
    renamed: names in other firmware versions, by the names used here.
    values: the newest values, by name.
    missing: the names of parameters that don't exist.
    refused: why a written value was not accepted, by name; `values` holds the value in force.
    """

    def __init__(
        self,
        bytewise: bool,
        *,
        target: tuple[int, int],
        renamed: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.values: dict[str, float] = {}
        self.missing: set[str] = set()
        self.refused: dict[str, str] = {}
        self._changed: list[tuple[str, float, float]] = []
        self._bytewise, self._target = bytewise, target
        self._renamed, self._ours = renamed, {there: ours for ours, there in renamed.items()}
        self._names: dict[str, str] = {}
        self._types: dict[str, int] = {}
        self._exchanges: dict[str, _Exchange] = {}

    def read(self, names: Iterable[str], now: Time, again: bool = False) -> None:
        """Read these parameters, except those already known or known to be missing; with `again`,
        read those as well."""
        for name in names:
            if name in self._exchanges:
                continue
            if again:
                self.missing.discard(name)
            elif name in self.values or name in self.missing:
                continue
            self._exchanges[name] = _Exchange(None)

    def write(self, name: str, value: float, now: Time) -> None:
        """Write a parameter. If its type is unknown, it is read first."""
        self.refused.pop(name, None)
        self.missing.discard(name)
        self._exchanges[name] = _Exchange(rounded(value))

    def called(self, name: str) -> str:
        """Return the autopilot's name of a parameter."""
        return self._names.get(name, name)

    def is_complete(self, names: Iterable[str]) -> bool:
        """Return whether no reply about these parameters is outstanding."""
        return not any(name in self._exchanges for name in names)

    def handle(self, message: Message, now: Time) -> None:
        """Handle a PARAM_VALUE or PARAM_ERROR; other messages are ignored."""
        kind = message.get_type()
        if kind == "PARAM_VALUE":
            self._value(message)
        elif kind == "PARAM_ERROR":
            name = self._named(message)
            if (exchange := self._exchanges.pop(name, None)) is None:
                return
            if message.error == DOES_NOT_EXIST:
                self._forget(name, exchange)
            else:
                self.refused[name] = ERRORS.get(message.error, f"error {message.error}")

    def take_changed(self) -> list[tuple[str, float, float]]:
        """Return name, old and new value of each parameter that has changed since the last call
        without being written by us."""
        if not self._changed:
            return []
        changed, self._changed = self._changed, []
        return changed

    def due(self, now: Time) -> list[Message]:
        """Return the messages to send now, and give up unanswered requests. Must be called every
        tick."""
        if not self._exchanges:
            return []
        for name, exchange in list(self._exchanges.items()):
            if exchange.tries >= MOST_TRIES and now >= exchange.next:
                del self._exchanges[name]
                if exchange.value is None or name not in self._types:
                    self._forget(name, exchange)
                else:
                    self.refused[name] = f"it stays at {self.values[name]:g}"
        under_way = list(self._exchanges.items())[:AT_ONCE]
        messages = []
        for name, exchange in under_way:
            if now < exchange.next:
                continue
            exchange.next = now + (FIRST_WAIT << exchange.tries)
            exchange.tries += 1
            sort, there = self._types.get(name), self.called(name).encode()
            if exchange.value is None or sort is None:
                message = mavlink.MAVLink_param_request_read_message(*self._target, there, -1)
            else:
                on_wire = self._encoded(exchange.value, sort)
                message = mavlink.MAVLink_param_set_message(*self._target, there, on_wire, sort)
            messages.append(message)
        return messages

    def _value(self, message: Message) -> None:
        name = self._named(message)
        exchange = self._exchanges.get(name)
        if exchange is None and name not in self.values:
            return
        is_first = name not in self._types
        self._types[name] = message.param_type
        before, value = self.values.get(name), self._decoded(message)
        self.values[name] = value
        is_ours = exchange is not None and exchange.value is not None
        if before is not None and not is_ours and not is_same(before, value):
            self._changed.append((name, before, value))
        if exchange is None:
            return
        if exchange.value is None or is_same(exchange.value, value):
            del self._exchanges[name]
        elif is_first:
            exchange.begin_anew()  # now that its type is known

    def _named(self, message: Message) -> str:
        """Return our name of the parameter in a message."""
        name = name_in(message)
        return self._ours.get(name, name)

    def _forget(self, name: str, exchange: _Exchange) -> None:
        """Handle the report that no parameter has this name: request the parameter by its other
        name, or record it as missing after that."""
        if name in self._renamed and name not in self._names:
            self._names[name] = self._renamed[name]
            exchange.begin_anew()
            self._exchanges[name] = exchange
            return
        self._names.pop(name, None)
        self.missing.add(name)
        self.values.pop(name, None)
        self._types.pop(name, None)

    def _decoded(self, message: Message) -> float:
        value = float(message.param_value)
        if not self._bytewise or message.param_type not in WHOLE:
            return value
        (whole,) = struct.unpack(WHOLE[message.param_type], struct.pack("<f", value))
        return float(whole)

    def _encoded(self, value: float, sort: int) -> float:
        if not self._bytewise or sort not in WHOLE:
            return value
        (on_wire,) = struct.unpack("<f", struct.pack(WHOLE[sort], round(value)))
        return float(on_wire)


def rounded(value: float) -> float:
    """Return `value` rounded to the precision of a float32."""
    (near,) = struct.unpack("<f", struct.pack("<f", value))
    return float(near)


def is_same(one: float, other: float) -> bool:
    """Return whether two values are equal as float32; NaN equals NaN."""
    return rounded(one) == rounded(other) or (isnan(one) and isnan(other))


def name_in(message: Message) -> str:
    """Return the parameter name in a message."""
    name: str = message.param_id
    return name.split("\0", maxsplit=1)[0]
