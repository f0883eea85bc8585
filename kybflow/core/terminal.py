"""Read each key from the terminal as it is pressed, while a mission flies.

However the run ends or is stopped, the terminal's settings are restored. Keys are read only while
the run is in the foreground.
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
    """A context in which keys are not echoed and don't wait for Enter. Ctrl-C, Ctrl-Z and Ctrl-\\
    work as usual. Ctrl-S is an ordinary key, because it would block the run's output and so the
    run.

    number: the file descriptor from which keys are read. screen: the file descriptor to which the
    run prints, None if it prints nothing.
    """

    def __init__(self, number: int, screen: int | None) -> None:
        self._number, self._screen = number, screen
        self._before: list[Any] | None = None
        self._stops: Any = None
        self._is_closed = False

    def __enter__(self) -> Terminal:
        if threading.current_thread() is threading.main_thread():
            self._stops = signal.getsignal(signal.SIGTSTP)
            if self._stops is signal.SIG_DFL:  # otherwise another handler is already installed
                signal.signal(signal.SIGTSTP, self._suspend)
        return self

    def __exit__(self, *_: object) -> None:
        self._is_closed = True
        if self._stops is signal.SIG_DFL:
            signal.signal(signal.SIGTSTP, self._stops)
        self._give_back()

    def read(self) -> bytes:
        """Return what was typed since the last call, without waiting."""
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
        """Change the terminal's settings, unless they are already changed."""
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
        """Restore the terminal's settings and discard unread keys, which were not meant for the
        shell."""
        before, self._before = self._before, None
        with suppress(OSError, termios.error):  # the terminal may be closed
            if before is not None and self._is_ours():
                self._show(_PASTES_PLAIN)
                termios.tcflush(self._number, termios.TCIFLUSH)
                termios.tcsetattr(self._number, termios.TCSANOW, before)

    def _is_ours(self) -> bool:
        """Return whether the run is in the foreground, so that the keys are meant for it."""
        return os.tcgetpgrp(self._number) == os.getpgrp()

    def _show(self, codes: str) -> None:
        """Write control codes to the screen without the output buffer, which may be in use when a
        signal arrives."""
        if self._screen is not None:
            with suppress(OSError):  # the terminal may be closed
                os.write(self._screen, codes.encode())

    def _suspend(self, number: int, _: object) -> None:
        """Handle Ctrl-Z: give the terminal back to the shell, and stop until the shell resumes the
        run."""
        self._give_back()
        self._show(_CURSOR_SHOWN)
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)
        signal.signal(number, self._suspend)
        self._show(_CURSOR_HIDDEN)
