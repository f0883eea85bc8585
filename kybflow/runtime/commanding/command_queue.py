"""The queue between those who serve commands, in any thread, and the tick that hears them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from threading import Lock
from typing import NamedTuple

from kybflow.runtime.commanding.orders import Answer, Order
from kybflow.runtime.commanding.situation import Situation

OVER = "the run is over"
FULL = "too many commands wait for an answer"
MOST_WAITING = 1000

Answered = Callable[[Answer], None]
"""Receives the answer to a command, exactly once, in the thread of the flight or, when the run is
over, of the caller. It hands the answer on, doesn't wait and doesn't raise."""


class GivenCommand(NamedTuple):
    """A command that waits for the tick: who gives it, and whether they take the lease."""

    order: Order
    by: str
    take: bool
    answered: Answered


class CommandQueue:
    """What waits for the tick. Every method may be called in any thread and returns at once."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._closed = False
        self.commands: deque[GivenCommand] = deque()
        self.questions: deque[Callable[[Situation | None], None]] = deque()
        self.troubles: deque[str] = deque()

    def ask(self, order: Order, by: str, answered: Answered, *, take: bool = False) -> None:
        """Give a command. by: the name of who gives it. take: take the lease from another."""
        with self._lock:
            full = len(self.commands) >= MOST_WAITING
            if not (self._closed or full):
                self.commands.append(GivenCommand(order, by, take, answered))
                return
        answered(Answer(False, OVER if self._closed else FULL))

    def look(self, shown: Callable[[Situation | None], None]) -> None:
        """Ask for the situation in the next tick: `shown` receives it as `Answered` receives an
        answer; None when the run is over, or too many ask."""
        with self._lock:
            full = len(self.questions) >= MOST_WAITING
            if not (self._closed or full):
                self.questions.append(shown)
                return
        shown(None)

    def complain(self, reason: str) -> None:
        """Tell, as the event `commands_failed`, that commands are no longer served."""
        self.troubles.append(reason)

    def close(self) -> None:
        """The run is over: answer what waits, and everything that is asked from now on."""
        with self._lock:
            self._closed = True
        while self.commands:
            self.commands.popleft().answered(Answer(False, OVER))
        while self.questions:
            self.questions.popleft()(None)
