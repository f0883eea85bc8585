"""How late a drone does what it is told, by the bit with which it acknowledges its configuration.

No AT command is answered, but CONFIG sets the bit, CTRL 5 resets it, and both go the way of all
commands: the bit is asked to change, and the time until it is seen changed is a round trip. What is
written is `gps:altitude`, which tags pictures and which a controlling device tells in flight (SDK
2.0, developer guide).
"""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.protocol.at import (
    RESET_ACKNOWLEDGE,
    Ids,
    Line,
    config,
    config_ids,
    ctrl,
)

INTERVAL: Time = NS // 5
"""How often the bit is asked to change."""
RESENDS: Time = 3 * NS // 100
"""How often that is sent again until it has: one datagram that is lost makes no long round trip."""
PATIENCE: Time = 2 * NS
"""For how long, and how long the first is waited for: a firmware may not know the value."""
TAG, UNSET = "gps:altitude", "0"


class RoundTrips:
    """The round trips of one drone. `delay`: the shorter one of the newest two, seconds, the wait
    for our tick included; zero before the second. One that is under way counts, too, as long as it
    has taken so far. A drone that was cut off for a while and then answers at once is not late.
    post: sends lines once."""

    def __init__(self, ids: Ids, post: Callable[..., None]) -> None:
        self._write = (config_ids(ids), config(TAG, UNSET))
        self._post = post
        self.begin_anew()

    def waits(self, now: Time) -> bool:
        """Whether the first two may still come."""
        return not self.delay and (self._asked is None or now - self._asked < PATIENCE)

    def begin_anew(self) -> None:
        """Forget the round trips: the drone is configured."""
        self.delay = 0.0
        self._before = self._newest = self._next = 0
        self._asked: Time | None = None
        self._sent: Time = 0
        self._asks_for = False

    def update(self, acknowledges: bool, now: Time) -> None:
        """Go on; called once a tick. acknowledges: whether the bit is set."""
        if self._asked is None:
            if now >= self._next:
                self._asked, self._next, self._asks_for = now, now + INTERVAL, not acknowledges
                self._send(now)
            return
        taken = now - self._asked
        if acknowledges is self._asks_for:
            self._before, self._newest, self._asked = self._newest, taken, None
            self.delay = min(self._before, self._newest) / NS
            return
        self.delay = max(min(self._before, self._newest), min(self._newest, taken)) / NS
        if now - self._sent >= RESENDS and taken < PATIENCE:
            self._send(now)

    def _send(self, now: Time) -> None:
        self._sent = now
        lines: tuple[Line, ...] = self._write if self._asks_for else (ctrl(RESET_ACKNOWLEDGE),)
        self._post(*lines)
