"""The positions of moving obstacles, read once a tick for all vehicles.

Motion capture measures obstacles like vehicles, late and with noise; no vehicle knows their true
positions. The velocity of an obstacle is its mean velocity over the last twentieth of a second, and
at most the declared speed. `obstacle_lost` is emitted when an obstacle has not been seen for half a
second, and `obstacle_found` when it is seen again; in between it counts as larger by the distance
it can have moved. If an obstacle's poses have wavered before, a pose that repeats the last one bit
by bit means that motion capture has lost the body, and is ignored. World frame, SI.
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
from kybflow.runtime.monitoring.bodies import STILL_DISTANCE, WAVERING_POSES
from kybflow.runtime.monitoring.sensing import MAX_LEAD_NS
from kybflow.world.shapes import MovingSphere

UNSEEN_NS: Time = NS // 2
"""How long an obstacle may be unseen before it is lost."""
_VELOCITY_SPAN_NS: Time = NS // 20


class MovingObstacles:
    """The moving obstacles of a mission. seen: the last observation of each obstacle, by name.
    watching: the stream of each obstacle's poses, by name."""

    def __init__(
        self, moving: Mapping[str, MovingSphere], events: Events, watching: Mapping[str, Stream]
    ) -> None:
        self.seen: dict[str, SeenObstacle] = {}
        self._events = events
        self._watched = {name: _Watched(ball, watching[name]) for name, ball in moving.items()}
        self._lost: set[str] = set()

    def step(self, now: Time) -> None:
        """Read every obstacle. The engine calls it once a tick."""
        for name, watched in self._watched.items():
            seen = watched.look(now)
            if seen is not None:
                self.seen[name] = seen
                if name in self._lost:
                    self._lost.discard(name)
                    self._events.emit(ObstacleFound(obstacle=name))
            elif (
                name in self.seen and name not in self._lost and self._unseen(name, now) > UNSEEN_NS
            ):
                self._lost.add(name)
                reason = _because(f"not seen for {UNSEEN_NS / NS:g} s", watched.trouble())
                self._events.emit(ObstacleLost(obstacle=name, reason=reason))

    def objections(self, now: Time) -> Iterator[tuple[str, str | None]]:
        """Yield the name of each obstacle and why no vehicle may take off because of it; None if
        the obstacle is seen."""
        for name, watched in self._watched.items():
            unseen = name not in self.seen or self._unseen(name, now) > UNSEEN_NS
            yield name, _because("it is not seen", watched.trouble()) if unseen else None

    def _unseen(self, name: str, now: Time) -> Time:
        return now - self.seen[name].time


class _Watched:
    """One obstacle and the stream of its poses."""

    def __init__(self, ball: MovingSphere, stream: Stream) -> None:
        self._ball, self._stream = ball, stream
        self._track: deque[tuple[Time, Vec3]] = deque()
        self._failure: str | None = None
        self._wavered = 0

    def look(self, now: Time) -> SeenObstacle | None:
        """Read the stream; return the obstacle's new observation, or None without a new pose."""
        came: Sequence[Measurement] = ()
        try:
            came, self._failure = self._stream.read(now), None
        except Exception as error:  # a part may raise anything; then nothing is seen
            self._failure = described(error)
        news = [pose for pose in came if self._is_new(pose, now)]
        if not news:
            return None
        (began, before), (time, place) = self._track[0], self._track[-1]
        gone = (time - began) / NS
        velocity = scale(sub(place, before), 1.0 / gone) if gone > 0.0 else ZERO
        radius, most = self._ball.radius, self._ball.speed
        if norm(velocity) > most:
            velocity = scale(velocity, most / norm(velocity))
        return SeenObstacle(time, place, velocity, radius, most)

    def trouble(self) -> str | None:
        """Return why the obstacle can't be seen, or None if no reason is known."""
        return self._failure or self._stream.trouble()

    def _is_new(self, pose: Measurement, now: Time) -> bool:
        """Add a pose to the track if it is valid, newer than the last one, and not a repetition
        that shows a lost body. Return whether it was added."""
        if type(pose) is not Pose or not all(map(isfinite, pose.position)):
            return False
        if self._track:
            time, before = self._track[-1]
            if not time < pose.time <= now + MAX_LEAD_NS:
                return False
            if pose.position == before and self._wavered >= WAVERING_POSES:
                return False
            wavers = pose.position != before and distance(pose.position, before) < STILL_DISTANCE
            self._wavered = min(self._wavered + 1, WAVERING_POSES) if wavers else self._wavered
        self._track.append((pose.time, pose.position))
        while pose.time - self._track[0][0] > _VELOCITY_SPAN_NS:
            self._track.popleft()
        return True


def _because(what: str, trouble: str | None) -> str:
    return f"{what}: {trouble}" if trouble else what
