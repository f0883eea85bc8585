"""The simulated clock and the wall clock. Only clocks may sleep in the runtime.

Time is an integer number of nanoseconds since the run began. Ticks fall on multiples of the period.
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
    """Simulated time. It runs as fast as possible, or at `speed`, where 1 is real time."""

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
    """Real time. Late ticks are counted; ticks that were missed are skipped and never made up for.

    The time is read again after waiting. If the process was stopped while it slept, the
    measurements that arrived in that time are stamped with the actual time, not with the time at
    which the tick was due.
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
        """Return how long the next tick has been due (ns), negative before it is due."""
        return self._read() - self._began - self.now
