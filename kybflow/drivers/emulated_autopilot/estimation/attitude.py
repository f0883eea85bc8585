"""The emulated autopilot's own attitude, from its gyroscope, accelerometer and a heading seen.

The explicit complementary filter with bias of Mahony, Hamel and Pflimlin (IEEE TAC 2008, eq. 34).
World ENU, body FLU.
"""

from __future__ import annotations

from kybflow.core.geometry import (
    GRAVITY,
    ZERO,
    Quat,
    Vec3,
    add,
    conjugate,
    cross,
    from_heading,
    heading_of,
    integrate,
    multiply,
    norm,
    rotate,
    scale,
    sub,
    wrap,
)
from kybflow.core.signals import Imu

LEVELLING = 0.10
"""How fast the accelerometer levels the attitude, 1/s."""
LEARNING = LEVELLING**2 / 4.0
"""How fast the gyroscope's bias is learnt, 1/s^2."""
AIMING, AIMING_BIAS = 1.0, 0.1
"""How fast the heading follows the one that is seen, 1/s, and the bias about the vertical,
1/s^2."""
LIGHTEST, HEAVIEST = 0.5 * GRAVITY, 1.5 * GRAVITY
UP: Vec3 = (0.0, 0.0, 1.0)


class Attitude:
    """`value`: body to world. `rate`: the body's turn rate, less the bias, rad/s."""

    def __init__(self, heading: float) -> None:
        self.value: Quat = from_heading(heading)
        self.rate: Vec3 = ZERO
        self._bias: Vec3 = ZERO
        self._off = 0.0
        self._is_aimed = False

    @property
    def heading(self) -> float:
        return heading_of(self.value)

    def see(self, heading: float) -> None:
        """A heading was seen, by vision or by a compass; the first is taken as it is."""
        self._off = wrap(heading - self.heading)
        if not self._is_aimed or abs(self._off) > 1.0:
            turned = from_heading(self._off)
            self.value = multiply(turned, self.value)
            self._is_aimed, self._off = True, 0.0

    def lose(self) -> None:
        """No heading is seen any more."""
        self._off = 0.0

    def feel(self, imu: Imu) -> None:
        """Go on by what the inertial sensors felt."""
        up = rotate(conjugate(self.value), UP)
        force, size = imu.specific_force, norm(imu.specific_force)
        error = scale(cross(force, up), 1.0 / size) if LIGHTEST < size < HEAVIEST else ZERO
        learnt = add(scale(error, LEARNING), scale(up, AIMING_BIAS * self._off))
        self._bias = sub(self._bias, scale(learnt, imu.dt))
        self.rate = sub(imu.angular_velocity, self._bias)
        aimed = add(scale(error, LEVELLING), scale(up, AIMING * self._off))
        self.value = integrate(self.value, add(self.rate, aimed), imu.dt)
        self._off *= max(0.0, 1.0 - AIMING * imu.dt)
