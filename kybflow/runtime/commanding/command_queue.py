"""The queue between those who give commands, in any thread, and the tick that executes them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from threading import Lock
from typing import NamedTuple

from kybflow.core.signals import NS, Time
from kybflow.runtime.commanding.lease import SCHEDULE
from kybflow.runtime.commanding.orders import LONGEST, Answer, Order, named, parse, text
from kybflow.runtime.commanding.situation import Situation

OVER = "the run is over"
MOST_WAITING = 1000
"""Largest number of items that may wait for one tick."""

Answered = Callable[[Answer], None]
"""Receives the answer to a command, exactly once, in the thread of the flight or, where it is
refused at once, of the caller. It hands the answer on, doesn't wait and doesn't raise."""
Shown = Callable[[Situation | None], None]
"""Receives the situation as `Answered` does an answer; None instead when the run is over."""


class GivenCommand(NamedTuple):
    """A command, who gave it, and whether they take the lease from another. name: the event if it
    was given as one."""

    order: Order
    by: str
    take: bool = False
    answered: Answered = lambda _: None
    name: str = ""


class Question(NamedTuple):
    """A request for the situation."""

    shown: Shown


class ClientDisconnected(NamedTuple):
    """A client has disconnected; its lease ends with it."""

    by: str


class ServerFailure(NamedTuple):
    """The serving of commands has failed, in part or wholly."""

    reason: str


class ClientsRefused(NamedTuple):
    """Clients, or what they sent, were refused before there was a command."""

    reason: str


class RecordedCommand(NamedTuple):
    """A command of an earlier run, in words, and its time in that run."""

    heard: Time
    command: str
    by: str
    take: bool


Item = GivenCommand | Question | ClientDisconnected | ServerFailure | ClientsRefused


class CommandQueue:
    """What waits for the tick. `ask`, `look`, `leave`, `complain` and `warn` may be called in any
    thread and return at once.

    emitted: events to give, each with its time in seconds of the run; their time counts in flight
    only. recorded: the commands of an earlier run, to be given at the same ticks. Raises
    CommandUnreadable for an invalid one. last_words: functions that return what to report of
    refused clients when the run ends, empty for nothing.
    """

    def __init__(
        self,
        emitted: Iterable[tuple[float, str]] = (),
        recorded: Iterable[RecordedCommand] = (),
    ) -> None:
        events = ((round(s * NS), GivenCommand(named(n), SCHEDULE, name=n)) for s, n in emitted)
        again = ((r.heard, GivenCommand(parse(r.command), r.by, r.take)) for r in recorded)
        self.scheduled = deque(sorted((*events, *again), key=lambda due: due[0]))
        self.waiting: deque[Item] = deque()
        self.last_words: list[Callable[[], str]] = []
        self._lock, self._closed = Lock(), False

    def ask(self, order: Order, by: str, answered: Answered, *, take: bool = False) -> None:
        """Give a command. by: the name of who gives it. take: take the lease from another."""
        if by == SCHEDULE:
            answered(Answer(False, f"nobody may be called `{SCHEDULE}`"))
        elif not (_is_line(by) and _is_line(text(order))):
            answered(Answer(False, f"a command is one line of at most {LONGEST} printed letters"))
        elif not self._put(GivenCommand(order, by, take, answered)):
            busy = f"{MOST_WAITING} commands wait already"
            answered(Answer(False, OVER if self._closed else busy))

    def look(self, shown: Shown) -> None:
        """Ask for the situation in the next tick."""
        if not self._put(Question(shown)):
            shown(None)

    def leave(self, by: str) -> None:
        """Release the lease if `by` holds it, because their connection has ended."""
        self._put(ClientDisconnected(by), bounded=False)

    def complain(self, reason: str) -> None:
        """Emit `commands_failed`: commands are not served as they should be."""
        self._put(ServerFailure(reason), bounded=False)

    def warn(self, reason: str) -> None:
        """Emit `clients_refused`: clients, or what they sent, were refused."""
        self._put(ClientsRefused(reason), bounded=False)

    def close(self) -> None:
        """End the run: refuse what waits, and everything from now on."""
        with self._lock:
            self._closed = True
        while self.waiting:
            match self.waiting.popleft():
                case GivenCommand() as given:
                    given.answered(Answer(False, OVER))
                case Question(shown):
                    shown(None)

    @property
    def never_given(self) -> tuple[tuple[float, str], ...]:
        """The scheduled commands that were not given, each with its seconds of the run."""
        return tuple((due / NS, given.name or text(given.order)) for due, given in self.scheduled)

    def _put(self, item: Item, *, bounded: bool = True) -> bool:
        with self._lock:
            if self._closed or (bounded and len(self.waiting) >= MOST_WAITING):
                return False
            self.waiting.append(item)
            return True


def _is_line(words: str) -> bool:
    """Return whether a text can be recorded as one line."""
    return len(words) <= LONGEST and words.isprintable()
