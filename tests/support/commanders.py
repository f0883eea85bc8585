"""People who command a flight in a test, through the queue that servers use."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from kybflow.core.signals import NS, Time
from kybflow.runtime.commanding.command_queue import CommandQueue
from kybflow.runtime.commanding.orders import Answer, parse
from kybflow.runtime.commanding.situation import Situation
from kybflow.runtime.engine import Engine


class Asked(NamedTuple):
    """A command of a test: the seconds at which it is given, its words, by whom."""

    seconds: float
    words: str
    by: str = "anna"
    take: bool = False


class Told(NamedTuple):
    """An answer, and the ticks that it took."""

    words: str
    by: str
    answer: Answer
    took: Time


class People:
    """Gives commands at their times, `leave` as the end of a connection; keeps the answers and what
    the situation was when each was heard."""

    def __init__(self, *asked: Asked) -> None:
        self._left = sorted(asked, key=lambda one: one.seconds)
        self.told: list[Told] = []
        self.saw: list[Situation] = []

    @contextmanager
    def serve(self, queue: CommandQueue, folder: Path) -> Iterator[None]:
        assert folder.is_dir()
        self.queue = queue
        yield

    def look(self, engine: Engine) -> None:
        while self._left and self._left[0].seconds * NS <= engine.clock.now:
            self._give(self._left.pop(0), engine)

    def _give(self, asked: Asked, engine: Engine) -> None:
        _, words, by, take = asked
        given = engine.clock.now

        def answered(answer: Answer) -> None:
            took = (engine.events.now - given) // engine.clock.period
            self.told.append(Told(words, by, answer, took))

        if words == "leave":
            self.queue.leave(by)
            return
        self.queue.look(self._see)
        self.queue.ask(parse(words), by, answered, take=take)

    def _see(self, situation: Situation | None) -> None:
        assert situation is not None
        self.saw.append(situation)

    @property
    def answers(self) -> list[tuple[str, bool, str]]:
        return [(told.words, *told.answer) for told in self.told]
