"""The members of a formation, as one of them hears the others.

What a member says of itself is an `InFormation`. A member that says nothing, or speaks of another
formation, has not come yet or has left. One is in trouble, so that the others stop and wait for it,
when it has been silent or held for longer than `freshness`, when it has no estimate, and when that
is further from its place than `doubt`: it jumped, is blown away, or something holds it up.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kybflow.core.geometry import Vec3, add, distance, scale
from kybflow.core.signals import NS, Estimate, Stamp, Tick, Time
from kybflow.flight.formation.frame import MovingFrame

WAITING = -1
"""The place of a member that has none yet."""


class InFormation(NamedTuple):
    """What a member of a formation publishes: which formation, since when it has been ready, and
    its place, or -1 while it waits; the point where it is to be now; the frame as it has it, and
    how the shape is turned from the frame's heading."""

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


class Member(NamedTuple):
    """Another member as it is heard: what it says, `age` seconds ago, its estimate, and why it
    is in trouble, empty while it is not. lag: how far it is from its point, metres."""

    name: str
    said: InFormation
    age: float
    estimate: Estimate | None
    lag: float
    trouble: str

    @property
    def frame(self) -> MovingFrame:
        """The frame that it has now, if it has gone on as it said."""
        said = self.said
        frame = MovingFrame(said.centre, said.velocity, heading=said.heading, rate=said.rate)
        return frame.after(self.age)

    @property
    def position(self) -> Vec3 | None:
        """Where it is by now."""
        known = self.estimate
        return None if known is None else add(known.position, scale(known.velocity, self.age))


class Members:
    """Listens to the other members of `team`, those that speak of the formation `key`."""

    def __init__(self, team: tuple[str, ...], own: str, key: int) -> None:
        self.others = tuple(name for name in team if name != own)
        self.key, self._own = key, own
        self._troubled: dict[str, str] = {}
        self._placed: set[str] = set()

    def heard(self, tick: Tick, delay: Time, freshness: float, doubt: float) -> list[Member]:
        """Return the members that have come and not left, with the news that is `delay` old."""
        found = []
        for name in self.others:
            news = tick.neighbours.heard(name, tick.now - delay)
            if news is None or not isinstance(news.said, InFormation) or news.said.key != self.key:
                continue
            said, known = news.said, news.estimate
            age, silent = (tick.now - said.time) / NS, (tick.now - news.time) / NS
            lag = 0.0 if known is None else distance(known.position, said.point)
            if silent > freshness:
                trouble = f"silent for {silent:.2f} s"
            elif age > freshness:
                trouble = "held"
            elif known is None:
                trouble = "without an estimate"
            else:
                trouble = f"{lag:.2f} m from its place" if lag > doubt else ""
            found.append(Member(name, said, age, known, lag, trouble))
        return found

    def own_news(self, tick: Tick) -> Member | None:
        """Return what the vehicle itself said of this formation in the last ticks; None where it
        was not in it."""
        news = tick.neighbours.heard(self._own, tick.now - 1)
        if news is None or not isinstance(news.said, InFormation) or news.said.key != self.key:
            return None
        age = (tick.now - news.said.time) / NS
        return Member(self._own, news.said, age, news.estimate, 0.0, "") if age < 0.1 else None

    def changes(self, members: list[Member], *, whole: bool) -> Iterator[tuple[str, str, str]]:
        """Yield each change since the last call: the event, the neighbour, and the reason. whole:
        the formation was complete, so that who is in place now has joined it."""
        troubled = {m.name: m.trouble for m in members if m.trouble}
        placed = {m.name for m in members if m.said.place != WAITING}
        for name in sorted(self._placed - {m.name for m in members}):
            yield "neighbour_left", name, ""
        for name in sorted(placed - self._placed) if whole else ():
            yield "neighbour_joined", name, ""
        for name in sorted(troubled.keys() - self._troubled.keys()):
            yield "neighbour_lost", name, troubled[name]
        for name in sorted((self._troubled.keys() - troubled.keys()) & {m.name for m in members}):
            yield "neighbour_recovered", name, ""
        self._troubled, self._placed = troubled, placed
