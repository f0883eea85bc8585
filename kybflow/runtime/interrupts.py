"""Ctrl-C, Ctrl-\\, SIGTERM and a closed terminal, as the engine hears them."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from types import FrameType
from typing import Any, Protocol

DEAF = 1.0
"""Seconds after an interrupt in which another is the same one: a closed terminal sends several."""


class Counting(Protocol):
    """What hears of interrupts: an engine, or a session of tests."""

    interrupts: int


class Interrupts:
    """While it is entered, each signal is counted for the engine, which lands every vehicle on the
    first and cuts the stream on the second. Those that mean nothing here end nothing: a flight is
    not to fall because something told the program what it does not know. Works in the main thread
    only, as signals do."""

    SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
    IGNORED = (signal.SIGUSR1, signal.SIGUSR2)

    def __init__(self, engine: Counting, read: Callable[[], float] = time.monotonic) -> None:
        self._engine = engine
        self._read = read
        self._last: float | None = None
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> None:
        for number in self.SIGNALS:
            self._before[number] = signal.signal(number, self._count)
        for number in self.IGNORED:
            self._before[number] = signal.signal(number, signal.SIG_IGN)

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _count(self, number: int, frame: FrameType | None) -> None:
        now = self._read()
        if self._last is None or now - self._last >= DEAF:
            self._last = now
            self._engine.interrupts += 1
