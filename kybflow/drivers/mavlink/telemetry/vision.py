"""External vision: the estimate that is sent to an autopilot, and how far its frame drifts.

An autopilot that needs a place on earth before it flies is sent an arbitrary one. The reset counter
rises when the estimate changes its source or jumps, so that the autopilot follows at once and does
not take the jump for speed.

An autopilot's filter trusts the poses only so far, so its frame wanders by centimetres against the
world. Setpoints are shifted by that drift, which is learnt with the time constant `SLOW`: the
vehicle then hovers where the mission's estimate has it, and the fast part of the motion, which the
filter knows better, stays its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kybflow.core.geometry import add, distance, norm, scale, sub
from kybflow.core.signals import NS, Estimate, Odometry, Time
from kybflow.drivers.mavlink.protocol import codec
from kybflow.drivers.mavlink.protocol.dialect import mavlink
from kybflow.drivers.mavlink.protocol.frames import Anchor

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.protocol.framing import Message

OLDEST = 0.1
"""An estimate that is older, seconds, is not sent."""
JUMP = 0.3
"""The distance from the predicted position, metres, from which on an estimate has jumped."""
AGAIN = 2.0
"""Seconds until the place on earth is sent again."""
LATITUDE, LONGITUDE, HEIGHT = 473_977_418, 85_455_939, 488_000
"""The place on earth that a vehicle without GPS is sent: 1e-7 degrees and millimetres."""


class ExternalVision:
    """The poses for one autopilot. rate: poses a second. `newest`: the last estimate that was sent,
    and when."""

    def __init__(self, rate: float, target: tuple[int, int]) -> None:
        self.newest: tuple[Estimate, Time] | None = None
        self._period: Time = round(NS / rate)
        self._target = target
        self._due: Time = 0
        self._origin_due: Time = 0
        self._resets = 0
        self._last: Estimate | None = None

    def is_due(self, now: Time) -> bool:
        """Whether a pose may be sent."""
        return now >= self._due

    def of(self, estimate: Estimate, stamp_us: int, is_lost: bool, now: Time) -> list[Message]:
        """The messages to send for an estimate where one is due. stamp_us: its time on the
        vehicle's clock. is_lost: whether the autopilot must be sent a place on earth."""
        if not self.is_due(now) or estimate.age > OLDEST:
            return []
        last, self._last = self._last, estimate
        if last is not None and _jumped(last, estimate):
            self._resets += 1
        self._due += self._period
        if self._due <= now:
            self._due = now + self._period
        self.newest = estimate, now
        origin = self._origin(now) if is_lost else []
        return [*origin, codec.vision(estimate, stamp_us=stamp_us, resets=self._resets)]

    def _origin(self, now: Time) -> list[Message]:
        if now < self._origin_due:
            return []
        self._origin_due = now + round(AGAIN * NS)
        place = (LATITUDE, LONGITUDE, HEIGHT)
        command, number = mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
        return [
            mavlink.MAVLink_set_gps_global_origin_message(self._target[0], *place),
            mavlink.MAVLink_command_long_message(
                *self._target, command, 0, number, 0, 0, 0, 0, 0, 0
            ),
        ]


def _jumped(last: Estimate, estimate: Estimate) -> bool:
    if estimate.source != last.source:
        return True
    foreseen = add(last.position, scale(last.velocity, (estimate.time - last.time) / NS))
    return distance(foreseen, estimate.position) > JUMP


SLOW = 1.0
"""Time constant of the drift, seconds."""
FAR = 0.5
"""A larger distance, metres, is no drift; the preflight or a supervisor reports it."""
OLDEST_OWN: Time = NS // 2
"""An older position of the autopilot is ignored; after a longer gap no more is learnt at once than
after this, so that setpoints do not jump."""


class FrameDrift:
    """The drift of one autopilot's frame. `anchor`: where the frame lies in the world."""

    def __init__(self) -> None:
        self.anchor = Anchor()
        self._learnt: Time | None = None
        self._own: Odometry | None = None

    def learn(self, estimate: Estimate, own: Odometry | None, now: Time) -> None:
        """Learn from our estimate and the autopilot's; each one of the latter counts once. Called
        once a tick."""
        if own is None or now - own.time > OLDEST_OWN:
            self._learnt = None
            return
        if own is self._own:
            return
        self._own = own
        last, self._learnt = self._learnt, now
        ahead = scale(own.velocity, (estimate.time - own.time) / NS)
        off = sub(estimate.position, add(own.position, ahead))
        if last is None or norm(off) > FAR:
            return
        share = min(now - last, OLDEST_OWN) / NS / SLOW
        offset = add(self.anchor.offset, scale(sub(off, self.anchor.offset), share))
        self.anchor = Anchor(offset)
