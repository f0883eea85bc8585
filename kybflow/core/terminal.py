"""Read each key from the terminal as it is pressed, while a mission flies.

The shell gets the terminal back unchanged, however the run ends or stops. It is read only while the
run is in the foreground.
"""

from __future__ import annotations

import os
import select
import signal
import termios
import threading
from contextlib import suppress
from typing import Any

_AT_ONCE = 1024
_PASTES_MARKED, _PASTES_PLAIN = "\x1b[?2004h", "\x1b[?2004l"
_CURSOR_HIDDEN, _CURSOR_SHOWN = "\x1b[?25l", "\x1b[?25h"


class Terminal:
    """A context in which keys are neither echoed nor wait for Enter. Ctrl-C, Ctrl-Z and Ctrl-\\ act
    as ever; Ctrl-S is a key like others, for it would stop what the run prints, and so the run.

    number: the file descriptor that keys come from. screen: the one that the run prints to; None
    where it prints nowhere.
    """

    def __init__(self, number: int, screen: int | None) -> None:
        self._number, self._screen = number, screen
        self._before: list[Any] | None = None
        self._stops: Any = None
        self._is_closed = False

    def __enter__(self) -> Terminal:
        if threading.current_thread() is threading.main_thread():
            self._stops = signal.getsignal(signal.SIGTSTP)
            if self._stops is signal.SIG_DFL:  # else somebody has decided what it does
                signal.signal(signal.SIGTSTP, self._suspend)
        return self

    def __exit__(self, *_: object) -> None:
        self._is_closed = True
        if self._stops is signal.SIG_DFL:
            signal.signal(signal.SIGTSTP, self._stops)
        self._give_back()

    def read(self) -> bytes:
        """Return what was typed since the last time, without waiting."""
        try:
            if self._is_closed or not self._is_ours():
                return b""
            self._take()
            if not select.select([self._number], [], [], 0)[0]:
                return b""
            data = os.read(self._number, _AT_ONCE)
        except (OSError, termios.error):
            data = b""
        self._is_closed = not data
        return data

    def _take(self) -> None:
        """Set the terminal up, unless that is done and still in effect."""
        found = termios.tcgetattr(self._number)
        if self._before is not None and not found[3] & termios.ICANON:
            return
        asked = [*found[:6], [*found[6]]]
        asked[0] &= ~termios.IXON
        asked[3] &= ~(termios.ECHO | termios.ICANON)
        asked[6][termios.VMIN], asked[6][termios.VTIME] = 1, 0
        self._before = found
        termios.tcsetattr(self._number, termios.TCSANOW, asked)
        self._show(_PASTES_MARKED)

    def _give_back(self) -> None:
        """Restore the terminal. Unread keys are dropped: they were for the run, not for the
        shell."""
        before, self._before = self._before, None
        with suppress(OSError, termios.error):  # it may be gone, as this run may be for it
            if before is not None and self._is_ours():
                self._show(_PASTES_PLAIN)
                termios.tcflush(self._number, termios.TCIFLUSH)
                termios.tcsetattr(self._number, termios.TCSANOW, before)

    def _is_ours(self) -> bool:
        """Whether the run is in the foreground and its keys are for it."""
        return os.tcgetpgrp(self._number) == os.getpgrp()

    def _show(self, codes: str) -> None:
        """Write past the buffer of the screen, which may be in use when a signal comes."""
        if self._screen is not None:
            with suppress(OSError):  # it may be gone
                os.write(self._screen, codes.encode())

    def _suspend(self, number: int, _: object) -> None:
        """Ctrl-Z: leave the terminal to the shell, and stop until that goes on with the run."""
        self._give_back()
        self._show(_CURSOR_SHOWN)
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)
        signal.signal(number, self._suspend)
        self._show(_CURSOR_HIDDEN)
