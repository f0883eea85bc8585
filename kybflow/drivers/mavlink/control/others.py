"""Detection of other programs that command the autopilot. A person who takes control is handled in
`override`.

Autopilots take setpoints, commands and parameters from every system whose signature they accept,
and forward only other systems' heartbeats to us. This module therefore watches what the autopilot
does:

- the target that it reports (POSITION_TARGET_LOCAL_NED) while it follows setpoints in the air. The
  first field used, of position, velocity and acceleration, must be near that of a setpoint of ours
  that no newer one had replaced a second ago. If two programs send setpoints, both firmwares
  alternate between them, and report which they follow. A position of zero before our first
  setpoint in the air is ignored: Copter reports it after its own take-off, and for longer if this
  process hangs then. So is a target at rest: Copter rests
  once setpoints stop. So is an acceleration of 100 m/s^2 downwards: PX4 replaces every target with
  it while it detects ground contact;
- acknowledgements of commands from others (PX4 broadcasts them);
- safety parameters, which are read again in flight: none of them changes by itself;
- commands on a shared wire, and messages with our own system id, of which the autopilot could take
  the heartbeats for ours when we no longer send any.

Each finding is reported at most once in ten seconds.
"""

from __future__ import annotations

from collections import deque
from math import isfinite
from types import MappingProxyType
from typing import NamedTuple

from kybflow.core.geometry import ZERO, Vec3, distance, norm
from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.control.requests import name_of
from kybflow.drivers.mavlink.protocol.codec import NO_ACCELERATION, NO_POSITION, NO_VELOCITY
from kybflow.drivers.mavlink.protocol.framing import Message, mavlink

STREAMS = MappingProxyType({"POSITION_TARGET_LOCAL_NED": 4.0})
"""The streams that are read, Hz."""
STEERING = (
    "COMMAND_LONG", "COMMAND_INT", "SET_MODE", "PARAM_SET", "MANUAL_CONTROL",
    "RC_CHANNELS_OVERRIDE", "SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT",
    "SET_ATTITUDE_TARGET",
)  # fmt: skip
"""Messages that command a vehicle."""
FIRST_REQUEST_COMMAND = 500
"""From this MAV_CMD on, commands request data or set up a device; lower ones make a vehicle act."""
SETPOINT_VALIDITY_NS: Time = NS
"""How long the autopilot may follow a setpoint after we sent the next one."""
MOST_SENT = 256
TARGET_TOLERANCES = (0.3, 0.3, 1.0)
"""The largest distance between the target and our setpoint: metres, m/s, m/s^2."""
REST_TOLERANCE = 0.05
"""A velocity or an acceleration up to this counts as rest, m/s or m/s^2."""
NO_THRUST: Vec3 = (0.0, 0.0, 100.0)
"""The acceleration (NED, m/s^2) with which PX4's position controller commands zero thrust."""
FOREIGN_TARGETS, FOREIGN_WINDOW_NS = 2, 3 * NS
"""This many foreign targets within this time are reported."""
FINDING_REPEAT_NS: Time = 10 * NS
"""The pause before a finding is reported again."""
IGNORED = (NO_POSITION, NO_VELOCITY, NO_ACCELERATION)
FIELDS = ("position", "velocity", "acceleration")


class _Target(NamedTuple):
    """The controlling field of a target. field: 0 position, 1 velocity, 2 acceleration. value: in
    NED."""

    field: int
    value: Vec3


