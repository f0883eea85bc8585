"""Tag floors, and flights over them."""

from __future__ import annotations

from math import cos, pi, sin

import numpy

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    add,
    conjugate,
    from_euler,
    from_thrust_direction,
    multiply,
    sub,
)
from kybflow.core.signals import NS, Frame, Truth
from kybflow.vision.rendering.drawing import Room
from kybflow.world.cameras import Camera, Lens, Optics
from kybflow.world.tags import Tag, TagMap

LENS = Lens(640, 480, 520.0, 520.0, 318.0, 243.0, (-0.12, 0.03, 0.0005, -0.0004, 0.0))
CAMERA = Camera("down", LENS, (0.08, 0.0, -0.03), row_time=3e-5)
SIZE, PITCH = 0.195, 0.2077
MIDDLE = (0.95, 0.95)


def grid(columns=10, rows=10, size=SIZE, pitch=PITCH, first=0, at=(0.0, 0.0), family="36h11"):
    """Tags in rows, the first one in the lower left."""
    return [
        Tag(family, first + columns * j + i, size, (x, y, 0.0), LEVEL)
        for j, y in enumerate((at[1] + pitch * numpy.arange(rows)).tolist())
        for i, x in enumerate((at[0] + pitch * numpy.arange(columns)).tolist())
    ]


def pad(size=0.04, pitch=0.05):
    """25 small tags around the origin."""
    return grid(5, 5, size, pitch, 200, (-2 * pitch, -2 * pitch))


def misplaced(tags, share, generator, by=0.3):
    """The same tags; some of them, as the map has them, are elsewhere."""
    wrong = {tags[i].id for i in generator.permutation(len(tags))[: round(share * len(tags))]}

    def shift(tag):
        off = (*generator.uniform(-by, by, 2).tolist(), 0.0)
        return tag._replace(position=add(tag.position, off)) if tag.id in wrong else tag

    return [shift(tag) for tag in tags], wrong


def lively(height=1.2, radius=0.5, period=8.0, middle=MIDDLE):
    """A coordinated circle that sways, with a heading that turns."""
    rate = 2.0 * pi / period

    def pose_at(t):
        a = rate * t
        x, y = middle[0] + radius * cos(a), middle[1] + radius * sin(a)
        pull = radius * rate * rate
        tilted = from_thrust_direction((-pull * cos(a), -pull * sin(a), GRAVITY), 0.4 * sin(a))
        sway = from_euler(0.02 * sin(4.0 * t), 0.02 * cos(5.0 * t), 0.0)
        return (x, y, height + 0.05 * sin(2.3 * a)), multiply(tilted, sway)

    return pose_at


def truth_at(pose_at, t, h=1e-4):
    """The pose with its derivatives."""
    (p, q), (a, b), (c, d) = pose_at(t), pose_at(t - h), pose_at(t + h)
    velocity = tuple(x / (2 * h) for x in sub(c, a))
    turn = multiply(conjugate(b), d)
    return Truth(p, velocity, q, tuple(x / h for x in turn[1:]))


def still(position, attitude=LEVEL):
    return Truth(position, (0.0, 0.0, 0.0), attitude, (0.0, 0.0, 0.0))


def frame(room, body, t=0.0, camera=CAMERA, **weakness):
    from kybflow.world.cameras import Weakness

    return Frame(round(t * NS), camera.name, room.draw(camera, body, Weakness(**weakness)))


def room(tags, seed=1, **optics):
    return Room(TagMap(tags), Optics(**optics), seed)


def moved(body, by=(0.0, 0.0, 0.0), turned=(0.0, 0.0, 0.0)):
    """A pose with an error: metres in the world, radians in the body."""
    return add(body.position, by), multiply(body.attitude, from_euler(*turned))


def off(position, attitude, body):
    """How wrong a pose is: metres, radians."""
    cosine = abs(sum(a * b for a, b in zip(attitude, body.attitude, strict=True)))
    return (
        float(numpy.linalg.norm(sub(position, body.position))),
        2.0 * float(numpy.arccos(min(1.0, cosine))),
    )
