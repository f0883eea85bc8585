"""Whether a vehicle touches a surface, from poses alone.

No vehicle has a sensor for contact. A vehicle that is commanded to press against a surface touches
it if its bumper is within `NEAR` of the surface, in front of it, and doesn't come nearer although
it leans towards it: the relative speed along the normal is below `STILL`, or the bumper seems to be
inside the surface, which that of a tilted vehicle is by some millimetres. It no longer touches if
it is farther away than `APART`. Both must last for `SURE_S`, as poses are noisy. Metres, world
frame.
"""

from __future__ import annotations

from kybflow.core.geometry import Vec3, dot, sub
from kybflow.core.signals import NS, Estimate, Time
from kybflow.world.objects import Face

NEAR, APART = 0.02, 0.05
STILL = 0.03
UNSEEN_NS: Time = NS // 5
"""How old the last sight of an object may be while vehicles touch it, ns."""
SURE_S = 0.1
"""For how long contact must be seen, or not be seen, s."""


class TouchSense:
    """Infers the contact of a vehicle with a surface. reach: the radius of its bumper, m. touches:
    whether it touches now."""

    def __init__(self, reach: float) -> None:
        self.touches = False
        self._reach, self._otherwise = reach, 0.0

    def gap(self, face: Face, position: Vec3) -> float:
        """Return the distance of the bumper from the surface's plane, m."""
        return face.before(position)[0] - self._reach

    def forget(self) -> None:
        """Touch nothing, since the surface or the vehicle is unknown."""
        self.touches, self._otherwise = False, 0.0

    def update(self, face: Face, known: Estimate, dt: float) -> bool:
        """Return whether the vehicle, which is commanded to press, touches the surface."""
        ahead, aside, above = face.before(known.position)
        gap = ahead - self._reach
        before = face.spans(aside, above)
        if self.touches:
            differs = gap > APART or not before
        else:
            closing = -dot(sub(known.velocity, face.velocity), face.outward)
            differs = before and gap < NEAR and (closing < STILL or gap < -NEAR)
        self._otherwise = self._otherwise + dt if differs else 0.0
        if self._otherwise >= SURE_S:
            self.touches, self._otherwise = not self.touches, 0.0
        return self.touches
