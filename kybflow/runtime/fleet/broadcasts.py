"""The messages that vehicles publish to each other: their estimate, their setpoint and a message of
their behavior.

Every vehicle publishes at the end of a tick, so that no vehicle receives a message in the tick in
which it was published, regardless of the order in which the vehicles act. The receiver chooses how
old a message must be, which simulates the delay of a radio.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable
from typing import Any

from kybflow.core.signals import NS, Answer, NeighbourState, Time

_HISTORY_NS = NS // 2


class Broadcasts:
    """Each vehicle's messages of the last half second, and its newest message before that."""

    def __init__(self) -> None:
        self._kept: dict[str, deque[NeighbourState]] = {}
        self._found: dict[tuple[str, Time], NeighbourState | None] = {}
        self._answers: dict[Hashable, Any] = {}

    def note(self, vehicle: str, news: NeighbourState) -> None:
        """Keep a message that a vehicle publishes."""
        kept = self._kept.setdefault(vehicle, deque())
        kept.append(news)
        while len(kept) > 1 and kept[1].time < news.time - _HISTORY_NS:
            kept.popleft()
        if self._found:
            self._found.clear()
            self._answers.clear()

    def heard(self, vehicle: str, by: Time) -> NeighbourState | None:
        """Return the newest message that `vehicle` published at `by` or before, or None."""
        key = (vehicle, by)
        if key not in self._found:
            kept = reversed(self._kept.get(vehicle, ()))
            self._found[key] = next((news for news in kept if news.time <= by), None)
        return self._found[key]

    def once(self, question: Hashable, answer: Callable[[], Answer]) -> Answer:
        """Return the cached answer to a question, or compute it by `answer`. The cache is cleared
        when a new message arrives."""
        if question not in self._answers:
            self._answers[question] = answer()
        found: Answer = self._answers[question]
        return found
