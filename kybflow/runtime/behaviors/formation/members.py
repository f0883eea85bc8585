"""The members of a formation, as one of them sees the others by their messages, and how they meet.

Each member publishes an `InFormation`. A member that publishes none, or one of another formation,
has not come yet or has left. A member is in trouble, so that the others stop and wait for it, if it
has been silent or held for longer than `freshness`, has no estimate, or is more than `doubt` from
its place, because its estimate jumped, the wind blows it away, or something holds it up.

A member first comes to rest and waits. When all members have come, each computes from the same
messages how the shape is laid out and who takes which place (`kybflow.flight.formation.places`).
Members that come while others are already in formation share the free places among themselves, and
fly there on paths around the others (`kybflow.flight.formation.frame`).

All members receive the same messages from the team, including their own. Everything that all of
them derive from these messages is a `Team`, which is computed only once a tick and shared; each
member then adds only its own part. So the cost of a tick doesn't grow with the square of the number
of members. World frame, metres, radians.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import cos, sin
from typing import NamedTuple

from kybflow.core.events import BehaviorEvent
from kybflow.core.geometry import ZERO, Vec3, add, distance, scale
from kybflow.core.signals import NS, Estimate, NeighbourState, Stamp, Tick, Time
from kybflow.flight.formation import places
from kybflow.flight.formation.frame import MovingFrame, clear_way, longest, mean_frame, mean_heading
from kybflow.flight.motion import Coast, Motion
from kybflow.runtime.behaviors.formation.room import FormationRoom, FormationRoomParams

NO_PLACE = -1
"""The place number of a member that has no place yet."""
_NEAR_AGAIN = 0.9
"""The fraction of `doubt` within which a member is no longer lost. It is less than 1, because a
member that is held up stays at about `doubt`, where the others stop."""


class NeighbourJoined(BehaviorEvent):
    """Another member has taken a place."""

    neighbour: str


class NeighbourLeft(BehaviorEvent):
    """Another member has left the formation."""

    neighbour: str


class NeighbourLost(BehaviorEvent):
    """Another member is in trouble: the others stop and wait for it."""

    neighbour: str
    reason: str


class NeighbourRecovered(BehaviorEvent):
    """A member that was lost has recovered."""

    neighbour: str


class InFormation(NamedTuple):
    """The message that a member of a formation publishes.

    key: a number that identifies the formation.
    since: when the member is, or was, at rest and ready.
    place: its place, -1 while it waits.
    settled: whether it has settled in its place.
    heading, rate, centre, velocity: its own copy of the formation's frame.
    turned: the angle from the frame's heading to the shape.
    point: the position at which it should be now.
    path, corner: the path along which it moves, 0 without one, and the corner to which it moves.
    """

    time: Stamp
    key: int
    since: int
    place: int
    settled: bool
    heading: float
    rate: float
    turned: float
    point: Vec3
    centre: Vec3
    velocity: Vec3
    path: int = 0
    corner: int = 0


class Member(NamedTuple):
    """A member according to its last message. said: what it published `age` seconds ago. lag: its
    distance from its point, metres. trouble: why it is in trouble, empty if it is not."""

    name: str
    said: InFormation
    age: float
    estimate: Estimate | None
    lag: float
    trouble: str

    @property
    def frame(self) -> MovingFrame:
        """The member's frame now, extrapolated from its message."""
        said = self.said
        frame = MovingFrame(said.centre, said.velocity, heading=said.heading, rate=said.rate)
        return frame.after(self.age)

    @property
    def position(self) -> Vec3 | None:
        """The member's position now, extrapolated from its message; None without an estimate."""
        known = self.estimate
        return None if known is None else add(known.position, scale(known.velocity, self.age))


class Team(NamedTuple):
    """The present members by name, in the order of the team, and figures that follow from their
    messages.

    troubled: the reason, for each member in trouble.
    Of the members with a place:
    placed: their names.
    taken: their places.
    stopping: those in trouble.
    unsettled: those in trouble or not settled.
    lag: the largest lag, metres.
    Of the members with a place that are not in trouble:
    holders: the first member in each place.
    positions: the positions, by place.
    frame: the mean frame, None without such members.
    Of the whole team:
    away: the members without a place.
    """

    members: Mapping[str, Member]
    troubled: Mapping[str, str]
    placed: frozenset[str]
    taken: frozenset[int]
    stopping: frozenset[str]
    unsettled: frozenset[str]
    lag: float
    holders: Mapping[int, str]
    positions: Mapping[int, Vec3]
    frame: MovingFrame | None
    away: tuple[str, ...]


