"""What an autopilot is told of where it is: kybflow's estimate, as external vision.

An autopilot that must know where on earth it is before it flies is told a place once, which nothing
depends on. The reset counter rises where the estimate has another source or jumps, so that the
autopilot follows at once in place of taking it for speed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.geometry import add, distance, scale
from kybflow.core.signals import NS, Estimate, Time
from kybflow.drivers.mavlink.protocol import codec

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.protocol.framing import Message

OLDEST = 0.1
"""Seconds; an estimate that is older is not told."""
JUMP = 0.3
"""Metres that an estimate is off from where the one before was heading."""
REQUEST_MESSAGE = 512
AGAIN = 2.0
"""Seconds until the place on earth is told again."""
LATITUDE, LONGITUDE, HEIGHT = 473_977_418, 85_455_939, 488_000
"""Where on earth a vehicle without GPS is told to be: 1e-7 degrees and millimetres."""


class Vision:
    """To one autopilot. rate: poses a second. `told`: what it was told last, and when."""

    def __init__(self, rate: float, target: tuple[int, int]) -> None:
        self.told: tuple[Estimate, Time] | None = None
        self._period: Time = round(NS / rate)
        self._target = target
        self._due: Time = 0
        self._origin_due: Time = 0
        self._resets = 0
        self._last: Estimate | None = None

    def of(self, estimate: Estimate, stamp_us: int, is_lost: bool, now: Time) -> list[Message]:
        """What is to be sent of an estimate, once a tick. stamp_us: its time on the vehicle's
        clock. is_lost: whether the autopilot must be told a place on earth."""
        if now < self._due or estimate.age > OLDEST:
            return []
        last, self._last = self._last, estimate
        if last is not None and _jumped(last, estimate):
            self._resets += 1
        self._due += self._period
        if self._due <= now:
            self._due = now + self._period
        self.told = estimate, now
        said = self._origin(now) if is_lost else []
        return [*said, codec.vision(estimate, stamp_us=stamp_us, resets=self._resets)]

    def _origin(self, now: Time) -> list[Message]:
        if now < self._origin_due:
            return []
        self._origin_due = now + round(AGAIN * NS)
        place = (LATITUDE, LONGITUDE, HEIGHT)
        number = mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
        return [
            mavlink.MAVLink_set_gps_global_origin_message(self._target[0], *place),
            mavlink.MAVLink_command_long_message(
                *self._target, REQUEST_MESSAGE, 0, number, 0, 0, 0, 0, 0, 0
            ),
        ]


def _jumped(last: Estimate, estimate: Estimate) -> bool:
    if estimate.source != last.source:
        return True
    foreseen = add(last.position, scale(last.velocity, (estimate.time - last.time) / NS))
    return distance(foreseen, estimate.position) > JUMP
