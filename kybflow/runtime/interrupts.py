"""Counts interrupts for the engine: Ctrl-C, Ctrl-\\, SIGTERM and a closed terminal."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from types import FrameType
from typing import Any, Protocol

DEBOUNCE_S = 1.0
"""Seconds within which further signals count as the same interrupt: a closed terminal sends
several."""


SENT_BY: dict[int, str] = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGTERM: "SIGTERM of another program",
    signal.SIGHUP: "its terminal, which was closed",
    signal.SIGQUIT: "Ctrl-\\",
}
"""What sends each signal, in words."""


class Counting(Protocol):
    """An object that counts interrupts: the engine, a run, or a session of tests. interrupted_by:
    what sent the last one, in words."""

    interrupts: int
    interrupted_by: str


class Interrupts:
    """A context manager that counts interrupts for the engine, which lands every vehicle on the
    first and stops sending commands on the second. The third raises KeyboardInterrupt, which ends
    a run that hangs. The signals in `IGNORED`, which would end the process by default, have no
    effect. Like every signal handler, it works only in the main thread."""

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
        if self._last is None or now - self._last >= DEBOUNCE_S:
            self._last = now
            self._engine.interrupts += 1
            self._engine.interrupted_by = SENT_BY[number]
            if self._engine.interrupts > 2:
                raise KeyboardInterrupt
