"""The simulated clock and the wall clock. Only clocks may sleep in the runtime.

Time is an integer number of nanoseconds since the run began. Ticks fall on multiples of the period.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable

from kybflow.core.signals import NS, Time


class Clock(ABC):
    """Steps time by one period per tick. `missed` counts the ticks that were left out because the
    computer was late."""

    def __init__(self, rate: int) -> None:
        self.now: Time = 0
        self.period: Time = NS // rate
        self.missed = 0

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
    """Real time. Ticks that were missed are counted, left out and never made up for.

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
        if behind <= 0:
            self._wait(-behind / NS)
            behind = self._behind()
        missed = max(behind // self.period, 0)
        self.missed += missed
        self.now += missed * self.period
        return self.now

    def _behind(self) -> Time:
        """Return how long the next tick has been due (ns), negative before it is due."""
        return self._read() - self._began - self.now


class TickCount:
    """Counts the ticks that a clock made and those that were due, second by second.

    made, due: the ticks of the last complete second, or of a longer time if the process hung; zero
    before the first.
    """

    def __init__(self, clock: Clock) -> None:
        self.made = self.due = 0
        self._clock, self._since, self._missed = clock, clock.now, clock.missed

    def update(self) -> bool:
        """Return whether another second is complete."""
        clock = self._clock
        if clock.now - self._since < NS:
            return False
        self.due = (clock.now - self._since) // clock.period
        self.made = self.due - (clock.missed - self._missed)
        self._since, self._missed = clock.now, clock.missed
        return True

    @property
    def share(self) -> float:
        """The share of the due ticks that were made, 0 to 1; 1 before the first second."""
        return self.made / self.due if self.due else 1.0

    def __str__(self) -> str:
        seconds = self.due * self._clock.period / NS
        return f"the computer made {self.made} of {self.due} ticks in {seconds:.1f} s"
