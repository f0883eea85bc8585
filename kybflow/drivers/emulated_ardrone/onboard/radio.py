"""The radio link of an emulated drone, with delay, jitter and loss but without reordering."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Iterable
from typing import Generic, NamedTuple, TypeVar

from kybflow.core.signals import NS, Time

T = TypeVar("T")


class Radio(NamedTuple):
    """The properties of a radio link. latency: delay of a datagram, s. jitter: largest deviation
    from this delay, s, uniformly distributed. loss: share of datagrams that are lost."""

    latency: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0


class DelayLine(Generic[T]):
    """One direction of a radio link. more: additional delay, ns, set by a fault."""

    more: Time = 0

    def __init__(self, radio: Radio, generator: random.Random) -> None:
        self._radio, self._generator = radio, generator
        self._on_the_way: deque[tuple[Time, T]] = deque()
        self._last: Time = 0

    def send(self, message: T, now: Time) -> None:
        latency, jitter, loss = self._radio
        if loss > 0.0 and self._generator.random() < loss:
            return
        late = latency + jitter * (2.0 * self._generator.random() - 1.0)
        self._last = max(self._last, now + self.more + round(max(0.0, late) * NS))
        self._on_the_way.append((self._last, message))

    def send_all(self, messages: Iterable[T], now: Time) -> None:
        for message in messages:
            self.send(message, now)

    def arrived(self, now: Time) -> list[T]:
        """Return the messages that have arrived since the last call."""
        found = []
        while self._on_the_way and self._on_the_way[0][0] <= now:
            found.append(self._on_the_way.popleft()[1])
        return found
