"""Estimate the offset between two unsynchronised clocks from one-way messages.

A reading is the local arrival time minus the remote time stamp: the true offset plus a transport
delay, which is never negative. The smallest reading is therefore an upper bound of the offset, and
close to it once one message was fast (the minimum filter of NTP, RFC 5905 sec. 10, one way). The
estimate is the minimum over the last ten seconds, in buckets of one second; it follows a drift of
100 ppm within 1 ms. Its error is the minimum delay (under 0.2 ms on a LAN), which no one-way method
can observe. Shorter buckets follow a clock that drifts more, such as that of a simulator.

A single wrong time stamp far ahead would be the minimum for ten seconds. A reading that is more
than `MAX_LEAD_NS` below the estimate, or that comes before there is an estimate, is therefore
accepted only once `AGREEING_READINGS` readings with different time stamps within a second lie
within `MAX_LEAD_NS` of it (the remote clock was set ahead, or the link was slow at first). Until
then, each message counts as sent when it arrived.

If the remote clock is set back, a whole bucket stays far above the minimum, and all earlier buckets
are discarded.
"""

from __future__ import annotations

from collections import deque

from kybflow.core.signals import NS, Time

BUCKET: Time = NS
BUCKETS = 10
CLOCK_STEP_NS: Time = NS // 4
"""If a whole bucket stays further than this above the minimum, the remote clock was set back,
ns."""
MAX_LEAD_NS: Time = NS // 20
"""A single reading is accepted only if it is at most this far below the estimate, ns."""
AGREEING_READINGS = 3
MOST_DOUBTED = 50


class Offset:
    """Estimates the offset to add to a remote time to get local time, in nanoseconds.

    bucket: the length of the buckets, ns.
    is_doubted: whether the newest reading was too far below the estimate to be accepted.
    """

    def __init__(self, bucket: Time = BUCKET) -> None:
        self.is_doubted = False
        self._length = bucket
        self._least: deque[Time] = deque(maxlen=BUCKETS)
        self._bucket: Time | None = None
        self._now: Time | None = None
        self._doubted: deque[tuple[Time, Time, Time]] = deque(maxlen=MOST_DOUBTED)

    def of(self, here: Time, there: Time) -> Time:
        """Add a reading and return the offset, ns. here: the local time of arrival. there: the
        remote time of sending. The offset never exceeds `here - there`, because no message arrives
        before it was sent."""
        reading, believed = here - there, self._now
        self.is_doubted = False
        if believed is None or reading < believed - MAX_LEAD_NS:
            agreed = self._agreed(here, there, reading)
            if agreed is None:
                self.is_doubted = believed is not None
                return reading
            reading = agreed
        self._now = self._taken(here // self._length, reading)
        return self._now

    def _agreed(self, here: Time, there: Time, reading: Time) -> Time | None:
        """Return the smallest of the doubted readings that agree with this one, or None if too few
        do."""
        doubted = self._doubted
        while doubted and here - doubted[0][0] > BUCKET:
            doubted.popleft()
        if not doubted or doubted[-1][1] != there:  # the bodies of one frame share a time stamp
            doubted.append((here, there, reading))
        near = {stamp: other for _, stamp, other in doubted if abs(other - reading) <= MAX_LEAD_NS}
        if len(near) < AGREEING_READINGS:
            return None
        doubted.clear()
        return min(near.values())

    def _taken(self, bucket: Time, reading: Time) -> Time:
        """Add an accepted reading and return the minimum over all buckets."""
        least = self._least
        if bucket == self._bucket:
            least[-1] = min(least[-1], reading)
            return min(least)
        silent = 0 if self._bucket is None else (bucket - self._bucket) * self._length
        if silent > BUCKETS * BUCKET:
            least.clear()
        elif least and least[-1] > min(least) + CLOCK_STEP_NS:
            last = least[-1]
            least.clear()
            least.append(last)
        self._bucket = bucket
        least.append(reading)
        return min(least)
