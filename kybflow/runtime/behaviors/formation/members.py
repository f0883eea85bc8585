"""The members of a formation, by what one of them receives.

Each member publishes an `InFormation`. A member that publishes none, or one of another formation,
has not come yet or has left. A member is in trouble, so that the others stop and wait for it, if it
has been silent or held for longer than `freshness`, has no estimate, or is further from its place
than `doubt`: it jumped, is blown away, or something holds it up.

All members receive the same from the team, themselves included. So what follows from that for any
of them is a `Team`, computed once a tick; each member then adds only its own part, and the cost of
a tick does not grow with the square of the members.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from kybflow.core.events import BehaviorEvent
from kybflow.core.geometry import Vec3, add, distance, scale
from kybflow.core.signals import NS, Estimate, NeighbourState, Stamp, Tick, Time
from kybflow.flight.formation.frame import MovingFrame, mean_frame

WAITING = -1
"""The place of a member that has none yet."""
_NEAR_AGAIN = 0.9
"""The share of `doubt` within which a member is no longer lost: one that is held up stays near
`doubt`, where the others stop."""


class NeighbourJoined(BehaviorEvent):
    """Another member took a place."""

    neighbour: str


class NeighbourLeft(BehaviorEvent):
    """Another member has left the formation."""

    neighbour: str


class NeighbourLost(BehaviorEvent):
    """Another member is in trouble: the others stop and wait for it."""

    neighbour: str
    reason: str


class NeighbourRecovered(BehaviorEvent):
    """A member that was lost is well again."""

    neighbour: str


class InFormation(NamedTuple):
    """What a member of a formation publishes: which formation, since when it has been ready, and
    its place, or -1 while it waits; the point where it is to be now; the frame as it has it, and
    how the shape is turned from the frame's heading; which path it moves along, 0 for none, and
    the corner that it makes for."""

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
    """A member as it is received: what it published `age` seconds ago, its estimate, and why it is
    in trouble, empty while it is not. lag: how far it is from its point, metres."""

    name: str
    said: InFormation
    age: float
    estimate: Estimate | None
    lag: float
    trouble: str

    @property
    def frame(self) -> MovingFrame:
        """Its frame now, extrapolated from what it published."""
        said = self.said
        frame = MovingFrame(said.centre, said.velocity, heading=said.heading, rate=said.rate)
        return frame.after(self.age)

    @property
    def position(self) -> Vec3 | None:
        """Its position now, extrapolated."""
        known = self.estimate
        return None if known is None else add(known.position, scale(known.velocity, self.age))


class Team(NamedTuple):
    """The present members by name, in the order of the team, and what follows from what they
    publish.

    troubled: why, of those in trouble. Of those with a place: placed, their names; taken, their
    places; stopping, who are in trouble; unsettled, who are that or not settled; lag, the largest.
    Of those among them in no trouble: holders, the first in each place; positions, by place; frame,
    the mean of theirs, None where there are none. away: who of the team has no place.
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
    """Listens to the members of `team`, those that speak of the formation `key`, for the one that
    is `own`. lost: who is in trouble, and who was and is not near its place again."""

    def __init__(self, team: tuple[str, ...], own: str, key: int) -> None:
        self.others = tuple(name for name in team if name != own)
        self.key, self._team, self._own = key, team, own
        self._rank = {name: rank for rank, name in enumerate(team)}
        self._placed: frozenset[str] = frozenset()
        self.lost: frozenset[str] = frozenset()

    def heard(self, tick: Tick, delay: Time, freshness: float, doubt: float) -> Team:
        """Return the team by the news that is `delay` old."""

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
        """Return whether a member that goes first has the same place."""
        holder = team.holders.get(place, self._own)
        return holder != self._own and self._rank[holder] < self._rank.get(self._own, -1)

    def own_news(self, tick: Tick) -> Member | None:
        """Return what the vehicle itself published of this formation in the last ticks, None if it
        was not in it."""
        news = tick.neighbours.heard(self._own, tick.now - 1)
        if news is None or not isinstance(news.said, InFormation) or news.said.key != self.key:
            return None
        age = (tick.now - news.said.time) / NS
        return Member(self._own, news.said, age, news.estimate, 0.0, "") if age < 0.1 else None

    def changes(self, team: Team, doubt: float) -> Iterator[BehaviorEvent]:
        """Yield each change of others since the last call."""
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
    placed = [m for m in members.values() if m.said.place != WAITING]
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
