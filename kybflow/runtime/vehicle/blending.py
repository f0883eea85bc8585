"""Keeps the estimate continuous when a vehicle changes its estimator.

The last output, extrapolated by a tick, differs from the new estimate by x0 in position and v0 in
velocity. Both differences are added to the new estimate and decay, critically damped. Thus the
output starts at the last position and velocity, and its velocity is always the derivative of its
position:

    x(t) = (x0 + (v0 + n x0) t) exp(-n t),   n = 1.5 1/s

With v0 = 0 the offset moves by at most n / e = 0.55 of x0 per second; a tracker with TeleKyb's
gains (9.0, 7.5) follows that within 2 cm for the largest x0. The heading is blended likewise, by a
rotation about world z; the body rates stay unchanged.

If the last output is more than 0.3 m or 20 degrees off the new estimate, it was wrong: nothing is
added, and the estimate steps. The processor `position_error` detects the step and brakes at the new
position. 0.3 m is also the distance within which a new behavior trusts the last setpoint
(`Entry.position`). A velocity difference of more than 0.5 m/s is treated as noise: the new velocity
is used at once, and the position offset decays with v0 = 0.
"""

from __future__ import annotations

from math import exp

from kybflow.core.geometry import (
    ZERO,
    Vec3,
    add,
    from_heading,
    heading_of,
    multiply,
    norm,
    scale,
    sub,
    wrap,
)
from kybflow.core.signals import NS, Estimate, Time
from kybflow.core.units import DEG

DECAY = 1.5
FARTHEST, FASTEST, WIDEST = 0.3, 0.5, 20.0 * DEG
OVER = 8.0
"""Seconds after which a blend ends; 20 micrometres of the largest offset are left then."""


class EstimateBlend:
    """The decaying offset after a change of estimator at `time`."""

    __slots__ = ("_position", "_pull", "_turn", "_velocity", "time")

    def __init__(self, time: Time, position: Vec3, velocity: Vec3, turn: float) -> None:
        self.time = time
        self._position, self._velocity, self._turn = position, velocity, turn
        self._pull = add(velocity, scale(position, DECAY))

    @classmethod
    def between(cls, last: Estimate, new: Estimate) -> tuple[float, EstimateBlend | None]:
        """Return the distance (m) from `new` to the extrapolated `last` output, and the blend
        between them, or None if the estimate must step."""
        gone = (new.time - last.time) / NS
        position = sub(add(last.position, scale(last.velocity, gone)), new.position)
        velocity = sub(last.velocity, new.velocity)
        turn = wrap(heading_of(last.attitude) - heading_of(new.attitude))
        far = norm(position)
        if far > FARTHEST or abs(turn) > WIDEST:
            return far, None
        if norm(velocity) > FASTEST:
            velocity = ZERO
        return far, cls(new.time, position, velocity, turn)

    def applied(self, estimate: Estimate) -> Estimate:
        """Return `estimate` with the offset that remains at its time added."""
        t = (estimate.time - self.time) / NS
        fading = exp(-DECAY * t)
        pull = self._pull
        x = scale(add(self._position, scale(pull, t)), fading)
        v = scale(sub(self._velocity, scale(pull, DECAY * t)), fading)
        turn = self._turn * (1.0 + DECAY * t) * fading
        return estimate._replace(
            position=add(estimate.position, x),
            velocity=add(estimate.velocity, v),
            attitude=multiply(from_heading(turn), estimate.attitude),
        )

    def is_over(self, now: Time) -> bool:
        return (now - self.time) / NS > OVER
