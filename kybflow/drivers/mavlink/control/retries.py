"""Asking an autopilot for the same thing until it is seen to be so.

An acknowledgement is not the deed, and an autopilot that refuses now may not refuse in a second. So
a command is asked again, with pauses that double, until whoever asks has seen what it wanted.
"""

from __future__ import annotations

from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.control.requests import PATIENCE, Request, Requests

SHOWN = 1.5
"""Seconds in which what was accepted must have shown: heartbeats come once a second."""


class Insisting:
    """One command. first, most: the shortest and the longest pause between two times, seconds.
    shown: the shortest one after it was accepted. `refusal`: what the autopilot said to it last, in
    words; empty while it has said nothing against it."""

    def __init__(
        self, requests: Requests, command: int, params: tuple[float, ...], first: float = 0.5,
        most: float = 4.0, shown: float = SHOWN,
    ) -> None:  # fmt: skip
        self.refusal = ""
        self._requests, self._command, self._params = requests, command, params
        self._pause, self._most, self._shown = first, most, shown
        self._request: Request | None = None
        self._due: Time | None = None

    def step(self, now: Time) -> None:
        """Ask where it is time to; called once a tick until it is so."""
        request = self._request
        if request is not None and request.outcome != "waiting":
            self._answered(request, now)
        if self._request is None and (self._due is None or now >= self._due):
            self._request = self._requests.ask(
                self._command,
                *self._params,
                now=now,
                patience=min(self._pause, PATIENCE),
                attempts=2,
            )

    def drop(self) -> None:
        """Ask no more: what has not been answered is not sent again."""
        if self._request is not None and self._request.outcome == "waiting":
            self._request.end("silent", "nobody wants it any more")

    def _answered(self, request: Request, now: Time) -> None:
        self._request = None
        accepted = request.outcome == "accepted"
        self.refusal = "" if accepted else request.words
        pause = max(self._pause, self._shown) if accepted else self._pause
        self._due = now + round(pause * NS)
        self._pause = min(2.0 * self._pause, self._most)
