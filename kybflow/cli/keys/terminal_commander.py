"""The person at the run's own terminal, a commander like others.

`pause` and `land` act as their keys are pressed. Every other key chooses, and Enter gives what was
chosen, as the line below the keys says: a slip of the finger moves no vehicle, and an order is
given only as it was read.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from kybflow.cli.keys.offered import AT_ONCE, Offer, OfferedKeys
from kybflow.cli.keys.pressed import ENTER, ESCAPE, PressedKeys
from kybflow.core.terminal import Terminal
from kybflow.runtime.commanding.command_queue import CommandQueue
from kybflow.runtime.commanding.orders import Answer, Order, text
from kybflow.runtime.commanding.situation import Situation

BY = "terminal"
"""The commander's name, for the record and for others that are refused meanwhile."""
SAID_FOR = 10.0
"""Seconds for which a choice waits for Enter, and an answer is shown."""


class Saying(NamedTuple):
    """What the line below the keys says, and whether that is `asked`, `accepted` or `refused`."""

    text: str
    kind: str


class TerminalCommander:
    """`fly` is given `serve` as a server. Whoever shows the run calls `hear` often, `look` when it
    draws. offers: what is legal, as of the last look. read: the time, s."""

    def __init__(self, terminal: Terminal, read: Callable[[], float] = time.monotonic) -> None:
        self.offers: tuple[Offer, ...] = ()
        self._terminal, self._read = terminal, read
        self._pressed, self._offered = PressedKeys(), OfferedKeys()
        self._commands: CommandQueue | None = None
        self._holder: str | None = None
        self._chosen: tuple[Order, bool] | None = None
        self._said = Saying("", "")
        self._until = 0.0

    @contextmanager
    def serve(self, commands: CommandQueue, folder: Path) -> Iterator[None]:
        """Give commands to the run until the context ends."""
        self._commands = commands
        with self._terminal:
            try:
                yield
            finally:
                self._commands, self.offers = None, ()

    def hear(self) -> bool:
        """Do what the keys say that were pressed since the last time; whether there were any."""
        if self._commands is None:
            return False
        keys = self._pressed.read(self._terminal.read())
        for key in keys:
            self._press(key)
        return bool(keys)

    def look(self, situation: Situation) -> None:
        """Take in what is legal now."""
        if self._commands is not None:
            self._holder = situation.holder
            self.offers = self._offered.assign(situation, self._read())

    @property
    def saying(self) -> Saying:
        """What was chosen, or the last answer."""
        if self._read() > self._until:
            self._chosen, self._said = None, Saying("", "")
        return self._said

    def _press(self, key: str) -> None:
        """Choose, confirm or leave. What was chosen long ago is forgotten."""
        chosen = self._chosen if self._read() <= self._until else None
        self._chosen = None
        if key == ENTER:
            if chosen is not None:
                self._give(*chosen)
        elif key == ESCAPE:
            self._say("", "")
        elif (offer := next((one for one in self.offers if one.key == key), None)) is None:
            self._say(f"`{key}` is no key now", "refused")
        elif isinstance(offer.order, AT_ONCE):
            self._give(offer.order)
        else:
            take = self._holder not in (None, BY)
            takes = f" and takes the lease from {self._holder}" if take else ""
            self._say(f"{text(offer.order)}? Enter gives it{takes}, Esc leaves it", "asked")
            self._chosen = offer.order, take

    def _give(self, order: Order, take: bool = False) -> None:
        def answered(answer: Answer) -> None:
            kind = "accepted" if answer.accepted else "refused"
            link = ", but " if answer.accepted else ": "
            reason = f"{link}{answer.reason}" if answer.reason else ""
            self._say(f"{text(order)}: {kind}{reason}", kind)

        if self._commands is not None:
            self._say(f"{text(order)} ...", "asked")
            self._commands.ask(order, BY, answered, take=take)

    def _say(self, words: str, kind: str) -> None:
        self._said, self._until = Saying(words, kind), self._read() + SAID_FOR
