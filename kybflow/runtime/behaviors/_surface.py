"""What the behaviors that touch a surface share: its parameter, its objections, where it is, and
the setpoint of a vehicle in front of it."""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2, hypot
from typing import Any, NamedTuple

from kybflow.core.geometry import Vec3, add, scale
from kybflow.core.signals import NS, Setpoint, SetpointKind, Tick
from kybflow.core.text import did_you_mean
from kybflow.flight.governor import shortened
from kybflow.flight.manipulation.contact import UNSEEN_NS
from kybflow.parts import Objection, param
from kybflow.world.objects import Face, face_of, placements, seen_face
from kybflow.world.vehicle_context import VehicleContext

_LEVEL = 0.3
"""The largest vertical part of the direction out of a surface that a vehicle can face."""
BACK_RATE, _BACK_SPEED = 1.5, 0.15
"""Speed towards the planned place per distance from it, 1/s, and the largest such speed, m/s."""


def surface_param() -> Any:
    return param(
        "The surface, as `OBJECT.SURFACE`, of an object of the world that moves.",
        names="surface", read_only=True,
    )  # fmt: skip


def objections(surface: str, context: VehicleContext) -> Iterator[Objection]:
    """Yield why a vehicle can't touch a surface."""
    known = [f"{one.name}.{s.name}" for one in context.objects.values() for s in one.surfaces]
    name, _, label = surface.partition(".")
    one = context.objects.get(name)
    if one is None or one.surface(label) is None:
        hint = did_you_mean(surface, known) if known else "declare one in `world.objects`"
        yield Objection("surface", f"names `{surface}`, and no surface is called so", hint)
    elif not one.moves:
        reason = f"is on `{name}`, a part of `{one.on}` that motion capture doesn't track"
        yield Objection("surface", reason, f"give the surface to `{one.on}`")
    elif abs(at_start(surface, context).outward[2]) > _LEVEL:
        reason = "faces up or down, and a vehicle pushes with its rim"
        yield Objection("surface", reason, "choose a surface that faces aside")
    elif context.airframe.bumper is None:
        reason = "can't be touched by an airframe without a `bumper`"
        yield Objection("surface", reason, "give the airframe a `bumper`, as `ardrone_hull` has")


def at_start(surface: str, context: VehicleContext) -> Face:
    """Return where a surface is at the start."""
    name, _, label = surface.partition(".")
    found = context.objects[name].surface(label)
    assert found is not None
    return face_of(found, placements(context.objects, {})[name])


def front(face: Face, away: float, context: VehicleContext) -> Vec3:
    """Return the position at which the vehicle's bumper is `away` from a surface's middle."""
    reach = (context.airframe.bumper or 0.0) + away
    x, y, z = add(face.centre, scale(face.outward, reach))
    return (x, y, z - (context.airframe.bumper_height or 0.0))


class FoundFace(NamedTuple):
    """A surface, and why it can't be touched now: empty if it can."""

    face: Face | None
    trouble: str


def look(surface: str, context: VehicleContext, tick: Tick) -> FoundFace:
    """Return where a surface was seen, and what is wrong with that."""
    face = seen_face(context.objects, tick.objects, surface)
    name = surface.partition(".")[0]
    if face is None:
        return FoundFace(None, f"`{name}` has not been seen")
    age = tick.now - tick.objects[name].time
    trouble = f"`{name}` was last seen {age / NS:.1f} s ago" if age > UNSEEN_NS else ""
    return FoundFace(face, trouble)


def facing(
    face: Face, position: Vec3, context: VehicleContext, speed: float, push: float
) -> Setpoint:
    """Return the setpoint of a vehicle in front of a surface and square to it. It moves towards the
    surface at `speed`, m/s, relative to it, and presses with the acceleration `push`, m/s^2."""
    _, aside, above = face.before(position)
    away = -above - (context.airframe.bumper_height or 0.0)
    back = add(scale(face.along, -BACK_RATE * aside), (0.0, 0.0, BACK_RATE * away))
    x, y, _ = face.outward
    level = 1.0 / hypot(x, y)
    inwards: Vec3 = (-x * level, -y * level, 0.0)
    velocity = add(add(face.velocity, shortened(back, _BACK_SPEED)), scale(inwards, speed))
    return Setpoint(
        SetpointKind.VELOCITY, None, velocity, scale(inwards, push), None, atan2(-y, -x), 0.0,
        inwards,
    )  # fmt: skip
