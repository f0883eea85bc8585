"""Where the moving obstacles are, looked at once a tick, for everybody.

Motion capture sees them, late and with noise, as it sees vehicles; nobody is told where they really
are. The velocity of one is that of its last twentieth of a second, and at most the speed that the
mission tells. One that is not seen for half a second emits `obstacle_lost`, and
`obstacle_found` when it is seen again; whoever keeps away from it takes it to be larger meanwhile,
by how far it can have gone. What comes bit by bit as before, of one whose poses have wavered, is
repeated by the system for a body that it has lost, and counts as nothing seen. World frame, SI.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite

from kybflow.core.errors import described
from kybflow.core.geometry import ZERO, Vec3, distance, norm, scale, sub
from kybflow.core.signals import NS, Measurement, Pose, SeenObstacle, Time
from kybflow.parts import Stream
from kybflow.parts.events import ObstacleFound, ObstacleLost
from kybflow.runtime.events import Events
from kybflow.runtime.monitoring.bodies import STILL, WAVERS
from kybflow.runtime.monitoring.sensing import AHEAD
from kybflow.world.moving_sphere import MovingSphere

LOST: Time = NS // 2
"""How long one may not be seen until that is an event."""
_OVER: Time = NS // 20


class MovingObstacles:
    """The moving obstacles of a mission. seen: each when it was seen last. watching: what gives
    each one's poses."""

    def __init__(
        self, moving: Mapping[str, MovingSphere], events: Events, watching: Mapping[str, Stream]
    ) -> None:
        self.seen: dict[str, SeenObstacle] = {}
        self._events = events
        self._watched = {name: _Watched(ball, watching[name]) for name, ball in moving.items()}
        self._lost: set[str] = set()

    def step(self, now: Time) -> None:
        """Look at each."""
        for name, watched in self._watched.items():
            seen = watched.look(now)
            if seen is not None:
                self.seen[name] = seen
                if name in self._lost:
                    self._lost.discard(name)
                    self._events.emit(ObstacleFound(obstacle=name))
            elif name in self.seen and name not in self._lost and self._unseen(name, now) > LOST:
                self._lost.add(name)
                reason = _because(f"not seen for {LOST / NS:g} s", watched.trouble())
                self._events.emit(ObstacleLost(obstacle=name, reason=reason))

    def objections(self, now: Time) -> Iterator[tuple[str, str | None]]:
        """Yield each one with why nobody may take off because of it, None where it is seen."""
        for name, watched in self._watched.items():
            unseen = name not in self.seen or self._unseen(name, now) > LOST
            yield name, _because("it is not seen", watched.trouble()) if unseen else None

    def _unseen(self, name: str, now: Time) -> Time:
        return now - self.seen[name].time


class _Watched:
    """One obstacle, and what gives its poses."""

    def __init__(self, ball: MovingSphere, stream: Stream) -> None:
        self._ball, self._stream = ball, stream
        self._track: deque[tuple[Time, Vec3]] = deque()
        self._failure: str | None = None
        self._wavered = 0

    def look(self, now: Time) -> SeenObstacle | None:
        """Return it as it was when it was seen last, None where nothing new came of it."""
        came: Sequence[Measurement] = ()
        try:
            came, self._failure = self._stream.read(now), None
        except Exception as error:  # a part may raise anything; then nothing is seen
            self._failure = described(error)
        news = [pose for pose in came if self._is_new(pose, now)]
        return self._seen() if news else None

    def trouble(self) -> str | None:
        """Return why it can't be seen, None where nobody knows."""
        return self._failure or self._stream.trouble()

    def _is_new(self, pose: Measurement, now: Time) -> bool:
        """Take note of a pose; whether it is one, and later than the last."""
        if type(pose) is not Pose or not all(map(isfinite, pose.position)):
            return False
        if self._track:
            time, before = self._track[-1]
            if not time < pose.time <= now + AHEAD:
                return False
            if pose.position == before and self._wavered >= WAVERS:
                return False
            wavers = pose.position != before and distance(pose.position, before) < STILL
            self._wavered = min(self._wavered + 1, WAVERS) if wavers else self._wavered
        self._track.append((pose.time, pose.position))
        while pose.time - self._track[0][0] > _OVER:
            self._track.popleft()
        return True

    def _seen(self) -> SeenObstacle:
        (began, before), (time, place) = self._track[0], self._track[-1]
        gone = (time - began) / NS
        velocity = scale(sub(place, before), 1.0 / gone) if gone > 0.0 else ZERO
        radius, most = self._ball.radius, self._ball.speed
        if norm(velocity) > most:
            velocity = scale(velocity, most / norm(velocity))
        return SeenObstacle(time, place, velocity, radius, most)


def _because(what: str, trouble: str | None) -> str:
    return f"{what}: {trouble}" if trouble else what
