"""How a member of a formation gets its place.

It comes to rest and waits. When all have come, each works out from the same news how the shape is
laid and who takes which place (`kybflow.flight.formation.places`). Who comes while others are in
formation takes a place that is free, with all who wait beside it, by a way round those who have
theirs (`kybflow.flight.formation.ways`). World frame, metres, radians.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import cos, sin
from typing import NamedTuple

from kybflow.core.geometry import ZERO, Vec3, add
from kybflow.core.signals import NS, Time
from kybflow.flight.formation import places
from kybflow.flight.formation.frame import MovingFrame, longest, mean_frame, mean_heading
from kybflow.flight.formation.ways import clear_way
from kybflow.flight.motion import Coast, Motion
from kybflow.runtime.behaviors.formation.members import WAITING, Member
from kybflow.runtime.behaviors.formation.room import FormationRoom, FormationRoomParams

_NOTICE: Time = NS // 10
"""How long a member waits, beyond the delay, until all have received it."""


class Rest(NamedTuple):
    """A member that comes to rest. began: when it began to. since: when it is at rest."""

    coast: Coast
    heading: float
    began: Time
    since: Time

    @classmethod
    def after(cls, motion: Motion, heading: float, now: Time) -> Rest:
        """Return how a member comes to rest from a motion."""
        coast = Coast.after(motion)
        return cls(coast, heading, now, now + round(coast.duration * NS))

    def at(self, now: Time) -> Motion:
        """Return where it is, and how it moves."""
        return self.coast.at((now - self.began) / NS)


class Assigned(NamedTuple):
    """The place that a member takes. frame, turned: the formation's frame, and how the shape is
    turned from its heading. place: its number. length: the longest straight way that those have who
    take theirs in the same time, metres. points: its own way, in the frame, to the place."""

    frame: MovingFrame
    turned: float
    place: int
    length: float
    points: tuple[Vec3, ...]


class Meeting:
    """Where the members of `team` meet whose formation has the places `shape`, for the one that is
    `own`.

    center, turned: where the centre is to be and how the shape is to be turned, None for what suits
    the members. is_led: its centre is where its leader has it. lacks: what it
    still needs for a place though all have come whom that needs, empty where that is nothing.
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
        """Return the place that the member takes which is at `rest`; None while not all have come
        whom that needs, or none is free. leader: where the leader has the frame, None while it is
        not received. heard: the time of the newest news that can have arrived."""
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
        """Return the place in a formation that all members lay together now."""
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
        """Return one of the places that are free; None where they are too few for all who wait, or
        no way leads there."""
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
