"""What a serial line carries, and how often one vehicle may be asked to speak on it.

A byte is ten bits on the line, so B baud carry B / 10 bytes a second each way. Streams get half of
that: all of them come rarer by the same factor, but not rarer than once a second, where they would
take more. The other half is for parameters, answers and texts, and for a radio that can only go one
way at a time. Set-points and poses are not made rarer unasked: where they don't get through, the
preflight says so. Other wires carry what they are given.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from kybflow.drivers.mavlink.protocol.layout import LAYOUTS, NUMBERS
from kybflow.drivers.mavlink.protocol.signing import SIGNATURE
from kybflow.drivers.mavlink.transport.address import read_address
from kybflow.parts import Check

if TYPE_CHECKING:
    from kybflow.drivers.mavlink import MavlinkParams

BITS = 10
HEAD = 12
"""Bytes of a frame beside its fields, but for its signature."""
STREAMS, OURS = 0.5, 0.8
"""What share of a line streams are given, and how much of it may be what we send."""
SLOWEST = 1.0


class Capacity:
    """Of the line to one vehicle. params: how the mission has it. `line`: bytes a second each way,
    None where that is no matter."""

    def __init__(self, params: MavlinkParams) -> None:
        place = None if params.address is None else read_address(params.address)
        is_serial = place is not None and place.kind == "serial"
        self.line = place.number / BITS if place is not None and is_serial else None
        self._params = params
        self._head = HEAD + (0 if params.key is None else SIGNATURE)

    def fitting(self, rates: Mapping[str, float]) -> dict[str, float]:
        """These streams, Hz, as often as the line carries them."""
        if self.line is None:
            return dict(rates)
        factor = min(1.0, STREAMS * self.line / self._load(rates))
        return {name: min(rate, max(factor * rate, SLOWEST)) for name, rate in rates.items()}

    def check(self) -> list[Check]:
        """The preflight's line about it, where there is one."""
        if self.line is None:
            return []
        params = self._params
        sent, way_out = {"SET_POSITION_TARGET_LOCAL_NED": params.rate}, "a lower `rate`"
        if params.position == "outside":
            sent["ODOMETRY"], way_out = params.vision_rate, "a lower `rate` and `vision_rate`"
        load = self._load(sent)
        found = f"{load:.0f} bytes a second are sent to it, the line carries {self.line:.0f}"
        if load <= OURS * self.line:
            return [Check("serial line", True, found)]
        way_out = f"set {way_out}, or a higher baud rate on both sides"
        return [Check("serial line", False, f"{found}: {way_out}", waits=False)]

    def _load(self, rates: Mapping[str, float]) -> float:
        """Bytes a second."""
        sizes = {name: int(LAYOUTS[NUMBERS[name]].size) for name in rates if name in NUMBERS}
        return sum(rates[name] * (self._head + size) for name, size in sizes.items())
