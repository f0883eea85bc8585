"""External vision: the estimate sent to an autopilot, and the drift of the autopilot's frame.

An autopilot that needs a geographic position before it flies is sent an arbitrary one. The reset
counter is incremented when the estimate changes its source or jumps, so that the autopilot follows
at once and doesn't mistake the jump for motion.

An autopilot's filter does not follow the poses exactly, so its frame drifts by centimetres against
the world. Setpoints are shifted by that drift, which is learnt with the time constant
`DRIFT_TIME_S`: the vehicle then hovers at the position of the mission's estimate, while the fast
part of the motion, which the autopilot's filter knows better, is left to that filter."""

from __future__ import annotations

from kybflow.core.geometry import add, distance, norm, scale, sub
from kybflow.core.signals import NS, Estimate, Odometry, Time
from kybflow.drivers.mavlink.protocol import codec
from kybflow.drivers.mavlink.protocol.frames import Anchor
from kybflow.drivers.mavlink.protocol.framing import Message, mavlink

MAX_AGE_S = 0.1
"""An estimate older than this, seconds, is not sent."""
JUMP_DISTANCE = 0.3
"""An estimate farther than this from its predicted position, metres, counts as a jump."""
ORIGIN_PERIOD_S = 2.0
"""Seconds until the geographic position is sent again."""
LATITUDE, LONGITUDE, HEIGHT = 473_977_418, 85_455_939, 488_000
"""The geographic position sent to a vehicle without GPS: 1e-7 degrees, and millimetres."""


class ExternalVision:
    """The poses sent to one autopilot. rate: in Hz. `newest`: the last estimate sent, and the time
    of sending."""

    def __init__(self, rate: float, target: tuple[int, int]) -> None:
        self.newest: tuple[Estimate, Time] | None = None
        self._period: Time = round(NS / rate)
        self._target = target
        self._due: Time = 0
        self._origin_due: Time = 0
        self._resets = 0
        self._last: Estimate | None = None

    def is_due(self, now: Time) -> bool:
        """Return whether the next pose is due."""
        return now >= self._due

    def of(self, estimate: Estimate, stamp_us: int, is_lost: bool, now: Time) -> list[Message]:
        """Return the messages to send for an estimate; none if no pose is due or the estimate is
        too old. stamp_us: the time of the estimate on the vehicle's clock. is_lost: whether the
        autopilot must be sent a geographic position."""
        if not self.is_due(now) or estimate.age > MAX_AGE_S:
            return []
        last, self._last = self._last, estimate
        if last is not None:
            foreseen = add(last.position, scale(last.velocity, (estimate.time - last.time) / NS))
            has_jumped = distance(foreseen, estimate.position) > JUMP_DISTANCE
            self._resets += has_jumped or estimate.source != last.source
        self._due += self._period
        if self._due <= now:
            self._due = now + self._period
        self.newest = estimate, now
        pose = codec.vision(estimate, stamp_us=stamp_us, resets=self._resets)
        if not is_lost or now < self._origin_due:
            return [pose]
        self._origin_due = now + round(ORIGIN_PERIOD_S * NS)
        place = (LATITUDE, LONGITUDE, HEIGHT)
        command, number = mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
        return [
            mavlink.MAVLink_set_gps_global_origin_message(self._target[0], *place),
            codec.command_long(self._target, command, number),
            pose,
        ]


DRIFT_TIME_S = 1.0
"""The time constant with which the drift is learnt, seconds."""
MAX_DRIFT = 0.5
"""A greater distance, metres, is not drift; the preflight or a supervisor reports it."""
OLDEST_OWN: Time = NS // 2
"""A position of the autopilot that is older is ignored. It also bounds how much is learnt after a
longer gap, so that setpoints don't jump."""


class FrameDrift:
    """The drift of one autopilot's frame. `anchor`: where that frame lies in the world."""

    def __init__(self) -> None:
        self.anchor = Anchor()
        self._learnt: Time | None = None
        self._own: Odometry | None = None

    def learn(self, estimate: Estimate, own: Odometry | None, now: Time) -> None:
        """Learn the drift from our estimate and the autopilot's; each of the autopilot's estimates
        counts once. Called once a tick."""
        if own is None or now - own.time > OLDEST_OWN:
            self._learnt = None
            return
        if own is self._own:
            return
        self._own = own
        last, self._learnt = self._learnt, now
        ahead = scale(own.velocity, (estimate.time - own.time) / NS)
        off = sub(estimate.position, add(own.position, ahead))
        if last is None or norm(off) > MAX_DRIFT:
            return
        share = min(now - last, OLDEST_OWN) / NS / DRIFT_TIME_S
        offset = add(self.anchor.offset, scale(sub(off, self.anchor.offset), share))
        self.anchor = Anchor(offset)
