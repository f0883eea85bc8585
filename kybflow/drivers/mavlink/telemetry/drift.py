"""How far an autopilot's own position is from where it is.

Its filter takes the poses that it is told with a grain of salt, so its frame wanders by centimetres
against the world. Set-points are moved by that, learnt with a time constant of `SLOW`: so the
vehicle comes to rest where the estimate that the mission flies on has it, and what the filter knows
better, what is fast, stays its own.
"""

from __future__ import annotations

from kybflow.core.geometry import Vec3, add, norm, scale, sub
from kybflow.core.signals import NS, Estimate, Odometry, Time
from kybflow.drivers.mavlink.protocol.frames import Anchor

SLOW = 1.0
"""Seconds."""
FAR = 0.5
"""Metres beyond which it is no drift: the preflight, or a supervisor, has a word to say."""
OLDEST: Time = NS // 2
"""An own position that is older teaches nothing, and after a longer gap no more is learnt at once
than after this, so that set-points do not leap."""


class Drift:
    """`anchor`: where the autopilot's frame lies in the world."""

    def __init__(self) -> None:
        self.anchor = Anchor()
        self._learnt: Time | None = None
        self._own: Odometry | None = None

    def learn(self, estimate: Estimate, own: Odometry | None, now: Time) -> None:
        """Take both into account, once a tick; each own position counts once."""
        if own is None or now - own.time > OLDEST:
            self._learnt = None
            return
        if own is self._own:
            return
        self._own = own
        last, self._learnt = self._learnt, now
        off = sub(estimate.position, _at(own, estimate.time))
        if last is None or norm(off) > FAR:
            return
        share = min(now - last, OLDEST) / NS / SLOW
        offset = add(self.anchor.offset, scale(sub(off, self.anchor.offset), share))
        self.anchor = Anchor(offset)


def _at(own: Odometry, time: Time) -> Vec3:
    return add(own.position, scale(own.velocity, (time - own.time) / NS))