class Members:
    """Receives the messages of the members of `team` in the formation `key`, for the member `own`.
    lost: the members that are in trouble, or were and have not returned to their places yet."""

    def __init__(self, team: tuple[str, ...], own: str, key: int) -> None:
        self.others = tuple(name for name in team if name != own)
        self.key, self._team, self._own = key, team, own
        self._rank = {name: rank for rank, name in enumerate(team)}
        self._placed: frozenset[str] = frozenset()
        self.lost: frozenset[str] = frozenset()

    def heard(self, tick: Tick, delay: Time, freshness: float, doubt: float) -> Team:
        """Return the team according to messages that are at least `delay` old."""

        def listened() -> Team:
            news = ((name, tick.neighbours.heard(name, tick.now - delay)) for name in self._team)
            found = (self._member(name, one, tick.now, freshness, doubt) for name, one in news)
            return _team({m.name: m for m in found if m is not None}, self._team)

        question = (self.key, self._team, tick.now, delay, freshness, doubt)
        return tick.neighbours.once(question, listened)

    def _member(
        self, name: str, news: NeighbourState | None, now: Time, freshness: float, doubt: float
    ) -> Member | None:
        if news is None or not isinstance(news.said, InFormation) or news.said.key != self.key:
            return None
        said, known = news.said, news.estimate
        age, silent = (now - said.time) / NS, (now - news.time) / NS
        lag = 0.0 if known is None else distance(known.position, said.point)
        if silent > freshness:
            trouble = f"silent for {silent:.2f} s"
        elif age > freshness:
            trouble = "held"
        elif known is None:
            trouble = "without an estimate"
        else:
            trouble = f"{lag:.2f} m from its place" if lag > doubt else ""
        return Member(name, said, age, known, lag, trouble)

    def but_own(self, team: Team) -> list[Member]:
        """Return the other members."""
        return [m for m in team.members.values() if m.name != self._own]

    def is_stopping(self, team: Team) -> bool:
        """Return whether another member with a place is in trouble."""
        return not team.stopping <= {self._own}

    def is_settled(self, team: Team) -> bool:
        """Return whether all others with a place are settled."""
        return team.unsettled <= {self._own}

    def goes_first(self, place: int, team: Team) -> bool:
        """Return whether another member that comes earlier in the team has the same place."""
        holder = team.holders.get(place, self._own)
        return holder != self._own and self._rank[holder] < self._rank.get(self._own, -1)

    def own_news(self, tick: Tick) -> Member | None:
        """Return the vehicle itself as a member, from its own message in this formation within the
        last tenth of a second; None if there is none."""
        news = tick.neighbours.heard(self._own, tick.now - 1)
        if news is None or not isinstance(news.said, InFormation) or news.said.key != self.key:
            return None
        age = (tick.now - news.said.time) / NS
        return Member(self._own, news.said, age, news.estimate, 0.0, "") if age < 0.1 else None

    def changes(self, team: Team, doubt: float) -> Iterator[BehaviorEvent]:
        """Yield an event for each change of the other members since the last call."""
        troubled, placed, before = team.troubled, team.placed, self.lost
        if not (troubled or before) and placed == self._placed:
            return
        here, own = team.members, {self._own}
        held_up = {n for n in before if n in here and here[n].lag > _NEAR_AGAIN * doubt}
        self.lost = lost = frozenset(held_up.union(troubled))
        for name in sorted(self._placed - here.keys() - own):
            yield NeighbourLeft(neighbour=name)
        for name in sorted(placed - self._placed - own):
            yield NeighbourJoined(neighbour=name)
        for name in sorted(lost - before - own):
            yield NeighbourLost(neighbour=name, reason=troubled[name])
        for name in sorted((before - lost - own) & here.keys()):
            yield NeighbourRecovered(neighbour=name)
        self._placed = placed


def _team(members: dict[str, Member], team: tuple[str, ...]) -> Team:
    placed = [m for m in members.values() if m.said.place != NO_PLACE]
    formed = [m for m in placed if not m.trouble]
    holders: dict[int, str] = {}
    positions: dict[int, Vec3] = {}
    for m in formed:
        if holders.setdefault(m.said.place, m.name) == m.name and m.position is not None:
            positions[m.said.place] = m.position
    names = frozenset(m.name for m in placed)
    return Team(
        members,
        {m.name: m.trouble for m in members.values() if m.trouble},
        names,
        frozenset(m.said.place for m in placed),
        frozenset(m.name for m in placed if m.trouble),
        frozenset(m.name for m in placed if m.trouble or not m.said.settled),
        max((m.lag for m in placed), default=0.0),
        holders,
        positions,
        mean_frame([m.frame for m in formed]) if formed else None,
        tuple(name for name in team if name not in names),
    )


_NOTICE_NS: Time = NS // 10
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
        formed = [m for m in sound if m.said.place != NO_PLACE]
        waiting = [m for m in sound if m.said.place == NO_PLACE]
        all_there = len(waiting) == len(self._team) - 1
        if not (formed or all_there) or (self._is_led and leader is None):
            return None
        since = max((rest.since, *(m.said.since for m in waiting)))
        if heard < since + _NOTICE_NS:
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
