"""Clocks: who says what time it is. The only place in the runtime that may wait.

Time is integer nanoseconds since the run began. A tick takes place at every multiple of the period.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable

from kybflow.core.signals import NS, Time


class Clock(ABC):
    """Time in steps of one period. `late` counts the ticks that came too late."""

    def __init__(self, rate: int) -> None:
        self.now: Time = 0
        self.period: Time = NS // rate
        self.late = 0

    @abstractmethod
    def step(self) -> Time:
        """Go to the next tick, waiting for it where the clock is bound to the wall; returns
        `now`."""


class SimulatedClock(Clock):
    """As fast as the machine allows, or paced: `speed` 1 is real time, 2 twice as fast."""

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
    """Real time. A tick that comes late is counted and never caught up by a burst: the ticks that
    it missed are left out."""

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
        passed = self._read() - self._began
        if passed > self.now:
            missed = (passed - self.now) // self.period
            self.late += 1
            self.now += missed * self.period
        else:
            self._wait((self.now - passed) / NS)
        return self.now
