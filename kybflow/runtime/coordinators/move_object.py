"""Move an object together: turn it to `yaw`, then push it to `position` or `point`, and hold it.

Every vehicle that the phase runs pushes one surface of the object by the behavior `push` without a
`force`; the coordinator shares the force and the torque that the object needs among them
(`kybflow.flight.manipulation.object_law`). Until all of them push, those that do press with
`preload`. If one of them no longer pushes, all let go.

Its states are `wait`, `align`, `push`, `hold`, `let_go`, and `infeasible` if what the vehicles can
give has not sufficed for 2 s. The event `coordinator_changed` reports each change. Vehicles can
only push: what is beyond its goal they bring back from the other side. World frame, SI.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import tan

from kybflow.core.geometry import heading_of, rotate, scale, wrap
from kybflow.core.signals import SeenObject
from kybflow.core.text import did_you_mean
from kybflow.core.units import (
    DEG,
    FORCE,
    Angle,
    AngularRate,
    Force,
    Length,
    Position,
    Speed,
    format_quantity,
)
from kybflow.flight.manipulation.contact import UNSEEN_NS
from kybflow.flight.manipulation.object_law import Aim, ObjectLaw, Pusher
from kybflow.parts import Coordinator, Objection, Shares, Team, TeamMember, TeamTick, param, params
from kybflow.world.freedoms import Freedom, freedoms_of
from kybflow.world.objects import Placement, WorldObject, seen_face

_BLIND_S = 0.15
"""Age of an estimate from which its vehicle counts as one that no longer pushes, s."""
_AXES = ("x", "y")


@params
class MoveObjectParams:
    object: str = param("The object whose surfaces the vehicles push.")
    position: Length | None = param("Goal of the joint that slides.", default=None)
    yaw: Angle | None = param(
        "Goal of the heading (as `OBJECT.yaw`) of an object that turns about the vertical, or has "
        "no joint.",
        default=None,
    )
    point: Position | None = param(
        "Goal of an object without a joint; its height doesn't count.", default=None
    )
    speed: Speed = param("Largest speed.", default=0.12, above=0.0)
    turn_rate: AngularRate = param("Largest rate of turning.", default=12.0 * DEG, above=0.0)
    preload: Force = param(
        "Least force of each vehicle, which keeps contact.", default=0.1, above=0.0
    )
    tolerance: Length = param("Allowed error of the position.", default=0.02, above=0.0)
    yaw_tolerance: Angle = param("Allowed error of the yaw.", default=3.0 * DEG, above=0.0)


class MoveObject(Coordinator[MoveObjectParams]):
    def __init__(self, params: MoveObjectParams, team: Team) -> None:
        super().__init__(params, team)
        self._team = team
        self._objects = next(iter(team.values())).objects
        self._freedoms = freedoms_of(self._objects, params.object)
        self._law = ObjectLaw(params.preload)
        self._all_pushed = False

    def update(self, tick: TeamTick) -> Shares:
        pushing = {name: m.pushes for name, m in tick.members.items() if m.pushes and _is_known(m)}
        missing = [name for name in tick.members if name not in pushing]
        self._all_pushed = self._all_pushed or not missing
        unseen = [f.object for f in self._freedoms if not self._is_seen(f.object, tick)]
        if unseen:
            return Shares({}, "let_go", f"`{unseen[0]}` is not seen")
        if missing and self._all_pushed:
            return Shares({}, "let_go", f"`{missing[0]}` no longer pushes")
        if missing:
            waits = dict.fromkeys(pushing, self.params.preload)
            return Shares(waits, "wait", f"`{missing[0]}` doesn't push yet")
        aims = [self._aim(one, tick.objects[one.object]) for one in self._freedoms]
        pushers = {name: self._pusher(name, path, tick) for name, path in pushing.items()}
        forces, mode, short = self._law.update(aims, pushers, tick.dt)
        return Shares(forces, "infeasible" if short else mode, short)

    def _is_seen(self, name: str, tick: TeamTick) -> bool:
        seen = tick.objects.get(name)
        return seen is not None and tick.now - seen.time <= UNSEEN_NS

    def _aim(self, free: Freedom, seen: SeenObject) -> Aim:
        p = self.params
        if free.turns:
            ahead = 1.0 if rotate(seen.attitude, free.axis)[2] > 0.0 else -1.0
            error = None if p.yaw is None else ahead * wrap(p.yaw - heading_of(seen.attitude))
            return Aim(free, error, seen.speed, p.yaw_tolerance, p.turn_rate)
        if free.label == "position":
            error = None if p.position is None else p.position - seen.q
            return Aim(free, error, seen.speed, p.tolerance, p.speed)
        axis = _AXES.index(free.label)
        error = None if p.point is None else p.point[axis] - seen.position[axis]
        return Aim(free, error, seen.velocity[axis], p.tolerance, p.speed)

    def _pusher(self, name: str, path: str, tick: TeamTick) -> Pusher:
        face = seen_face(self._objects, tick.objects, path)
        assert face is not None
        inwards, frame = scale(face.outward, -1.0), self._team[name].airframe
        levers = []
        for free in self._freedoms:
            seen = tick.objects[free.object]
            place = Placement(seen.position, seen.attitude)
            levers.append(free.lever(place, face.centre, inwards))
        return Pusher(tuple(levers), frame.mass, frame.hover_thrust * tan(frame.tilt))

    @classmethod
    def goals(
        cls, params: MoveObjectParams, objects: Mapping[str, WorldObject]
    ) -> Iterator[tuple[str, str, float]]:
        for free in freedoms_of(objects, params.object):
            if free.label in _AXES:
                value = None if params.point is None else params.point[_AXES.index(free.label)]
            else:
                value = params.yaw if free.turns else params.position
            if value is not None:
                yield free.object, free.label, value

    @classmethod
    def objections(cls, params: MoveObjectParams, team: Team) -> Iterator[Objection]:
        objects = next(iter(team.values())).objects if team else {}
        if params.object not in objects:
            hint = did_you_mean(params.object, objects) or "declare it in `world.objects`"
            yield Objection("object", f"names `{params.object}`, and no object is called so", hint)
            return
        freedoms = freedoms_of(objects, params.object)
        labels = {("point" if one.label in _AXES else one.label): one for one in freedoms}
        for goal in ("position", "yaw", "point"):
            if getattr(params, goal) is not None and goal not in labels:
                movable = " and ".join(f"`{label}`" for label in sorted(labels)) or "nothing"
                reason = f"is no motion of `{params.object}`, which has {movable}"
                yield Objection(goal, reason, "give the goal of a motion that it has")
        turning = next((one for one in freedoms if one.turns), None)
        if params.yaw is not None and turning is not None and abs(turning.axis[2]) < 0.99:
            reason = f"needs a vertical axis, and `{turning.object}` turns about another"
            yield Objection("yaw", reason, "leave `yaw` out")
        if all(getattr(params, goal) is None for goal in ("position", "yaw", "point")):
            yield Objection("object", "has no goal", "write `position`, `yaw` or `point`")
        yield from _slips(params, freedoms, len(team))


def _is_known(member: TeamMember) -> bool:
    return member.estimate is not None and member.estimate.age < _BLIND_S


def _slips(
    params: MoveObjectParams, freedoms: tuple[Freedom, ...], vehicles: int
) -> Iterator[Objection]:
    """Yield that a slide moves while the object is turned, because its friction is too low."""
    turning = next((one for one in freedoms if one.turns), None)
    if turning is None or params.yaw is None:
        return
    for one in freedoms:
        if one.label != "position":
            continue
        least = vehicles * params.preload + 0.1
        if one.friction < least:
            bound = format_quantity(round(least, 3), FORCE)
            reason = (
                f"lets `{one.object}` creep while `{turning.name}` is turned: {vehicles} preloads "
                f"and 0.1 N for the turn are {bound}, and its friction is "
                f"{format_quantity(one.friction, FORCE)}"
            )
            hint = "give the slide more friction or a brake, or write a smaller `preload`"
            yield Objection("preload", reason, hint, is_doubt=True)
