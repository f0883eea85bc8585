"""Ctrl-C, SIGTERM and a closed terminal, as the engine hears them."""

from __future__ import annotations

import signal
from types import FrameType
from typing import Any

from kybflow.runtime.engine import Engine


class Interrupts:
    """While it is entered, each signal is counted for the engine, which lands every vehicle on the
    first and cuts the stream on the second. Works in the main thread only, as signals do."""

    SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> None:
        for number in self.SIGNALS:
            self._before[number] = signal.signal(number, self._count)

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _count(self, number: int, frame: FrameType | None) -> None:
        self._engine.interrupts += 1
