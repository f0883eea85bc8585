"""The world's objects in MuJoCo: their model, their state, what resists their joints, and what
vehicles press them with.

Dry friction is MuJoCo's `frictionloss`, so stiff that a pushed object creeps by less than 0.01 mm
per second while it sticks. Viscous friction is a force on the joint, set before each
span of steps, because a damped joint would change the mass matrix of all vehicles' integration:
for a damping d and a constant inertia I, the force over a time T

    f = -v I (1 - exp(-d T / I)) / T

slows the joint exactly as d would, for any d. A surface is a plate of the object's material.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from html import escape
from math import degrees, expm1, inf
from typing import Any, NamedTuple

import mujoco
import numpy

from kybflow.core.geometry import heading_of
from kybflow.drivers.sim.model import OBJECT, numbers
from kybflow.parts import ActiveFaults
from kybflow.parts.link import Contact
from kybflow.world.objects import (
    WORLD,
    ObjectState,
    TurnJoint,
    WorldObject,
    boxes_of,
    in_order,
)

_COLOURS = ("0.85 0.65 0.2 1", "0.3 0.65 0.65 1", "0.75 0.4 0.5 1", "0.5 0.6 0.3 1")


def objects_text(objects: Mapping[str, WorldObject]) -> str:
    """Return the objects as MJCF."""
    colours = {name: _COLOURS[i % len(_COLOURS)] for i, name in enumerate(objects)}

    def body(one: WorldObject) -> str:
        place, name = one.placed(WORLD, 0.0), escape(OBJECT + one.name)
        inside = "".join(body(other) for other in objects.values() if other.on == one.name)
        return (
            f'<body name="{name}" pos="{numbers(place.position)}"'
            f' quat="{numbers(place.attitude)}">\n'
            f"{_joint(one, name)}{''.join(_geoms(one, colours[one.name]))}{inside}</body>\n"
        )

    return "".join(body(one) for one in objects.values() if one.on is None)


def _joint(one: WorldObject, name: str) -> str:
    joint = one.joint
    if joint is None:
        return f'<freejoint name="{name}"/>\n' if one.is_free else ""
    turns = isinstance(joint, TurnJoint)
    stops = (degrees(q) if turns else q for q in (joint.low, joint.high))
    return (
        f'<joint name="{name}" type="{"hinge" if turns else "slide"}" axis="{numbers(one.axis)}"'
        f' limited="true" range="{numbers(stops)}" frictionloss="{joint.friction!r}"'
        ' solimpfriction="0.999 0.999 0.001"/>\n'
    )


def _geoms(one: WorldObject, colour: str) -> Iterator[str]:
    density = one.mass / one.volume
    own = (
        f'density="{density!r}" friction="{one.grip!r} 0.005 0.0001" priority="1" conaffinity="3"'
        f' rgba="{colour}"'
    )
    names = (one.name, *(f"{one.name}.{surface.name}" for surface in one.surfaces))
    for name, (centre, attitude, half) in zip(names, boxes_of(one), strict=True):
        yield (
            f'<geom name="{escape(OBJECT + name)}" type="box" size="{numbers(half)}"'
            f' pos="{numbers(centre)}" quat="{numbers(attitude)}" {own}/>\n'
        )


class _Moved(NamedTuple):
    """An object in MuJoCo. place, freedom: where its joint's coordinate and speed begin. inertia:
    what its joint moves at the start."""

    made: WorldObject
    place: int
    freedom: int
    inertia: float


class SimulatedObjects:
    """The objects of a MuJoCo world. vehicles: the name of each geom's vehicle. resists: whether a
    joint has viscous friction."""

    def __init__(
        self, model: Any, data: Any, objects: Mapping[str, WorldObject], vehicles: Mapping[int, str]
    ) -> None:
        self._model, self._data, self._vehicles = model, data, vehicles
        self._objects = [self._moved(one) for one in in_order(objects.values())]
        self._damped = [one for one in self._objects if one.made.joint and one.made.joint.damping]
        self.resists = bool(self._damped)
        named = ((i, model.geom(i).name) for i in range(model.ngeom))
        self._surfaces = {i: object_of(name) for i, name in named if name.startswith(OBJECT)}
        for one in self._objects:
            if one.made.joint is not None:
                data.qpos[one.place] = one.made.joint.start
        self._faults = {
            name: ActiveFaults(name, partial(self._disturb, name))
            for name, one in objects.items()
            if one.moves
        }
        self._wrench = numpy.zeros(6)
        self._read, self._states = -1.0, dict[str, ObjectState]()

    def _moved(self, one: WorldObject) -> _Moved:
        if one.joint is None and not one.is_free:
            return _Moved(one, -1, -1, inf)
        joint = self._model.joint(OBJECT + one.name)
        freedom = int(joint.dofadr[0])
        return _Moved(one, int(joint.qposadr[0]), freedom, float(self._model.dof_M0[freedom]))

    def faults(self) -> Mapping[str, ActiveFaults]:
        """Return the faults of the objects that move, by name."""
        return self._faults

    def _disturb(self, name: str) -> None:
        """Apply what pushes an object, until it changes."""
        body, active = self._data.body(OBJECT + name), self._faults[name]
        body.xfrc_applied[:] = (*active.force, 0.0, 0.0, active.torque)

    def resist(self, seconds: float) -> None:
        """Set the viscous friction of the joints for the next span of steps."""
        for one in self._damped:
            joint = one.made.joint
            assert joint is not None
            speed = float(self._data.qvel[one.freedom])
            share = -expm1(-joint.damping * seconds / one.inertia)
            self._data.qfrc_applied[one.freedom] = -speed * one.inertia * share / seconds

    def states(self) -> dict[str, ObjectState]:
        """Return the state of every object. It is computed once for each time."""
        if self._read == self._data.time:
            return self._states
        found: dict[str, ObjectState] = {}
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_comVel(self._model, self._data)
        for one in self._objects:
            body = self._data.body(OBJECT + one.made.name)
            moving = numpy.zeros(6)
            mujoco.mj_objectVelocity(
                self._model, self._data, mujoco.mjtObj.mjOBJ_XBODY, body.id, moving, 0
            )
            wx, wy, wz, vx, vy, vz = moving.tolist()
            x, y, z = body.xpos.tolist()
            w, i, j, k = body.xquat.tolist()
            if one.made.joint is None:
                q, speed = heading_of((w, i, j, k)), wz
            else:
                q, speed = float(self._data.qpos[one.place]), float(self._data.qvel[one.freedom])
            found[one.made.name] = ObjectState(
                (x, y, z), (w, i, j, k), (vx, vy, vz), q, speed, (wx, wy, wz)
            )
        self._read, self._states = self._data.time, found
        return found

    def contacts(self) -> dict[Contact, float]:
        """Return the force (N) with which each vehicle presses each surface now."""
        found: dict[Contact, float] = {}
        for index, (first, second) in enumerate(self._data.contact.geom.tolist()):
            who = self._vehicles.get(first) or self._vehicles.get(second)
            what = self._surfaces.get(first) or self._surfaces.get(second)
            if who is None or what is None:
                continue
            mujoco.mj_contactForce(self._model, self._data, index, self._wrench)
            contact = Contact(who, *what)
            found[contact] = found.get(contact, 0.0) + float(self._wrench[0])
        return found


def object_of(name: str) -> tuple[str, str]:
    """Return the object and the surface of a geom; the surface is empty for the object's box."""
    what, _, surface = name.removeprefix(OBJECT).partition(".")
    return what, surface
