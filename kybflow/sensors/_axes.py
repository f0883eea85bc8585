"""A tracker's units and axes to the world's: the only place where they are converted.

`z_up`: x, y, z are the world's. `y_up`: x to the right, y up, z towards the viewer (Motive's
default), so with R the quarter turn about x that lifts y to z, p_world = R p and
q_world = R q R^-1: a body whose own axes were defined parallel to the tracker's while its nose
pointed along x is level and heads east.
"""

from __future__ import annotations

from math import isfinite, sqrt
from typing import Literal

from kybflow.core.geometry import Quat, Vec3

Units = Literal["m", "mm"]
Axes = Literal["z_up", "y_up"]
_METRES = {"m": 1.0, "mm": 1e-3}


def to_world(position: Vec3, attitude: Quat, units: Units, axes: Axes) -> tuple[Vec3, Quat] | None:
    """The pose in the world, the attitude of unit length; None for what is no pose: not finite, or
    no rotation, as a tracker writes for a body that it has lost."""
    n = sqrt(sum(x * x for x in attitude))
    if not (isfinite(n) and all(map(isfinite, position)) and 0.9 < n < 1.1):
        return None
    s = _METRES[units]
    (x, y, z), (qw, qx, qy, qz) = position, attitude
    if axes == "y_up":
        y, z, qy, qz = -z, y, -qz, qy
    return (s * x, s * y, s * z), (qw / n, qx / n, qy / n, qz / n)
