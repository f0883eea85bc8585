"""The clock of an autopilot and ours.

An autopilot stamps its messages with the time since it booted. `BootClock` converts that to the
run's time by the least delay (`kybflow.core.clock_offset`): messages are received at a tick, up to
a tick late, but of some hundred a second a few come just before one. An offset by TIMESYNC would be
half a tick wrong, some 2 ms, whatever is averaged: its answers wait for a tick on one of the two
ways. So `TimeSync` only measures the round trip, which no stamp shows, and answers the autopilot.

The answers hold the autopilot's own time, as `BootClock` knows it, not the run's. An autopilot that
has learned the offset adds it to the stamps that we send; another one uses them as they are. With
answers in its own time the offset is near zero, and stamps in its own time are right for both.
"""

from __future__ import annotations

from collections import deque

from kybflow.core.clock_offset import Offset
from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.protocol.dialect import mavlink
from kybflow.drivers.mavlink.protocol.framing import Message

MS: Time = NS // 1000
BACK: Time = NS
"""A stamp this far before the newest one is late, or from another boot."""
AGREED = 3
"""So many of them in a row are from another boot."""
LONGEST_UP = 10 * 365 * 86400 * NS
"""A later stamp counts from 1970 and not from the boot."""
INTERVAL: Time = NS // 5
"""Between two requests. A link that holds its messages back and then delivers them all at once ends
with a round trip no longer than this, however long it held them."""
MOST_AWAITED = 20
"""How many requests may be unanswered."""


class BootClock:
    """Converts an autopilot's stamps to the run's time. `reboots`: how often the autopilot has
    rebooted since its first message."""

    def __init__(self) -> None:
        self.reboots = 0
        self._offset = Offset()
        self._known: Time | None = None
        self._newest: tuple[Time, Time] | None = None
        self._back = 0

    def to_run(self, boot: Time, now: Time) -> Time:
        """The run's time of an event that was stamped with nanoseconds since the boot and arrived
        now. Never in the future, and never before an event with an earlier stamp."""
        if self._newest is not None and boot < self._newest[0] - BACK:
            self._back += 1
            if self._back < AGREED:
                return now
            self.reboots += 1
            self._offset, self._newest = Offset(), None
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
        """A time of the run as nanoseconds since the boot; None before the first message, and for a
        time before the boot."""
        if self._known is None or time < self._known:
            return None
        return time - self._known


def boot_time(message: Message) -> Time | None:
    """The nanoseconds since the boot in a message; None where it has no such field, leaves it
    empty, or has the time of day there. `time_boot_ms` is whole milliseconds."""
    stamp: int = getattr(message, "time_boot_ms", 0) * MS
    stamp = stamp or getattr(message, "time_usec", 0) * 1000
    return stamp if 0 < stamp < LONGEST_UP else None


class TimeSync:
    """TIMESYNC in both directions. Pure: it returns what must be sent. `round_trip`: the shorter
    one of the newest two, seconds, the wait for our tick included; zero before the second."""

    def __init__(self, clock: BootClock) -> None:
        self.round_trip = 0.0
        self._clock = clock
        self._asked: deque[Time] = deque(maxlen=MOST_AWAITED)
        self._next: Time = 0
        self._newest: Time = 0

    def due(self, now: Time) -> list[Message]:
        """The request to send now."""
        if now < self._next:
            return []
        self._next = now + INTERVAL
        self._asked.append(now)
        return [_message(0, now)]

    def handle(self, message: Message, now: Time) -> list[Message]:
        """The answer to a request of the autopilot; nothing while its clock is unknown."""
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
