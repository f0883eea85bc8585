"""Assigns a member of a formation to its place.

The member comes to rest and waits. When all members have come, each computes from the same messages
how the shape is laid out and who takes which place (`kybflow.flight.formation.places`). Members
that come while others are already in formation share the free places among themselves, and fly
there on paths around the others (`kybflow.flight.formation.frame`). World frame, metres, radians.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import cos, sin
from typing import NamedTuple

from kybflow.core.geometry import ZERO, Vec3, add
from kybflow.core.signals import NS, Time
from kybflow.flight.formation import places
from kybflow.flight.formation.frame import MovingFrame, clear_way, longest, mean_frame, mean_heading
from kybflow.flight.motion import Coast, Motion
from kybflow.runtime.behaviors.formation.members import WAITING, Member
from kybflow.runtime.behaviors.formation.room import FormationRoom, FormationRoomParams

_NOTICE: Time = NS // 10
"""How long a member waits, in addition to the delay, until all others have received its message."""


class Rest(NamedTuple):
    """A member that comes to rest. began: when it began to brake. since: when it is at rest."""

    coast: Coast
    heading: float
    began: Time
    since: Time

    @classmethod
    def after(cls, motion: Motion, heading: float, now: Time) -> Rest:
        """Return the rest of a member that begins to brake from this motion now."""
        coast = Coast.after(motion)
        return cls(coast, heading, now, now + round(coast.duration * NS))

    def at(self, now: Time) -> Motion:
        """Return the member's motion at `now`."""
        return self.coast.at((now - self.began) / NS)


class Assigned(NamedTuple):
    """The place that a member takes.

    frame: the formation's frame.
    turned: the angle from the frame's heading to the shape.
    place: the number of the place.
    length: the longest straight distance (m) to a place among the members that set out together.
    points: the member's path to its place, in the frame.
    """

    frame: MovingFrame
    turned: float
    place: int
    length: float
    points: tuple[Vec3, ...]


class Meeting:
    """The meeting of the members of `team`, as the member `own` sees it. shape: the places of their
    formation.

    center, turned: the requested centre and turn of the shape, None for the ones that suit the
    members best. is_led: whether a leader determines the centre. lacks: what prevents the member
    from taking a place although enough members have come, empty if nothing does.
    """

    def __init__(
        self,
        team: tuple[str, ...],
        own: str,
        shape: tuple[Vec3, ...],
        room: FormationRoom,
        center: Vec3 | None,
        turned: float | None,
        *,
        is_led: bool,
    ) -> None:
        self._team, self._own, self._shape, self._room = team, own, shape, room
        self._center, self._turned, self._is_led = center, turned, is_led
        self.lacks = ""

    def assigned(
        self,
        rest: Rest,
        others: Iterable[Member],
        leader: MovingFrame | None,
        heard: Time,
        p: FormationRoomParams,
    ) -> Assigned | None:
        """Return the place that the member at `rest` takes; None while other members are still
        missing, or while no place is free or reachable.

        leader: the frame that the leader determines, None while it is unknown.
        heard: the time of the newest messages that can have arrived.
        """
        sound = [m for m in others if not m.trouble]
        formed = [m for m in sound if m.said.place != WAITING]
        waiting = [m for m in sound if m.said.place == WAITING]
        all_there = len(waiting) == len(self._team) - 1
        if not (formed or all_there) or (self._is_led and leader is None):
            return None
        since = max((rest.since, *(m.said.since for m in waiting)))
        if heard < since + _NOTICE:
            return None
        here = {m.name: m.said.point for m in waiting} | {self._own: rest.coast.end}
        here = {name: here[name] for name in self._team if name in here}
        if formed:
            return self._joined(formed, here, p)
        heads = [rest.heading, *(m.said.heading for m in waiting)]
        heading = mean_heading(sum(map(cos, heads)), sum(map(sin, heads)))
        return self._laid(here, leader or MovingFrame(ZERO, heading=heading), p)

    def _laid(self, here: dict[str, Vec3], frame: MovingFrame, p: FormationRoomParams) -> Assigned:
        """Return the place in a formation that all members lay out together now."""
        centre = frame.centre if self._is_led else self._center
        found = places.laid(tuple(here.values()), self._shape, frame.heading, centre, self._turned)
        offsets = [frame.turned(places.turned_by(found.turned, place)) for place in self._shape]
        centre = frame.centre if self._is_led else self._room.centred(found.centre, offsets, p)
        goals = [add(centre, offsets[i]) for i in found.taken]
        way = longest(zip(here.values(), goals, strict=True))
        place = found.taken[list(here).index(self._own)]
        goal = places.turned_by(found.turned, self._shape[place])
        return Assigned(frame._replace(centre=centre), found.turned, place, way, (goal,))

    def _joined(
        self, formed: list[Member], here: dict[str, Vec3], p: FormationRoomParams
    ) -> Assigned | None:
        """Return one of the free places of an existing formation; None if there are too few for all
        that wait, or if no clear path leads there."""
        frame, turned = mean_frame([m.frame for m in formed]), formed[0].said.turned
        taken = {m.said.place for m in formed}
        free = [i for i in range(len(self._shape)) if i not in taken]
        if len(free) < len(here):
            self.lacks = "a free place"
            return None
        shape = [places.turned_by(turned, place) for place in self._shape]
        goals = [add(frame.centre, frame.turned(shape[i])) for i in free]
        columns = places.assigned(tuple(here.values()), goals)
        own = free[columns[list(here).index(self._own)]]
        start = frame.place(Motion(here[self._own])).position
        points = clear_way(
            start, shape[own], [shape[i] for i in taken], self._room.between_members(p),
            lambda one, end: self._room.is_open(frame, one, end, p),
        )  # fmt: skip
        self.lacks = "" if points else "a clear way to its place"
        if points is None:
            return None
        length = longest(zip(here.values(), (goals[column] for column in columns), strict=True))
        return Assigned(frame, turned, own, length, points)
