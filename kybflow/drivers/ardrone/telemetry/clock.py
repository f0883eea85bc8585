"""The clock of a drone and ours.

Each packet of `full` navigation data has the drone's time. It is brought to the run's by the least
delay (`kybflow.core.clock_offset`): Wi-Fi delivers some packets 40 ms later than others, and a
gyroscope's rates that are integrated at such times turn an estimate that nothing has turned.
"""

from __future__ import annotations

from kybflow.core.clock_offset import Offset
from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.protocol.navdata.options import WRAPS

MOST_STEP = 0.5
"""Seconds between two packets over which a motion is summed up."""


class DroneClock:
    """Brings a drone's stamps to the run's time. `dt`: seconds from the packet before to the newest
    one, zero where there was none for too long."""

    def __init__(self) -> None:
        self.dt = 0.0
        self._offset = Offset()
        self._read: float | None = None
        self._run: Time = 0
        self._heard: Time | None = None
        self._stamped: Time = 0

    def stamp(self, read: float | None, now: Time) -> Time:
        """When a packet was sent that arrived now: never in the future, and never before the one
        before. read: the drone's time, seconds, which wraps; None where the packet has none, which
        counts as sent now."""
        heard, self._heard = self._heard, now
        if read is None:
            passed = 0.0 if heard is None else (now - heard) / NS
            sent = now
        else:
            passed = 0.0 if self._read is None else (read - self._read) % WRAPS
            self._read = read
            self._run += round(passed * NS)
            sent = min(now, self._run + self._offset.of(now, self._run))
        self.dt = passed if passed <= MOST_STEP else 0.0
        self._stamped = max(self._stamped, sent)
        return self._stamped
