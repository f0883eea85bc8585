"""The states of the world's objects, estimated from the poses that motion capture measures.

The coordinate of an object's joint follows from its pose and from that of the object that it is on
(`kybflow.world.objects`). Velocities are the slopes of straight lines fitted by least squares to
the poses of the last `_SPAN_NS`: with white noise of deviation s at n poses in a time T, a slope is
off by about s sqrt(12 / n) / T, that of 0.5 mm at 120 Hz by 3 mm/s, and it is T / 2 old. World
frame, SI.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import fsum

from kybflow.core.geometry import wrap
from kybflow.core.signals import NS, SeenObject, Time
from kybflow.parts import Stream
from kybflow.parts.events import ObjectFound, ObjectLost
from kybflow.runtime.events import Events, WorldObserver
from kybflow.runtime.fleet.tracked_bodies import Track, TrackedBodies
from kybflow.world.objects import (
    Placement,
    SlideJoint,
    WorldObject,
    coordinate,
    in_order,
    place_of,
)

TrackedObjects = TrackedBodies[SeenObject]
_SPAN_NS: Time = round(0.15 * NS)


def tracked_objects(
    objects: Mapping[str, WorldObject],
    events: Events,
    streams: Mapping[str, Stream],
    observer: WorldObserver | None = None,
) -> TrackedObjects:
    """Return the objects of a mission. streams: that of each object's poses, by name."""
    coordinates: dict[str, dict[Time, float]] = {name: {} for name in objects}

    def observe(name: str, track: Track) -> SeenObject:
        one, last, known = objects[name], track[-1], coordinates[name]
        on = None if one.on is None else place_of(objects, bodies.seen, one.on)
        found = {
            pose.time: known[pose.time]
            if pose.time in known
            else coordinate(one, on, Placement(pose.position, pose.attitude))
            for pose in track
        }
        coordinates[name], moved = found, [found[pose.time] for pose in track]
        q = moved[-1]
        if not isinstance(one.joint, SlideJoint):
            moved = [wrap(angle - q) for angle in moved]
        times = [(pose.time - last.time) / NS for pose in track]
        x, y, z = (_slope(times, axis) for axis in zip(*(p.position for p in track), strict=True))
        return SeenObject(
            last.time, last.position, last.attitude, (x, y, z), q, _slope(times, moved)
        )

    bodies: TrackedObjects = TrackedBodies(
        {one.name: streams[one.name] for one in in_order(objects.values()) if one.moves},
        _SPAN_NS, observe, events,
        lambda name, reason: ObjectLost(object=name, reason=reason),
        lambda name: ObjectFound(object=name),
        observer,
    )  # fmt: skip
    return bodies


def _slope(times: Sequence[float], values: Sequence[float]) -> float:
    """Return the slope of the line that fits the values best, zero for a single one."""
    mean = fsum(times) / len(times)
    square = fsum((t - mean) ** 2 for t in times)
    product = fsum((t - mean) * v for t, v in zip(times, values, strict=True))
    return product / square if square > 0.0 else 0.0
