"""Where the moving obstacles are, looked at once a tick, for everybody.

The velocity of one is that of its last twentieth of a second. One that is not seen for half a
second is told as `obstacle_lost`, and as `obstacle_found` when it is seen again; whoever keeps away
from it takes it to be larger meanwhile, by how far it can have gone. World frame, SI.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

from kybflow.core.geometry import ZERO, Vec3, scale, sub
from kybflow.core.signals import NS, SeenObstacle, Time
from kybflow.runtime.events import Events
from kybflow.world.shapes import MovingSphere

LOST: Time = NS // 2
"""How long one may not be seen until that is told."""
_OVER: Time = NS // 20

Look = Callable[[str, Time], Vec3 | None]
"""Returns where an obstacle is seen at a time, None where it isn't."""


class MovingObstacles:
    """The moving obstacles of a mission. seen: each when it was seen last. look: who sees
    them; in a simulation they are where the mission has them."""

    def __init__(
        self, moving: Mapping[str, MovingSphere], events: Events, look: Look | None = None
    ) -> None:
        self.seen: dict[str, SeenObstacle] = {}
        self._moving, self._events = moving, events
        self._look = look or (lambda name, now: moving[name].at(now / NS))
        self._tracks: dict[str, deque[tuple[Time, Vec3]]] = {name: deque() for name in moving}
        self._lost: set[str] = set()

    def step(self, now: Time) -> None:
        """Look at each."""
        for name, sphere in self._moving.items():
            place = self._look(name, now)
            if place is not None:
                self._note(name, sphere, now, place)
            elif name not in self._lost and self._unseen(name, now) > LOST:
                self._lost.add(name)
                reason = f"not seen for {LOST / NS:g} s"
                self._events.tell("obstacle_lost", obstacle=name, reason=reason)

    def _unseen(self, name: str, now: Time) -> Time:
        seen = self.seen.get(name)
        return now if seen is None else now - seen.time

    def _note(self, name: str, sphere: MovingSphere, now: Time, place: Vec3) -> None:
        if name in self._lost:
            self._lost.discard(name)
            self._events.tell("obstacle_found", obstacle=name)
        track = self._tracks[name]
        track.append((now, place))
        while now - track[0][0] > _OVER:
            track.popleft()
        began, before = track[0]
        gone = (now - began) / NS
        velocity = scale(sub(place, before), 1.0 / gone) if gone > 0.0 else ZERO
        self.seen[name] = SeenObstacle(now, place, velocity, sphere.radius, sphere.speed)
