"""The bodies that motion capture tracks besides the vehicles, read once a tick for all vehicles:
moving obstacles, and objects.

Motion capture measures them like vehicles, late and with noise; no vehicle knows their true poses.
A body that has not been seen for half a second is lost until it is seen again. If a body's poses
have wavered before, a pose that repeats the last one bit by bit means that motion capture has lost
the body, and is ignored.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isfinite
from typing import Generic, Protocol, TypeVar

from kybflow.core.errors import described
from kybflow.core.events import RunEvent
from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Measurement, Pose, Time
from kybflow.parts import Stream
from kybflow.runtime.events import Events, WorldObserver
from kybflow.runtime.monitoring.bodies import STILL_DISTANCE, WAVERING_POSES
from kybflow.runtime.monitoring.sensing import MAX_LEAD_NS

UNSEEN_NS: Time = NS // 2
"""How long a body may be unseen before it is lost."""


class Observed(Protocol):
    """What was seen of a body, and when."""

    @property
    def time(self) -> Time: ...


S = TypeVar("S", bound=Observed)
Track = Sequence[Pose]
"""The poses of a body in the last `span`, oldest first."""
Observe = Callable[[str, Track], S]
"""Returns what the poses show of the body with this name."""


class TrackedBodies(Generic[S]):
    """Bodies and the streams of their poses, by name. seen: what was last seen of each body.

    span: how old the poses are that `observe` gets, ns. lost, found: make the events of a body that
    is lost, given its name and the reason, and of one that is seen again. observer: receives the
    poses.
    """

    def __init__(
        self,
        streams: Mapping[str, Stream],
        span: Time,
        observe: Observe[S],
        events: Events,
        lost: Callable[[str, str], RunEvent],
        found: Callable[[str], RunEvent],
        observer: WorldObserver | None = None,
    ) -> None:
        self.seen: dict[str, S] = {}
        self._observe, self._events = observe, events
        self._lost_event, self._found_event = lost, found
        note = (observer or WorldObserver()).body
        self._watched = {
            name: _Watched(name, stream, span, note) for name, stream in streams.items()
        }
        self._lost: set[str] = set()

    @property
    def has_bodies(self) -> bool:
        return bool(self._watched)

    def step(self, now: Time) -> None:
        """Read every body. The engine calls it once a tick."""
        for name, watched in self._watched.items():
            if watched.look(now):
                self.seen[name] = self._observe(name, watched.track)
                if name in self._lost:
                    self._lost.discard(name)
                    self._events.emit(self._found_event(name))
            elif (
                name in self.seen and name not in self._lost and self._unseen(name, now) > UNSEEN_NS
            ):
                self._lost.add(name)
                reason = _because(f"not seen for {UNSEEN_NS / NS:g} s", watched.trouble())
                self._events.emit(self._lost_event(name, reason))

    def objections(self, now: Time) -> Iterator[tuple[str, str | None]]:
        """Yield the name of each body and why no vehicle may take off because of it; None if the
        body is seen."""
        for name, watched in self._watched.items():
            unseen = name not in self.seen or self._unseen(name, now) > UNSEEN_NS
            yield name, _because("it is not seen", watched.trouble()) if unseen else None

    def _unseen(self, name: str, now: Time) -> Time:
        return now - self.seen[name].time


class _Watched:
    """One body and the stream of its poses."""

    def __init__(
        self,
        name: str,
        stream: Stream,
        span: Time,
        note: Callable[[Time, str, Measurement], None],
    ) -> None:
        self._name, self._note = name, note
        self.track: deque[Pose] = deque()
        self._stream, self._span = stream, span
        self._failure: str | None = None
        self._wavered = 0

    def look(self, now: Time) -> bool:
        """Read the stream; return whether a new pose was added to the track."""
        came: Sequence[Measurement] = ()
        try:
            came, self._failure = self._stream.read(now), None
        except Exception as error:  # a part may raise anything; then nothing is seen
            self._failure = described(error)
        is_new = False
        for pose in came:
            if type(pose) is Pose:
                self._note(now, self._name, pose)
                is_new |= self._is_new(pose, now)
        return is_new

    def trouble(self) -> str | None:
        """Return why the body can't be seen, or None if no reason is known."""
        return self._failure or self._stream.trouble()

    def _is_new(self, pose: Pose, now: Time) -> bool:
        """Add a pose to the track if it is valid, newer than the last one, and not a repetition
        that shows a lost body. Return whether it was added."""
        if not all(map(isfinite, (*pose.position, *pose.attitude))):
            return False
        if self.track:
            time, place, attitude = self.track[-1]
            if not time < pose.time <= now + MAX_LEAD_NS:
                return False
            repeats = pose.position == place and pose.attitude == attitude
            if repeats and self._wavered >= WAVERING_POSES:
                return False
            wavers = not repeats and distance(pose.position, place) < STILL_DISTANCE
            self._wavered = min(self._wavered + 1, WAVERING_POSES) if wavers else self._wavered
        self.track.append(pose)
        while pose.time - self.track[0].time > self._span:
            self.track.popleft()
        return True


def _because(what: str, trouble: str | None) -> str:
    return f"{what}: {trouble}" if trouble else what
