"""Measures the noise of an IMU that rotors shake, if it is clearly more than declared.

The second difference, a - 2 b + c, of white samples with the variance s^2 has the variance 6 s^2,
and contains hardly any motion: body rates that follow rotors with a lag bend by 0.1 deg/s within 4
ms. White samples every dt seconds add the variance s^2 dt per second to a velocity or an angle.
Vibration at one frequency adds less than that, so the result is on the safe side.
"""

from __future__ import annotations

from kybflow.core.geometry import ZERO, Vec3
from kybflow.flight.fusion.covariance import ImuNoise

TIME = 0.5
"""Seconds over which the variance is averaged."""
CLEARLY = 4.0
"""Least ratio of the measured to the declared variance that counts as vibration."""


class Vibration:
    """Estimates the noise of an IMU from its samples."""

    def __init__(self, declared: ImuNoise) -> None:
        self._declared = declared
        self._force, self._turn = Scatter(), Scatter()

    def add_imu(self, force: Vec3, turn: Vec3, dt: float) -> None:
        """Add a specific force and a turn rate, measured over `dt` seconds."""
        self._force.see(force, dt)
        self._turn.see(turn, dt)

    @property
    def noise(self) -> ImuNoise:
        """The measured noise, or the declared noise unless the measured one is clearly larger."""
        p = self._declared
        velocity, attitude = (
            scatter.variance**0.5 if scatter.variance > CLEARLY * declared * declared else declared
            for scatter, declared in ((self._force, p.velocity), (self._turn, p.attitude))
        )
        return p._replace(velocity=velocity, attitude=attitude)


class Scatter:
    """Measures the scatter of a quantity's samples. variance: the variance per axis that it adds to
    the quantity's integral in one second."""

    __slots__ = ("_before", "_last", "_seen", "variance")

    def __init__(self) -> None:
        self.variance = 0.0
        self._before = self._last = ZERO
        self._seen = 0

    def see(self, sample: Vec3, dt: float) -> None:
        """Add a sample that covers `dt` seconds."""
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = self._before, self._last, sample
        if self._seen > 1:
            x, y, z = ax - 2.0 * bx + cx, ay - 2.0 * by + cy, az - 2.0 * bz + cz
            share = dt / (TIME + dt)
            self.variance += share * (dt * (x * x + y * y + z * z) / 18.0 - self.variance)
        else:
            self._seen += 1
        self._before, self._last = self._last, sample
