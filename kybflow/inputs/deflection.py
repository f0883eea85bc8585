"""The dead zone and the expo curve of a stick."""

from __future__ import annotations


def deflection(value: float, zone: float, expo: float = 0.0) -> float:
    """Return a deflection, -1 to 1, measured from the edge of its dead zone and shaped by an expo
    curve:

        s = (|v| - zone) / (1 - zone),    (1 - expo) s + expo s^3,    with the sign of v.
    """
    size = max(0.0, abs(value) - zone) / (1.0 - zone)
    soft = (1.0 - expo) * size + expo * size**3
    return -soft if value < 0.0 < soft else soft
