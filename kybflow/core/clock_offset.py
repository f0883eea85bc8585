"""The offset between two clocks that nobody synchronised, by the least delay.

Each reading is `here - there`, the true offset plus a delay that is never negative; so the offset
is at most the least reading, and close to it as soon as one was quick (the minimum filter of NTP,
RFC 5905 sec. 10, one way). The least of the last ten seconds counts, in buckets of one second: that
follows a drift of 100 ppm within 1 ms. What stays is the least delay itself (a LAN: under 0.2 ms),
which no one-way method can see.

One wrong stamp far ahead would be the least reading for ten seconds. So one that is `NEAR` below
the least, and the first ones, count once `AGREED` of different stamps within a second are `NEAR` to
one another: a clock that was set ahead, a link that was slow at first. Until then what was sent
counts as sent when it came.

A clock that was set back: a whole bucket without a reading near the least one tells, and everything
before it is forgotten.
"""

from __future__ import annotations

from collections import deque

from kybflow.core.signals import NS, Time

BUCKET: Time = NS
BUCKETS = 10
STEP: Time = NS // 4
"""How far above the least reading a whole bucket may stay."""
NEAR: Time = NS // 20
"""How far below the least a single reading is believed."""
AGREED = 3
MOST_DOUBTED = 50


class Offset:
    """What must be added to a time there to have it here. `is_doubted`: whether the newest reading
    does not fit the others."""

    def __init__(self) -> None:
        self.is_doubted = False
        self._least: deque[Time] = deque(maxlen=BUCKETS)
        self._bucket: Time | None = None
        self._now: Time | None = None
        self._doubted: deque[tuple[Time, Time, Time]] = deque(maxlen=MOST_DOUBTED)

    def of(self, here: Time, there: Time) -> Time:
        """Take a reading into account; the offset as it is known then. Never more than the
        reading: what was sent `there` never comes from the future."""
        reading, believed = here - there, self._now
        self.is_doubted = False
        if believed is None or reading < believed - NEAR:
            agreed = self._agreed(here, there, reading)
            if agreed is None:
                self.is_doubted = believed is not None
                return reading
            reading = agreed
        self._now = self._taken(here // BUCKET, reading)
        return self._now

    def _agreed(self, here: Time, there: Time, reading: Time) -> Time | None:
        """The least of those that agree with a doubtful reading, None while they are too few."""
        doubted = self._doubted
        while doubted and here - doubted[0][0] > BUCKET:
            doubted.popleft()
        if not doubted or doubted[-1][1] != there:  # of a frame with many bodies one says it all
            doubted.append((here, there, reading))
        near = {stamp: other for _, stamp, other in doubted if abs(other - reading) <= NEAR}
        if len(near) < AGREED:
            return None
        doubted.clear()
        return min(near.values())

    def _taken(self, bucket: Time, reading: Time) -> Time:
        """The offset with a reading that is believed."""
        least = self._least
        if bucket == self._bucket:
            least[-1] = min(least[-1], reading)
            return min(least)
        if self._bucket is not None and bucket > self._bucket + BUCKETS:
            least.clear()
        elif least and least[-1] > min(least) + STEP:
            last = least[-1]
            least.clear()
            least.append(last)
        self._bucket = bucket
        least.append(reading)
        return min(least)
