"""Sends the commands typed at the run's own terminal.

The keys for `pause` and `land` act at once. Every other key only selects a command, which is shown
in the line below the keys and sent by Enter. A wrong key therefore moves no vehicle.
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
"""The commander's name in the record and for other clients."""
SHOWN_FOR = 10.0
"""Seconds that a selected command waits for Enter, and that a message is shown."""


class KeyMessage(NamedTuple):
    """The line below the keys. kind: `asked`, `accepted`, `refused` or empty."""

    text: str
    kind: str


class TerminalCommander:
    """Reads keys and sends their commands. Pass its `serve` to `fly` as a server. The display calls
    `read_keys` often, and `update` before it draws. offers: the commands that were legal at the
    last update. read: returns the time, s."""

    def __init__(self, terminal: Terminal, read: Callable[[], float] = time.monotonic) -> None:
        self.offers: tuple[Offer, ...] = ()
        self._terminal, self._read = terminal, read
        self._pressed, self._offered = PressedKeys(), OfferedKeys()
        self._commands: CommandQueue | None = None
        self._holder: str | None = None
        self._chosen: tuple[Order, bool] | None = None
        self._message = KeyMessage("", "")
        self._until = 0.0

    @contextmanager
    def serve(self, commands: CommandQueue, folder: Path) -> Iterator[None]:
        """Send commands to the run until the context ends."""
        self._commands = commands
        with self._terminal:
            try:
                yield
            finally:
                self._commands, self.offers = None, ()

    def read_keys(self) -> bool:
        """Handle the keys pressed since the last call. Return whether there were any."""
        if self._commands is None:
            return False
        keys = self._pressed.read(self._terminal.read())
        for key in keys:
            self._press(key)
        return bool(keys)

    def update(self, situation: Situation) -> None:
        """Update `offers` from the situation of the run."""
        if self._commands is not None:
            self._holder = situation.holder
            self.offers = self._offered.assign(situation, self._read())

    @property
    def message(self) -> KeyMessage:
        """The prompt to confirm the selected command, or else the answer to the last command."""
        if self._read() > self._until:
            self._chosen, self._message = None, KeyMessage("", "")
        return self._message

    def _press(self, key: str) -> None:
        """Handle a key: select, send or cancel a command. A selection expires after `SHOWN_FOR`."""
        chosen = self._chosen if self._read() <= self._until else None
        self._chosen = None
        if key == ENTER:
            if chosen is not None:
                self._give(*chosen)
        elif key == ESCAPE:
            self._show("", "")
        elif (offer := next((one for one in self.offers if one.key == key), None)) is None:
            self._show(f"`{key}` has no command now", "refused")
        elif isinstance(offer.order, AT_ONCE):
            self._give(offer.order)
        else:
            take = self._holder not in (None, BY)
            takes = f" and takes the lease from {self._holder}" if take else ""
            self._show(f"{text(offer.order)}? Enter gives it{takes}, Esc cancels", "asked")
            self._chosen = offer.order, take

    def _give(self, order: Order, take: bool = False) -> None:
        def answered(answer: Answer) -> None:
            kind = "accepted" if answer.accepted else "refused"
            link = ", but " if answer.accepted else ": "
            reason = f"{link}{answer.reason}" if answer.reason else ""
            self._show(f"{text(order)}: {kind}{reason}", kind)

        if self._commands is not None:
            self._show(f"{text(order)} ...", "asked")
            self._commands.ask(order, BY, answered, take=take)

    def _show(self, words: str, kind: str) -> None:
        self._message, self._until = KeyMessage(words, kind), self._read() + SHOWN_FOR
