"""Measures the delay of a drone with the bit that acknowledges its configuration.

The drone answers no AT command, but CONFIG sets this bit and CTRL 5 resets it, and both are sent
like any other command. A round trip lasts from the request to change the bit until navigation data
shows the change. The value written is `gps:altitude`, which is only a tag of pictures and which
controllers may set in flight (SDK 2.0, developer guide).
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
"""Period in which a change is requested."""
RESEND_PERIOD: Time = 3 * NS // 100
"""Period in which the request is resent, so that a lost datagram doesn't cause a long round
trip."""
TIMEOUT: Time = 2 * NS
"""Time after which to stop resending, and to stop waiting for the first change, since a firmware
may not know the value."""
TAG, UNSET = "gps:altitude", "0"


class RoundTrips:
    """The round trips of one drone. delay: the shorter of the newest two round trips, seconds,
    including the wait for our tick; zero before the second. A pending round trip counts with its
    duration so far. post: sends lines once."""

    def __init__(self, ids: Ids, post: Callable[..., None]) -> None:
        self._write = (config_ids(ids), config(TAG, UNSET))
        self._post = post
        self.restart()

    def waits(self, now: Time) -> bool:
        """Return whether the delay is unknown but may still be measured: no pending request has
        timed out."""
        return not self.delay and (self._asked is None or now - self._asked < TIMEOUT)

    def restart(self) -> None:
        """Discard all round trips, because the drone is being configured."""
        self.delay = 0.0
        self._before = self._newest = self._next = 0
        self._asked: Time | None = None
        self._sent: Time = 0
        self._asks_for = False

    def update(self, acknowledges: bool, now: Time) -> None:
        """Continue measuring; called once a tick. acknowledges: whether the acknowledge bit is
        set."""
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
        if now - self._sent >= RESEND_PERIOD and taken < TIMEOUT:
            self._send(now)

    def _send(self, now: Time) -> None:
        self._sent = now
        lines: tuple[Line, ...] = self._write if self._asks_for else (ctrl(RESET_ACKNOWLEDGE),)
        self._post(*lines)
