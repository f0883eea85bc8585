"""Counts interrupts for the engine: Ctrl-C, Ctrl-\\, SIGTERM and a closed terminal."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from types import FrameType
from typing import Any, Protocol

DEBOUNCE = 1.0
"""Seconds in which further signals belong to one interrupt: a closed terminal sends several."""


class Counting(Protocol):
    """An object that counts interrupts: the engine, a run, or a session of tests."""

    interrupts: int


class Interrupts:
    """A context manager that counts signals for the engine. The engine lands every vehicle on the
    first and stops sending commands on the second; the third raises KeyboardInterrupt, which ends
    whatever hangs. The signals in `IGNORED`, which would end the process by default, have no
    effect. It works only in the main thread, as signal handlers do."""

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
        if self._last is None or now - self._last >= DEBOUNCE:
            self._last = now
            self._engine.interrupts += 1
            if self._engine.interrupts > 2:
                raise KeyboardInterrupt
