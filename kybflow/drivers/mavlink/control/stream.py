"""The stream of set-points, fed by the engine alone.

It sends the newest command at its own rate, and the same one again until that is 250 ms old. Then
it stops by itself, and the vehicle's own watchdog acts: a program that hangs flies nothing.
"""

from __future__ import annotations

from kybflow.core.signals import NS, Command, Time

OLDEST: Time = NS // 4
"""Nanoseconds for which a command counts."""


class Stream:
    """rate: set-points a second."""

    def __init__(self, rate: float) -> None:
        self._period: Time = round(NS / rate)
        self._command: Command | None = None
        self._fed: Time = 0
        self._begun: Time | None = None
        self._due: Time = 0

    def feed(self, command: Command, now: Time) -> None:
        """The newest command; the first one begins the stream."""
        if self._begun is None:
            self._begun = self._due = now
        self._command, self._fed = command, now

    def stop(self) -> None:
        self._command = self._begun = None

    def due(self, now: Time) -> Command | None:
        """What is to be sent now, None while nothing is. A late one is not caught up by a burst."""
        command = self._command
        if command is None or now < self._due:
            return None
        if now - self._fed > OLDEST:
            self.stop()
            return None
        self._due += self._period
        if self._due <= now:
            self._due = now + self._period
        return command

    def flows(self, now: Time) -> float:
        """For how many seconds it has flowed without a gap; zero while it does not."""
        return 0.0 if self._begun is None else (now - self._begun) / NS
