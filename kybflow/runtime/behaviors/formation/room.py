"""Keeps the places of a formation away from the fence, the ground, obstacles, and vehicles that are
not members."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import ceil

from kybflow.core.geometry import ZERO, Vec3, add, distance, dot, scale, sub
from kybflow.core.params import param, params
from kybflow.core.signals import Tick, Time
from kybflow.core.units import Length
from kybflow.flight.avoidance.clearance import Surface, reach_of, walls
from kybflow.flight.avoidance.surroundings import Obstacles, grown
from kybflow.flight.formation.frame import MovingFrame
from kybflow.flight.formation.places import TakenPlaces
from kybflow.parts import Objection
from kybflow.world.shapes import Box, Shape, Sphere, around
from kybflow.world.vehicle_context import VehicleContext

_STEP = 0.1
"""Distance (m) between the points of a leg that are checked."""


@params
class FormationRoomParams:
    """The distances that are kept."""

    margin: Length = param(
        "Distance of every place from the fence.",
        default=0.3, at_least=0.0, tightens="up", room="across",
    )  # fmt: skip
    clearance: Length = param(
        "Distance of every place from obstacles and other vehicles, measured from the hub.",
        default=0.3, above=0.0, tightens="up", room="across",
    )  # fmt: skip
    lowest: Length = param(
        "Smallest height above the ground of the start.",
        default=0.4, above=0.0, tightens="up", room="floor",
    )  # fmt: skip


def within_the_rotors(p: FormationRoomParams, context: VehicleContext) -> Iterator[Objection]:
    """Yield why `clearance`, which counts from the hubs, lets a rotor touch something."""
    reach = context.airframe.rotor_radius
    if p.clearance <= reach:
        reason = "is within the rotors"
        yield Objection("clearance", reason, f"write more than {reach:.3g} m", is_doubt=True)


class FormationRoom:
    """The space in which a formation may be, as one of its members computes it."""

    def __init__(self, context: VehicleContext, team: tuple[str, ...]) -> None:
        self._context, self._obstacles = context, Obstacles(context)
        self._solids = tuple(self._obstacles.solids.values())
        self._others = tuple(name for name in self._obstacles.hulls if name not in team)
        self._widest = max((context.diameters.get(name, 0.0) for name in team), default=0.0)

    def box(self, p: FormationRoomParams) -> Box | None:
        """Return the box within the fence in which places may be, or None without a fence."""
        fence, ground = self._context.fence, self._context.start[2]
        if fence is None:
            return None
        (x0, y0, z0), (x1, y1, z1), m = fence.low, fence.high, p.margin
        return Box((x0 + m, y0 + m, max(z0, ground + p.lowest)), (x1 - m, y1 - m, z1 - m))

    def centred(self, centre: Vec3, offsets: Sequence[Vec3], p: FormationRoomParams) -> Vec3:
        """Return the point nearest to `centre` from which all offsets are inside the box. Along an
        axis on which they don't fit, centre them."""
        box = self.box(p)
        if box is None:
            return centre
        kept = []
        for axis in range(3):
            reach = [offset[axis] for offset in offsets]
            low, high = box.low[axis] - min(reach), box.high[axis] - max(reach)
            middle = 0.5 * (low + high)
            kept.append(middle if low > high else max(low, min(high, centre[axis])))
        return (kept[0], kept[1], kept[2])

    def between_members(self, p: FormationRoomParams) -> float:
        """Return the distance (m) that the centres of two members keep when one passes the
        other."""
        return self._context.airframe.arm + p.clearance + 0.5 * self._widest

    def is_open(self, frame: MovingFrame, start: Vec3, end: Vec3, p: FormationRoomParams) -> bool:
        """Return whether a leg is inside the fence and clear of the world's obstacles. start, end:
        its ends, in the frame."""
        box, keep = self.box(p), self._context.airframe.arm + p.clearance
        steps = max(1, ceil(distance(start, end) / _STEP))
        for i in range(1, steps + 1):
            point = add(start, scale(sub(end, start), i / steps))
            point = add(frame.centre, frame.turned(point))
            if box is not None and not box.contains(point):
                return False
            if any(one.distance(point) < keep for one in self._solids):
                return False
        return True

    def obstacles(self, tick: Tick, delay: Time, left: Iterable[str]) -> tuple[Shape, ...]:
        """Return the obstacles of the vehicle: static and moving ones, the vehicles that are not
        members, and the members that have `left`. Vehicles are known from their messages."""
        balls = [grown(seen, tick.now) for seen in tick.moving.values()]
        for name in (*self._others, *left):
            news = tick.neighbours.heard(name, tick.now - delay)
            if name != self._context.vehicle and news is not None:
                vehicle = self._obstacles.vehicle(name, news.estimate, tick.now)
                balls += () if vehicle is None else (vehicle,)
        return (*self._solids, *(Sphere(seen.position, seen.radius) for seen in balls))

    def near(
        self,
        frame: MovingFrame,
        taken: TakenPlaces,
        obstacles: tuple[Shape, ...],
        speed: float,
        p: FormationRoomParams,
    ) -> list[tuple[Vec3, Surface]]:
        """Return each surface for which a place must slow down at `speed` (m/s), with the offset of
        that place from the centre. Obstacles far from all places are excluded at once. For the
        floor and the ceiling, which a turn doesn't bring nearer, only the nearest place is used."""
        centre, box, keep = frame.centre, self.box(p), self._context.airframe.arm + p.clearance
        reach, far = reach_of(speed), taken.radius
        solids = [o for o in obstacles if o.distance(centre) - keep - far < reach]
        sides: list[Surface] = []
        found: list[tuple[Vec3, Surface]] = []
        if box is not None:
            *sides, (below, up), (above, down) = walls(centre, box)
            sides = [side for side in sides if side.room - taken.reach < reach]
            ends = ((below + taken.low, up), (above - taken.high, down))
            found = [(ZERO, Surface(room, out)) for room, out in ends if room < reach]
        for offset in frame.all_turned(taken.places) if solids or sides else ():
            place = add(centre, offset)
            surfaces = [Surface(room + dot(offset, out), out) for room, out in sides]
            for one in solids:
                seen = around(one, place, keep + reach)
                surfaces += [Surface(apart - keep, outward) for apart, outward in seen]
            found += [(offset, one) for one in surfaces if one.room < reach]
        return found
