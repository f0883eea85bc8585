"""What the fusion passes on: what was measured, the filter at one time, what is believed of one."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from kybflow.core.geometry import Quat, Vec3
from kybflow.core.signals import Time
from kybflow.flight.fusion.covariance import Matrix, Nominal


class Fix(NamedTuple):
    """What was measured from outside. noise: covariance of the position (3 x 3), or of a pose (6 x
    6: position in the world, then rotation in the body)."""

    time: Time
    position: Vec3
    attitude: Quat | None
    noise: Matrix

    @property
    def deviation(self) -> float:
        """Of the position along the worst axis, metres."""
        variance = self.noise.item
        return sqrt(max(variance(0, 0), variance(1, 1), variance(2, 2)))

    def innovation(self, nominal: Nominal) -> list[float]:
        """Measured less predicted; of the attitude the rotation vector in the body, as twice the
        tangent of half the angle, which `integrate` takes back exactly."""
        (mx, my, mz), (px, py, pz) = self.position, nominal.position
        moved = [mx - px, my - py, mz - pz]
        if self.attitude is None:
            return moved
        (w, x, y, z), (mw, nx, ny, nz) = nominal.attitude, self.attitude
        turned = w * mw + x * nx + y * ny + z * nz
        two = 2.0 / (turned if abs(turned) > 0.1 else 0.1)
        return [
            *moved,
            two * (w * nx - x * mw - y * nz + z * ny),
            two * (w * ny + x * nz - y * mw - z * nx),
            two * (w * nz - x * ny + y * nx - z * mw),
        ]


class State(NamedTuple):
    """The filter at one time. fused: when the newest measurement in it was true. passed: how many
    have passed since it began. doubted: since when every measurement was refused. missed: what was
    predicted for the last of them; off: how far from there it was, metres."""

    nominal: Nominal
    covariance: Matrix
    fused: Time
    passed: int = 1
    doubted: Time | None = None
    missed: Nominal | None = None
    off: float = 0.0

    @property
    def deviation(self) -> float:
        """Of the position along its worst axis, metres."""
        variance = self.covariance.item
        return sqrt(max(variance(0, 0), variance(1, 1), variance(2, 2)))


class Belief(NamedTuple):
    """The state at a time. rates: of the body. spread, turned: standard deviations of position and
    attitude along the worst axis."""

    nominal: Nominal
    rates: Vec3
    spread: float
    turned: float
