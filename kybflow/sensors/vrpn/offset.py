"""The offset between two clocks that nobody synchronised, by the least delay.

Each reading is `here - there`, the true offset plus a delay that is never negative; so the offset
is at most the least reading, and close to it as soon as one was quick (the minimum filter of NTP,
RFC 5905 sec. 10, one way). The least of the last ten seconds counts, in buckets of one second: that
follows a drift of 100 ppm within 1 ms. What stays is the least delay itself (a LAN: under 0.2 ms),
which no one-way method can see.

A clock that was set: ahead, the next reading tells; back, a whole bucket without a reading near the
least one does, and everything before it is forgotten.
"""

from __future__ import annotations

from collections import deque

from kybflow.signals import NS, Time

BUCKET: Time = NS
BUCKETS = 10
STEP: Time = NS // 4
"""How far above the least reading a whole bucket may stay."""


class Offset:
    """What must be added to a time there to have it here."""

    def __init__(self) -> None:
        self._least: deque[Time] = deque(maxlen=BUCKETS)
        self._bucket: Time | None = None
        self._now: Time = 0

    def of(self, here: Time, there: Time) -> Time:
        """Take a reading into account; the offset as it is known then. Never more than the
        reading: what was sent `there` never comes from the future."""
        reading, bucket = here - there, here // BUCKET
        if bucket != self._bucket:
            self._close(bucket, reading)
        elif reading < self._least[-1]:
            self._least[-1] = reading
            self._now = min(self._now, reading)
        return self._now

    def _close(self, bucket: Time, reading: Time) -> None:
        """Begin a bucket, with its first reading."""
        least = self._least
        if self._bucket is not None and bucket > self._bucket + BUCKETS:
            least.clear()
        elif least and least[-1] > min(least) + STEP:
            last = least[-1]
            least.clear()
            least.append(last)
        self._bucket = bucket
        least.append(reading)
        self._now = min(least)
