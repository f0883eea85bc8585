"""Manual override and failsafes: what took an autopilot out of offboard control, and how control
returns.

A manual mode is attributed to a pilot, unless the autopilot's texts report a failsafe. Any other
mode is attributed to the autopilot's own failsafe if a link loss or its texts explain it; texts may
arrive a moment after the mode. Otherwise the reason names the mode and says that the cause is
unknown.

Control is requested for at most 10 s: after that the pilot would no longer expect the change. After
the autopilot's own failsafe, control may be taken back without a request. This possibility ends
with the first mode that is manual or differs from the failsafe's, since a person may have chosen
it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from kybflow.core.signals import NS, Command, Time
from kybflow.drivers.mavlink.control.requests import Modes
from kybflow.drivers.mavlink.control.setpoints import SetpointStream
from kybflow.drivers.mavlink.telemetry.received_status import (
    NOTICE,
    LandedState,
    ReceivedStatus,
    Silence,
)

FAILSAFE_WORDS = (
    "lost", "variance", "emergency", "critical", "timeout", "battery", "fence breach", "geofence",
)  # fmt: skip
"""Words in a text by which an autopilot reports that it acted by itself. Some such texts are only
notices, for example ArduPilot's text about a breach of its own fence."""
TEXT_LEAD_NS: Time = 2 * NS
"""How long before the mode change a text may have arrived to explain it."""
TEXT_DELAY_NS: Time = NS // 2
"""How long to wait for texts that explain the mode change."""
LANDING_GRACE: Time = 3 * NS
"""How long a vehicle on the ground may be disarmed or in another mode before this counts as an
override: an autopilot ends a landing by itself, and the mission may detect the touchdown later."""
CUT_BEFORE: Time = 3 * NS
"""How long ago the link may have returned for its loss to explain the mode change."""


class OverrideCause(NamedTuple):
    """Why an autopilot left offboard control. reason: a description. by_itself: whether its own
    failsafe is the cause."""

    reason: str
    by_itself: bool = False


class OverrideDetector:
    """Detects that an armed autopilot has left the requested mode, and why.

    silence: the most recent interval without a message.
    is_in_doubt: whether the autopilot has left the mode for a reason not yet known."""

    def __init__(self, status: ReceivedStatus, modes: Modes) -> None:
        self.silence: Silence | None = None
        self._status, self._modes = status, modes
        self._since: Time | None = None

    @property
    def is_in_doubt(self) -> bool:
        return self._since is not None

    def forget(self) -> None:
        """Discard the current finding, because another goal is requested."""
        self._since = None

    def found(self, now: Time) -> OverrideCause | None:
        """Return why the vehicle doesn't follow. Return None while it follows, and while explaining
        texts may still arrive. Called once a tick."""
        if self._status.armed and not self._modes.has_left:
            self._since = None
            return None
        if self._since is None:
            self._since = now
        if self._status.armed:
            return self._mode(self._since, now)
        in_air = self._status.landed in (LandedState.AIR, LandedState.TAKING_OFF)
        if not in_air and now - self._since <= LANDING_GRACE:
            return None
        words = self._status.words(self._since - TEXT_LEAD_NS)
        where = "in the air" if in_air else "on the ground"
        return OverrideCause(f"it disarmed {where}" + (f" ('{words}')" if words else ""))

    def _mode(self, since: Time, now: Time) -> OverrideCause | None:
        mode, words, silence = (
            self._modes.reported,
            self._status.words(since - TEXT_LEAD_NS, NOTICE),
            self.silence,
        )
        text = f" ('{words}')" if words else ""
        if "failsafe" in words.lower():
            return OverrideCause(f"its own failsafe: {mode}{text}", True)
        if self._modes.is_manual:
            return OverrideCause(f"a pilot took over: {mode}{text}")
        if silence is not None and since - silence.ended <= CUT_BEFORE:
            cut = f"after {silence.seconds:.1f} s without a link"
            return OverrideCause(f"its own failsafe: {mode}, {cut}{text}", True)
        if any(word in words.lower() for word in FAILSAFE_WORDS):
            return OverrideCause(f"its own failsafe: {mode}{text}", True)
        on_ground = self._status.landed is LandedState.GROUND
        if now - since < (LANDING_GRACE if on_ground else TEXT_DELAY_NS):
            return None
        return OverrideCause(
            f"it changed to {mode} by itself or by a person, for an unknown reason{text}"
        )


RECLAIM_TIMEOUT_NS: Time = 10 * NS
"""How long control is requested."""
NO_POSITION = "it can't hold its position, which is unknown"


class ControlRecovery:
    """Takes a vehicle back into offboard control.

    stream: sends the hold command in the meantime.
    hold: returns that command, or None while the position is unknown.
    follows: requests the mode that follows setpoints, and returns whether it is in force.
    is_unasked: whether control may be taken back without a request."""

    def __init__(
        self, modes: Modes, stream: SetpointStream, hold: Callable[[], Command | None],
        follows: Callable[[Time], bool],
    ) -> None:  # fmt: skip
        self._modes, self._stream, self._hold, self._follows = modes, stream, hold, follows
        self._holding: Command | None = None
        self._asked: Time = 0
        self.is_unasked = False
        self._failsafe_mode = ""

    @property
    def is_under_way(self) -> bool:
        return self._holding is not None

    @property
    def is_elsewhere(self) -> bool:
        """Whether a person may have taken control: the mode is manual, or is neither the failsafe's
        mode nor the one that follows setpoints."""
        mode = self._modes.reported
        is_other = mode != self._failsafe_mode and not self._modes.is_in("offboard")
        return self._modes.is_manual or is_other

    def expect(self) -> None:
        """Allow control to be taken back without a request, from the mode reported now."""
        self.is_unasked, self._failsafe_mode = True, self._modes.reported

    def begin(self, now: Time) -> str:
        """Begin to request control. Return the reason if that is impossible, otherwise an empty
        string."""
        self._holding, self._asked = self._hold(), now
        if self._holding is None:
            return NO_POSITION
        self._modes.want("offboard")
        return ""

    def forget(self) -> None:
        """Discard the current request, because another goal is requested."""
        self._holding, self.is_unasked = None, False

    def end(self) -> None:
        """Withdraw the request, and no longer allow control to be taken back without one."""
        self.forget()
        self._stream.stop()
        self._modes.want(None)

    def timed_out(self, now: Time) -> str:
        """Return why control has not returned within the time limit; empty until then."""
        if now - self._asked <= RECLAIM_TIMEOUT_NS:
            return ""
        return f"{self._modes.trouble}, asked for {RECLAIM_TIMEOUT_NS / NS:.0f} s"

    def step(self, now: Time) -> bool:
        """Send the hold command and request the mode; return whether the vehicle follows. Called
        once a tick while control is requested."""
        if self._holding is not None:
            self._stream.feed(self._holding, now)
        return self._follows(now)
