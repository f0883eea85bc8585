"""The charge of a battery that a hovering vehicle empties in the airframe's endurance.

Power goes with thrust^1.5 (momentum theory). Voltage falls with the charge by the airframe's
`voltage_spread` and with the load by a tenth of that at hover; rotor thrust goes with its square.
"""

from __future__ import annotations

from kybflow.world.vehicle_context import Airframe

FULL = 4.2 * 4
"""The voltage of a full pack of four cells."""


class BatteryCharge:
    """level: the voltage over that of a full battery. sag: part of the charge that is missing."""

    def __init__(self, airframe: Airframe, remaining: float) -> None:
        self.sag = 0.0
        self._spread = airframe.voltage_spread
        self._weight = airframe.hover_thrust
        self._per_second = 1.0 / airframe.endurance
        self._charge = remaining
        self.level = 1.0 - self._spread * (1.0 - remaining)

    @property
    def remaining(self) -> float:
        """0 to 1."""
        return max(0.0, self._charge - self.sag)

    @property
    def voltage(self) -> float:
        """Volts."""
        return FULL * self.level

    def drain(self, thrust: float, seconds: float) -> None:
        """Give `thrust` newtons for `seconds`."""
        load = max(0.0, thrust / self._weight) ** 1.5
        self._charge = max(0.0, self._charge - load * seconds * self._per_second)
        self.level = 1.0 - self._spread * (1.0 - self.remaining + 0.1 * load)
