"""The offset between an autopilot's clock and ours.

An autopilot stamps its messages with the time since its boot. `BootClock` converts these stamps to
the run's time, using the least delay observed (`kybflow.core.clock_offset`). Messages are received
at a tick, up to one tick late, but of some hundred a second a few arrive just before a tick. An
offset from TIMESYNC would be wrong by half a tick, some 2 ms, however long it is averaged, because
its replies wait for a tick in only one direction. `TimeSync` therefore only measures the round
trip, which no stamp shows, and answers the autopilot's requests.

The answers contain the autopilot's own time, as `BootClock` knows it, instead of the run's time.
Some autopilots add the offset that they learn to the stamps that we send, others use our stamps
unchanged. With answers in the autopilot's own time the offset is near zero, so stamps in that time
are right for both.
"""

from __future__ import annotations

from collections import deque

from kybflow.core.clock_offset import BUCKET, Offset
from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.protocol.framing import Message, mavlink

MS: Time = NS // 1000
STAMP_TOLERANCE_NS: Time = NS
"""A stamp earlier than the newest one by more than this is late, or from another boot."""
REBOOT_STAMPS = 3
"""After this many such stamps in a row the autopilot counts as rebooted."""
LONGEST_UP = 10 * 365 * 86400 * NS
"""A larger stamp counts from 1970 instead of from the boot."""
SIMULATOR_BUCKET: Time = NS // 50
"""The bucket for a firmware's own simulator, ns. PX4's clock was slow by 0.5 % there, and stood
still for 0.1 s after arming and when the machine was busy. With buckets of a second, the IMU was
stamped 0.05 to 0.15 s before the poses, which have no stamps, and the frame of motion capture
seemed wrong."""
PERIOD_NS: Time = NS // 5
"""The interval between two requests. After a link has held messages back and delivered them all at
once, the last round trip is no longer than this, however long the delay was."""
MOST_AWAITED = 20
"""The largest number of unanswered requests."""


class BootClock:
    """Converts an autopilot's stamps to the run's time. `reboots`: the number of reboots since the
    autopilot's first message. bucket: that of the offset; `SIMULATOR_BUCKET` for a simulator."""

    def __init__(self, bucket: Time = BUCKET) -> None:
        self.reboots = 0
        self._bucket = bucket
        self._offset = Offset(bucket)
        self._known: Time | None = None
        self._newest: tuple[Time, Time] | None = None
        self._back = 0

    def to_run(self, boot: Time, now: Time) -> Time:
        """Convert a stamp, nanoseconds since the boot, of a message that arrived now to the run's
        time. The result is never in the future, and never before that of an earlier stamp."""
        if self._newest is not None and boot < self._newest[0] - STAMP_TOLERANCE_NS:
            self._back += 1
            if self._back < REBOOT_STAMPS:
                return now
            self.reboots += 1
            self._offset, self._newest = Offset(self._bucket), None
        self._back = 0
        offset = self._offset.of(now, boot)
        if self._offset.is_doubted:
            return now
        self._known = offset
        stamp = min(boot + offset, now)
        if self._newest is None or boot > self._newest[0]:
            stamp = max(stamp, self._newest[1]) if self._newest is not None else stamp
            self._newest = boot, stamp
            return stamp
        return self._newest[1] if boot == self._newest[0] else min(stamp, self._newest[1])

    def to_boot(self, time: Time) -> Time | None:
        """Convert a time of the run to nanoseconds since the boot. Return None before the first
        message, and for a time before the boot."""
        if self._known is None or time < self._known:
            return None
        return time - self._known


def boot_time(message: Message) -> Time | None:
    """Return the stamp of a message, nanoseconds since the boot. Return None if the message has no
    such field, leaves it empty, or stamps with the time of day. `time_boot_ms` has a resolution of
    a millisecond."""
    stamp: int = getattr(message, "time_boot_ms", 0) * MS
    stamp = stamp or getattr(message, "time_usec", 0) * 1000
    return stamp if 0 < stamp < LONGEST_UP else None


class TimeSync:
    """Exchanges TIMESYNC messages in both directions. Its methods return the messages to send.
    `round_trip`: the shorter of the newest two round trips, seconds, including the wait for
    kybflow's tick; zero until two have been measured."""

    def __init__(self, clock: BootClock) -> None:
        self.round_trip = 0.0
        self._clock = clock
        self._asked: deque[Time] = deque(maxlen=MOST_AWAITED)
        self._next: Time = 0
        self._newest: Time = 0

    def due(self, now: Time) -> list[Message]:
        """Return the request to send now, if one is due."""
        if now < self._next:
            return []
        self._next = now + PERIOD_NS
        self._asked.append(now)
        return [_message(0, now)]

    def handle(self, message: Message, now: Time) -> list[Message]:
        """Return the answer to a request of the autopilot; nothing while its clock is unknown. From
        an answer to our own request, learn the round trip."""
        if message.get_type() != "TIMESYNC":
            return []
        if message.tc1 == 0:
            own = self._clock.to_boot(now)
            return [_message(own, message.ts1)] if own else []
        if message.ts1 in self._asked:
            self._asked.remove(message.ts1)
            before, self._newest = self._newest, now - message.ts1
            self.round_trip = min(before, self._newest) / NS
        return []


def _message(tc1: int, ts1: int) -> Message:
    return mavlink.MAVLink_timesync_message(tc1, ts1)
