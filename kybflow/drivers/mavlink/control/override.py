"""Why an autopilot has left the mode in which it followed: a person, its own failsafe, or nobody
says.

A mode that is flown by hand is a pilot's, unless its own words say failsafe. Any other is its own
failsafe where a cut link or its words say so; words may come a moment later than the mode. Where
nothing says so, that is said.
"""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.control.modes import Modes
from kybflow.drivers.mavlink.telemetry.heard import Heard, Landed

BY_HAND = frozenset(
    {
        "MANUAL", "ALTITUDE", "POSITION", "ACRO", "STABILIZED",
        "STABILIZE", "ALT_HOLD", "LOITER", "POSHOLD", "SPORT", "DRIFT", "FLIP", "AUTOTUNE",
    }
)  # fmt: skip
"""The modes that a person flies, as the autopilots call them."""
TELLING = ("lost", "variance", "emergency", "critical", "timeout", "low battery")
"""What of an autopilot's words says that it acted by itself."""
BEFORE: Time = 2 * NS
"""How much earlier than the change what it said may be about it."""
AFTER: Time = NS // 2
"""How long its words are waited for."""
LANDS_ITSELF: Time = 3 * NS
"""How long a vehicle that disarmed itself on the ground, or left its land mode there, is waited
for: who lands it notices later that it is there, and of the two the mode may be told first."""
CUT_BEFORE: Time = 3 * NS
"""How long ago a link may have returned that explains the change."""


class Silence(NamedTuple):
    """A time in which nothing was heard, when it ended, and how many seconds long it was."""

    ended: Time
    seconds: float


class Verdict(NamedTuple):
    """reason: in words. by_itself: its own failsafe has it."""

    reason: str
    by_itself: bool = False


class Taking:
    """Of one autopilot that is armed and in the wanted mode: does it stay there? `silence`: the
    newest one of the link. `is_in_doubt`: whether it does not, and it is not yet known why."""

    def __init__(self, heard: Heard, modes: Modes) -> None:
        self.silence: Silence | None = None
        self._heard, self._modes = heard, modes
        self._since: Time | None = None

    @property
    def is_in_doubt(self) -> bool:
        return self._since is not None

    def forget(self) -> None:
        """It is asked for something else now."""
        self._since = None

    def found(self, now: Time) -> Verdict | None:
        """Who has it, asked once a tick; None while it obeys, and while its words are waited
        for."""
        if self._heard.armed and not self._modes.has_left:
            self._since = None
            return None
        if self._since is None:
            self._since = now
        return self._mode(self._since, now) if self._heard.armed else self._rotors(self._since, now)

    def _mode(self, since: Time, now: Time) -> Verdict | None:
        mode, words, silence = self._modes.reported, self._heard.words(since - BEFORE), self.silence
        said = f" ('{words}')" if words else ""
        if "failsafe" in words.lower():
            return Verdict(f"its own failsafe: {mode}{said}", True)
        if mode in BY_HAND:
            return Verdict(f"a pilot took over: {mode}{said}")
        if silence is not None and since - silence.ended <= CUT_BEFORE:
            cut = f"after {silence.seconds:.1f} s without a link"
            return Verdict(f"its own failsafe: {mode}, {cut}{said}", True)
        if any(telling in words.lower() for telling in TELLING):
            return Verdict(f"its own failsafe: {mode}{said}", True)
        on_ground = self._heard.landed is Landed.GROUND
        if now - since < (LANDS_ITSELF if on_ground else AFTER):
            return None
        return Verdict(f"a person or itself put it into {mode}, and it does not say why{said}")

    def _rotors(self, since: Time, now: Time) -> Verdict | None:
        """It is disarmed, which nobody here asked for."""
        in_air = self._heard.landed in (Landed.AIR, Landed.TAKING_OFF)
        if not in_air and now - since <= LANDS_ITSELF:
            return None
        words = self._heard.words(since - BEFORE)
        where = "in the air" if in_air else "on the ground"
        return Verdict(f"it disarmed {where}" + (f" ('{words}')" if words else ""))