class OtherCommanders:
    """Watches one autopilot for commands from others. system: its system id. own_system: ours.
    stations: the system ids of other ground stations that sent heartbeats."""

    def __init__(self, system: int, own_system: int) -> None:
        self.stations: set[int] = set()
        self._system, self._own = system, own_system
        self._sent: deque[tuple[Time, Message]] = deque(maxlen=MOST_SENT)
        self._has_sent = True
        self._foreign: deque[Time] = deque(maxlen=FOREIGN_TARGETS)
        self._reported: dict[str, Time] = {}
        self._new: list[str] = []

    def take(self) -> list[str]:
        """Return descriptions of the findings since the last call."""
        if not self._new:
            return []
        new, self._new = self._new, []
        return new

    def sent(self, message: Message, now: Time) -> None:
        """Record a setpoint of ours."""
        self._has_sent = True
        self._sent.append((now, message))

    def follows(self, message: Message, now: Time) -> None:
        """Check the target that the autopilot reports (POSITION_TARGET_LOCAL_NED) while it follows
        setpoints in the air."""
        target = _target(message)
        if target is None:
            return
        field, value = target
        rests = (field > 0 and norm(value) <= REST_TOLERANCE) or (field == 2 and value == NO_THRUST)
        takes_off = not self._has_sent and field == 0 and value == ZERO
        if rests or takes_off or self._is_ours(target, now):
            return
        self._foreign.append(now)
        if len(self._foreign) == FOREIGN_TARGETS and now - self._foreign[0] <= FOREIGN_WINDOW_NS:
            kind, (x, y, z) = FIELDS[field], value
            self._report(
                f"it follows setpoints that this program did not send: {kind}"
                f" ({x:.1f}, {y:.1f}, {z:.1f}) north, east, down{self._who()}",
                now,
                about=f"setpoints of {kind}",
            )

    def follow_nobody(self) -> None:
        """Record that the autopilot doesn't follow setpoints now. Targets seen while it changes its
        mode are its own, so earlier findings are discarded."""
        self._has_sent = False
        self._foreign.clear()

    def _is_ours(self, target: _Target, now: Time) -> bool:
        replaced = now
        for sent, message in reversed(self._sent):
            if now - replaced > SETPOINT_VALIDITY_NS:
                break
            replaced = sent
            ours = _target(message)
            if ours is None or ours.field != target.field:
                continue
            if distance(target.value, ours.value) <= TARGET_TOLERANCES[target.field]:
                return True
        return False

    def answered(self, message: Message, now: Time) -> None:
        """Check a COMMAND_ACK for a command from another system."""
        to = message.target_system
        if to not in (0, self._own, self._system) and message.command < FIRST_REQUEST_COMMAND:
            self._report(f"system {to} commands it: {name_of(message.command)}", now)

    def overheard(self, message: Message, now: Time) -> None:
        """Check a message from another system on the same wire."""
        sender, kind = message.get_srcSystem(), message.get_type()
        if sender == self._own:
            self._report(
                f"another program has our system id {sender} too: give one of them another"
                " `own_system`",
                now,
            )
        elif kind == "HEARTBEAT":
            if message.type == mavlink.MAV_TYPE_GCS:
                self.stations.add(sender)
        elif kind in STEERING and getattr(message, "target_system", 0) == self._system:
            command = getattr(message, "command", None)
            if command is None or command < FIRST_REQUEST_COMMAND:
                what = kind if command is None else name_of(command)
                self._report(f"system {sender} commands it: {what}", now)

    def changed(self, name: str, before: float, value: float, now: Time) -> None:
        """Report a safety parameter whose value has changed since it was last read."""
        self._report(f"somebody set {name} from {before:g} to {value:g}{self._who()}", now)

    def _who(self) -> str:
        if not self.stations:
            return ""
        names = " and ".join(str(system) for system in sorted(self.stations))
        return f"; ground station {names} is also connected"

    def _report(self, words: str, now: Time, about: str = "") -> None:
        about = about or words
        last = self._reported.get(about)
        if last is None or now - last >= FINDING_REPEAT_NS:
            self._reported[about] = now
            self._new.append(words)


def _target(message: Message) -> _Target | None:
    """Return the field that controls a target: position, velocity or acceleration; None if there is
    none, such as for an attitude target."""
    mask = getattr(message, "type_mask", None)
    if mask is None or not hasattr(message, "vx"):
        return None
    values = (
        (message.x, message.y, message.z),
        (message.vx, message.vy, message.vz),
        (message.afx, message.afy, message.afz),
    )
    for field, (ignored, value) in enumerate(zip(IGNORED, values, strict=True)):
        if mask & ignored != ignored and all(map(isfinite, value)):
            return _Target(field, value)
    return None
