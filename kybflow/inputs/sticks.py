"""Steer with a pilot's transmitter, as a vehicle reports it (RC_CHANNELS, MANUAL_CONTROL).

The vehicle reports ten times a second what its receiver gets, so the transmitter need not be
connected to this computer. The vehicle must be in a mode that follows setpoints; the pilot takes
over at any time with the mode switch. `pitch` is forward, `roll` to the right, `yaw` to the left,
and `throttle` up from its middle. The switches are the buttons `switch1`, `switch2` and so on, held
while they are up; `dead_man: switch2` makes one of them the dead-man switch. The input is silent if
the vehicle receives no transmitter.

A deflection is measured from the edge of its dead zone, as for `gamepad`.
"""

from __future__ import annotations

from kybflow.core.signals import InputReading, Sticks, Time
from kybflow.core.units import Ratio
from kybflow.inputs.deflection import deflection
from kybflow.parts import AXES, Input, InputLink, param, params
from kybflow.parts.input import SticksOf

_SWITCHES = 14
_ON_ABOVE = 0.5


@params
class SticksInputParams:
    vehicle: str = param("The vehicle that reports them.", names="vehicle", read_only=True)
    dead_zone: Ratio = param(
        "Deflection that counts as zero.", default=0.08, at_least=0.0, at_most=0.5
    )


class SticksInput(Input[SticksInputParams]):
    reported_as = Sticks

    @classmethod
    def real_time(cls, params: SticksInputParams) -> bool:
        return False

    @classmethod
    def buttons(cls, params: SticksInputParams) -> tuple[str, ...]:
        return tuple(f"switch{i}" for i in range(1, _SWITCHES + 1))

    @classmethod
    def open(cls, params: SticksInputParams, sticks_of: SticksOf) -> InputLink:
        return SticksLink(params, sticks_of)


class SticksLink(InputLink):
    """Reads the sticks that the vehicle reported last."""

    def __init__(self, params: SticksInputParams, sticks_of: SticksOf) -> None:
        self._params, self._sticks_of = params, sticks_of
        self._last: Sticks | None = None
        self._reading: InputReading | None = None

    def read(self, now: Time) -> InputReading | None:
        sticks = self._sticks_of(self._params.vehicle)
        if sticks is not None and sticks is not self._last:
            raw = (sticks.pitch, -sticks.roll, 2.0 * sticks.throttle - 1.0, sticks.yaw)
            values = (deflection(value, self._params.dead_zone) for value in raw)
            up = frozenset(f"switch{i}" for i, x in enumerate(sticks.switches, 1) if x > _ON_ABOVE)
            axes = dict(zip(AXES, values, strict=True))
            self._last, self._reading = sticks, InputReading(sticks.time, axes, up)
        return self._reading

    def close(self) -> None:
        """Do nothing: the vehicle's link belongs to its driver."""
