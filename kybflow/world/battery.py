"""The charge of a battery that lasts for the airframe's endurance in hover.

The power is proportional to thrust^1.5 (momentum theory). An empty battery has lost the airframe's
`voltage_spread`; the load in hover lowers the voltage by a tenth of that. Rotor thrust is
proportional to the square of the voltage.
"""

from __future__ import annotations

from kybflow.world.vehicle_context import Airframe

FULL = 4.2 * 4
"""The voltage of a full pack of four cells."""


class BatteryCharge:
    """The charge of one battery. level: the voltage relative to that of a full battery. sag: the
    missing share of the charge."""

    def __init__(self, airframe: Airframe, remaining: float) -> None:
        self.sag = 0.0
        self._spread = airframe.voltage_spread
        self._weight = airframe.hover_thrust
        self._per_second = 1.0 / airframe.endurance
        self._charge = remaining
        self.level = 1.0 - self._spread * (1.0 - remaining)

    @property
    def remaining(self) -> float:
        """The remaining charge, from 0 to 1."""
        return max(0.0, self._charge - self.sag)

    @property
    def voltage(self) -> float:
        return FULL * self.level

    def drain(self, thrust: float, seconds: float) -> None:
        """Use the charge that `thrust` (newtons) takes for `seconds`."""
        load = max(0.0, thrust / self._weight) ** 1.5
        self._charge = max(0.0, self._charge - load * seconds * self._per_second)
        self.level = 1.0 - self._spread * (1.0 - self.remaining + 0.1 * load)
