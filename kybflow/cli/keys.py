"""The keyboard of the terminal in which a mission flies: decodes the keys, assigns commands to them
and sends the commands. The terminal is read between ticks, without a thread.

A few letters have the same meaning in every run. Events, states and phases of the mission get the
digits and then the other letters, in order. They keep their keys, so that no key changes its
meaning while a person presses it.

The keys for `pause` and `land` act at once. Every other key only selects a command, which is shown
in the line below the keys and sent by Enter. A wrong key therefore moves no vehicle.
"""

from __future__ import annotations

import re
import string
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import NamedTuple

from kybflow.core.terminal import Terminal
from kybflow.dsl.names import BUILT_IN
from kybflow.dsl.plan import Emit, EnterPhase, Stop, Switch
from kybflow.runtime.commanding import orders
from kybflow.runtime.commanding.command_queue import CommandQueue
from kybflow.runtime.commanding.situation import Situation

ENTER, ESCAPE = "enter", "escape"
_PASTE, _PASTED = "\x1b[200~", "\x1b[201~"
_UNIT = re.compile(
    r"\x1b\[[0-?]*[ -/]*[@-~]|\x1bO[^\x1b]|\x1b[^\[O\x1b]|\x1b(?=\x1b)|[^\x1b]", re.DOTALL
)
"""One of: a named key such as an arrow, a key pressed with Alt, an escape before another escape, or
a letter."""
_NAMED = {"\r": ENTER, "\n": ENTER, "\x1b": ESCAPE}


class PressedKeys:
    """Decodes the bytes of a terminal. Arrows, function keys and pasted text are ignored, so that
    pasting sends no command."""

    def __init__(self) -> None:
        self._rest = ""
        self._pastes = False

    def read(self, data: bytes) -> list[str]:
        """Return the keys in `data`: printable letters, ENTER and ESCAPE. Empty data ends a pending
        escape sequence."""
        text = self._rest + data.decode("utf-8", errors="ignore")
        keys: list[str] = []
        end = 0
        while unit := _UNIT.match(text, end):
            end = unit.end()
            self._take(unit.group(), keys)
        self._rest = text[end:] if data else ""
        if text[end:] == "\x1b" and not data:
            self._take("\x1b", keys)
        return keys

    def _take(self, unit: str, keys: list[str]) -> None:
        if unit in (_PASTE, _PASTED):
            self._pastes = unit == _PASTE
        elif not self._pastes and (key := _NAMED.get(unit, unit)).isprintable():
            keys.append(key)


FIXED: dict[str, orders.Order] = {
    "p": orders.PauseOrder(),
    "l": orders.LandOrder(),
    "r": orders.ResumeOrder(),
    "x": orders.ResetOrder(),
    "s": Stop(""),
}
AT_ONCE = (orders.PauseOrder, orders.LandOrder)
"""The orders that are sent at once; all others wait for Enter."""
KEYS = tuple(key for key in string.digits[1:] + string.ascii_letters if key not in FIXED)
_OF_ANY_VEHICLE = frozenset({"hover", "auto_home"})
"""The built-in states that have a key. `land` and the failsafes lead to the others."""


class Offer(NamedTuple):
    """A command that is legal now. group: empty, `events`, a vehicle or a flow. key: empty if all
    keys are taken."""

    group: str
    name: str
    order: orders.Order
    key: str = ""


class OfferedKeys:
    """Assigns keys to commands. If all keys are taken, a new command takes the key of the one that
    has been illegal for longest, provided that this is more than `rest` seconds."""

    def __init__(self, rest: float = 10.0) -> None:
        self._rest = rest
        self._keys: dict[orders.Order, str] = {}
        self._legal: dict[orders.Order, float] = {}

    def assign(self, situation: Situation, now: float) -> tuple[Offer, ...]:
        """Return the commands that are legal at time `now` (s), with their keys."""
        free = [key for key in KEYS if key not in self._keys.values()]
        legal = []
        for offer, is_legal in _known(situation):
            if offer.order not in self._keys and free:
                self._keys[offer.order] = free.pop(0)
            if is_legal:
                legal.append(offer)
                self._legal[offer.order] = now
        found = [*_fixed(situation)]
        for offer in legal:
            if offer.order not in self._keys:
                oldest = min(self._keys, key=self._last_legal)
                if now - self._last_legal(oldest) > self._rest:
                    self._keys[offer.order] = self._keys.pop(oldest)
            found.append(offer._replace(key=self._keys.get(offer.order, "")))
        return tuple(found)

    def _last_legal(self, order: orders.Order) -> float:
        return self._legal.get(order, -inf)


def _fixed(situation: Situation) -> Iterator[Offer]:
    vehicles = situation.vehicles
    legal = {
        "p": any(v.pause is None and "pause" not in v.holders for v in vehicles),
        "l": any(v.land is None and v.retired is None for v in vehicles),
        "r": any(v.resume is None for v in vehicles),
        "x": any(v.reset is None and (v.state == "fault" or v.latched) for v in vehicles),
        "s": True,
    }
    for key, order in FIXED.items():
        name = orders.text(order)
        if legal[key] or situation.emit.get(f"{orders.PREFIX}{name}", False):
            yield Offer("", name, order, key)


def _known(situation: Situation) -> Iterator[tuple[Offer, bool]]:
    """Yield every possible command except the fixed ones, and whether it is legal now."""
    for name, waits in situation.emit.items():
        if name not in orders.COMMANDS:
            yield Offer("events", name, Emit(name)), waits
    for vehicle in situation.vehicles:
        states: dict[str, bool] = {}  # a chain counts as one state
        for state, reason in vehicle.enter.items():
            if state not in BUILT_IN or state in _OF_ANY_VEHICLE:
                states.setdefault(state.partition(".")[0], reason is None)
        for state, is_legal in states.items():
            offer = Offer(vehicle.name, state, Switch(vehicle.name, state))
            yield offer, is_legal and state != vehicle.state
    for flow in situation.flows:
        for phase, reason in flow.enter.items():
            offer = Offer(flow.name, phase, EnterPhase(flow.name, phase))
            yield offer, reason is None and phase != flow.phase


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
        self._chosen: tuple[orders.Order, bool] | None = None
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
            self._show(f"{orders.text(offer.order)}? Enter gives it{takes}, Esc cancels", "asked")
            self._chosen = offer.order, take

    def _give(self, order: orders.Order, take: bool = False) -> None:
        def answered(answer: orders.Answer) -> None:
            kind = "accepted" if answer.accepted else "refused"
            link = ", but " if answer.accepted else ": "
            reason = f"{link}{answer.reason}" if answer.reason else ""
            self._show(f"{orders.text(order)}: {kind}{reason}", kind)

        if self._commands is not None:
            self._show(f"{orders.text(order)} ...", "asked")
            self._commands.ask(order, BY, answered, take=take)

    def _show(self, words: str, kind: str) -> None:
        self._message, self._until = KeyMessage(words, kind), self._read() + SHOWN_FOR
