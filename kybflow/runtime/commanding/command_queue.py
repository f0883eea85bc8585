"""The queue between the sources of commands, which may run in any thread, and the tick that
executes the commands."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from threading import Lock
from typing import NamedTuple

from kybflow.core.signals import NS, Time
from kybflow.runtime.commanding.orders import (
    MOST_LETTERS,
    SCHEDULE,
    Answer,
    Order,
    named,
    parse,
    text,
)
from kybflow.runtime.commanding.situation import Situation

OVER = "the run is over"
MOST_WAITING = 1000
"""Largest number of items that may wait for one tick."""

Answered = Callable[[Answer], None]
"""Receives the answer to a command, exactly once: in the thread of the flight, or in the caller's
thread if the command is refused at once. It must only pass the answer on, and never wait or
raise."""
Shown = Callable[[Situation | None], None]
"""Receives the situation, or None if the run is over or too much is waiting. The rules are those of
`Answered`."""


class GivenCommand(NamedTuple):
    """A command. by: the name of the person who gave it. take: whether they take the lease from
    another. name: the event's name if the command was given as an event."""

    order: Order
    by: str
    take: bool = False
    answered: Answered = lambda _: None
    name: str = ""


class Question(NamedTuple):
    """A request to show the situation of the run."""

    shown: Shown


class ClientDisconnected(NamedTuple):
    """The notice that the client of the person `by` has disconnected, which ends its lease."""

    by: str


class ServerFailure(NamedTuple):
    """The notice that the server of commands has failed, in part or completely."""

    reason: str


class ClientsRefused(NamedTuple):
    """The notice that clients, or data that they sent, were refused before a command was read."""

    reason: str


class RecordedCommand(NamedTuple):
    """A command of an earlier run. heard: its time in that run. command: its text."""

    heard: Time
    command: str
    by: str
    take: bool


Item = GivenCommand | Question | ClientDisconnected | ServerFailure | ClientsRefused


class CommandQueue:
    """The commands and requests that wait for the next tick. `ask`, `look`, `leave`, `complain` and
    `warn` may be called in any thread and return at once.

    emitted: events to emit, each with its time (seconds since the start of the run). They are
    emitted only once the preflight is over.
    recorded: the commands of an earlier run, to be given at the same ticks.
    last_words: functions that are called at the end of the run and return a report on refused
    clients, empty without any.
    Raises CommandUnreadable for an invalid recorded command.
    """

    def __init__(
        self, emitted: Iterable[tuple[float, str]] = (), recorded: Iterable[RecordedCommand] = ()
    ) -> None:
        events = ((round(s * NS), GivenCommand(named(n), SCHEDULE, name=n)) for s, n in emitted)
        again = ((r.heard, GivenCommand(parse(r.command), r.by, r.take)) for r in recorded)
        self.scheduled = deque(sorted((*events, *again), key=lambda due: due[0]))
        self.waiting: deque[Item] = deque()
        self.last_words: list[Callable[[], str]] = []
        self._lock, self._closed = Lock(), False

    def ask(self, order: Order, by: str, answered: Answered, *, take: bool = False) -> None:
        """Give a command. by: the name of the person who gives it. answered: receives the answer.
        take: whether to take the lease from another person."""
        if by == SCHEDULE:
            answered(Answer(False, f"no client can be called `{SCHEDULE}`"))
        elif not (_is_line(by) and _is_line(text(order))):
            answered(
                Answer(False, f"a command is one line of at most {MOST_LETTERS} printed letters")
            )
        elif not self._put(GivenCommand(order, by, take, answered)):
            busy = f"{MOST_WAITING} commands are already waiting"
            answered(Answer(False, OVER if self._closed else busy))

    def look(self, shown: Shown) -> None:
        """Request the situation, which `shown` receives in the next tick."""
        if not self._put(Question(shown)):
            shown(None)

    def leave(self, by: str) -> None:
        """Release the lease if `by` holds it, because the connection of `by` has ended."""
        self._put(ClientDisconnected(by), bounded=False)

    def complain(self, reason: str) -> None:
        """Emit `commands_failed`, because the command server has failed."""
        self._put(ServerFailure(reason), bounded=False)

    def warn(self, reason: str) -> None:
        """Emit `clients_refused`, because clients, or data that they sent, were refused."""
        self._put(ClientsRefused(reason), bounded=False)

    def close(self) -> None:
        """Refuse everything that waits, and everything from now on, because the run is over."""
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
        """The scheduled commands that were never given: (seconds since the start of the run,
        name or text)."""
        return tuple((due / NS, given.name or text(given.order)) for due, given in self.scheduled)

    def _put(self, item: Item, *, bounded: bool = True) -> bool:
        with self._lock:
            if self._closed or (bounded and len(self.waiting) >= MOST_WAITING):
                return False
            self.waiting.append(item)
            return True


def _is_line(words: str) -> bool:
    """Return whether a text is printable and short enough to be recorded as one line."""
    return len(words) <= MOST_LETTERS and words.isprintable()
