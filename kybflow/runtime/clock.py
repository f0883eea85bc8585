"""Clocks: simulated and wall time. Only they may sleep in the runtime.

Time is integer nanoseconds since the run began. A tick falls on every multiple of the period.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable

from kybflow.core.signals import NS, Time


class Clock(ABC):
    """Steps time by one period per tick. `late` counts the ticks that missed their deadline."""

    def __init__(self, rate: int) -> None:
        self.now: Time = 0
        self.period: Time = NS // rate
        self.late = 0

    @abstractmethod
    def step(self) -> Time:
        """Advance to the next tick, sleeping until it is due in real time; return `now`."""


class SimulatedClock(Clock):
    """Simulated time: as fast as possible, or paced by `speed`, where 1 is real time."""

    def __init__(
        self,
        rate: int,
        speed: float | None = None,
        read: Callable[[], float] = time.monotonic,
        wait: Callable[[float], None] = time.sleep,
    ) -> None:
        super().__init__(rate)
        self._speed = speed
        self._read, self._wait = read, wait
        self._began = read()

    def step(self) -> Time:
        self.now += self.period
        if self._speed is not None:
            ahead = self.now / NS / self._speed - (self._read() - self._began)
            if ahead > 0:
                self._wait(ahead)
        return self.now


class WallClock(Clock):
    """Real time. A late tick is counted, and the ones it missed are skipped, never caught up.

    The time is read again after waiting: a process that was stopped while it slept dates what
    arrived meanwhile in this tick, and not back to when the tick was due.
    """

    def __init__(
        self,
        rate: int,
        read: Callable[[], int] = time.monotonic_ns,
        wait: Callable[[float], None] = time.sleep,
    ) -> None:
        super().__init__(rate)
        self._read, self._wait = read, wait
        self._began = read()

    def step(self) -> Time:
        self.now += self.period
        behind = self._behind()
        is_late = behind > 0
        if not is_late:
            self._wait(-behind / NS)
            behind = self._behind()
        missed = max(behind // self.period, 0)
        self.late += is_late or missed > 0
        self.now += missed * self.period
        return self.now

    def _behind(self) -> Time:
        """Return how long the tick has been due, negative before it is."""
        return self._read() - self._began - self.now
