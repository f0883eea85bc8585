"""The repulsion of TeleKyb's obstacle potential.

An obstacle at the distance d from an ellipsoid around the vehicle, along the line to it, repels the
vehicle with the speed

    s(d) = g (pi/2) / (d0 - dm) (cot z + z - pi/2),    z = (pi/2) (d - dm) / (d0 - dm),

which is zero from d0 on and saturates below dm, and inside the ellipsoid. Contributions are added
and the sum is limited, so that their order doesn't matter; TeleKyb's running average forgot what
came before an obstacle out of reach. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import pi, sqrt, tan
from typing import NamedTuple

from kybflow.core.geometry import ZERO, Vec3, add, scale
from kybflow.flight.avoidance.surroundings import Hazard
from kybflow.flight.governor import shortened


class Potential(NamedTuple):
    """The parameters of the potential. level, above: semi-axes of the ellipsoid. nearest, farthest:
    the distances dm and d0. gain: the factor g. saturation: the largest speed of repulsion, m/s."""

    level: float
    above: float
    nearest: float
    farthest: float
    gain: float
    saturation: float

    @property
    def reach(self) -> float:
        """The distance beyond which nothing repels in any direction."""
        return self.farthest + max(self.level, self.above)


def repulsion(distance: float, potential: Potential) -> float:
    """Return the speed (m/s) away from something at this distance from the ellipsoid."""
    if distance >= potential.farthest:
        return 0.0
    if distance <= potential.nearest:
        return potential.saturation
    steepness = 0.5 * pi / (potential.farthest - potential.nearest)
    z = steepness * (distance - potential.nearest)
    return min(potential.gain * steepness * (1.0 / tan(z) + z - 0.5 * pi), potential.saturation)


def push(hazards: Iterable[Hazard], potential: Potential) -> Vec3:
    """Return the velocity away from everything near; the object ZERO if nothing repels."""
    whole = ZERO
    for hazard in hazards:
        x, y, z = hazard.outward
        radius = 1.0 / sqrt((x * x + y * y) / potential.level**2 + z * z / potential.above**2)
        speed = repulsion(hazard.room - radius, potential)
        if speed > 0.0:
            whole = add(whole, scale(hazard.outward, speed))
    return whole if whole is ZERO else shortened(whole, potential.saturation)
