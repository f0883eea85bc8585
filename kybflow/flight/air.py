"""How wind sets in."""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.geometry import Vec3, scale
from kybflow.flight.profiles import smoothstep


def rising(velocity: Vec3, rise: float) -> Callable[[float], Vec3]:
    """The wind so many seconds after it began: from nothing to `velocity` (m/s, world frame) within
    `rise` seconds, its speed as the quintic smoothstep (`kybflow.flight.profiles`)."""

    def wind(elapsed: float) -> Vec3:
        if elapsed >= rise:
            return velocity
        return scale(velocity, smoothstep(elapsed / rise)[1])

    return wind
