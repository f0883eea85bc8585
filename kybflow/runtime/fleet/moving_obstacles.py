"""The positions of moving obstacles, measured by motion capture.

The velocity of an obstacle is its mean velocity over the last twentieth of a second, and at most
the declared speed. An obstacle that is lost counts as larger by the distance it can have moved.
World frame, SI.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.geometry import ZERO, norm, scale, sub
from kybflow.core.signals import NS, SeenObstacle, Time
from kybflow.parts import Stream
from kybflow.parts.events import ObstacleFound, ObstacleLost
from kybflow.runtime.events import Events, WorldObserver
from kybflow.runtime.fleet.tracked_bodies import Track, TrackedBodies
from kybflow.world.shapes import MovingSphere

MovingObstacles = TrackedBodies[SeenObstacle]
_SPAN_NS: Time = NS // 20


def moving_obstacles(
    moving: Mapping[str, MovingSphere],
    events: Events,
    streams: Mapping[str, Stream],
    observer: WorldObserver | None = None,
) -> MovingObstacles:
    """Return the moving obstacles of a mission. streams: that of each obstacle's poses, by name."""

    def observe(name: str, track: Track) -> SeenObstacle:
        ball, first, last = moving[name], track[0], track[-1]
        gone = (last.time - first.time) / NS
        velocity = scale(sub(last.position, first.position), 1.0 / gone) if gone > 0.0 else ZERO
        if norm(velocity) > ball.speed:
            velocity = scale(velocity, ball.speed / norm(velocity))
        return SeenObstacle(last.time, last.position, velocity, ball.radius, ball.speed)

    return TrackedBodies(
        {name: streams[name] for name in moving}, _SPAN_NS, observe, events,
        lambda name, reason: ObstacleLost(obstacle=name, reason=reason),
        lambda name: ObstacleFound(obstacle=name),
        observer,
    )  # fmt: skip
