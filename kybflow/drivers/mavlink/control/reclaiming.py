"""Asking for a vehicle back that somebody else has, to hold still where it is until it is commanded
again. Nobody insists for ever: it would leave its pilot when nobody thinks of it any more.

One that its own failsafe has may be to come back unasked. That ends with the first mode that is
flown by hand, or that is another than it was: a person may have chosen it.
"""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.signals import NS, Command, Time
from kybflow.drivers.mavlink.control.modes import Modes
from kybflow.drivers.mavlink.control.override import BY_HAND
from kybflow.drivers.mavlink.control.stream import Stream

INSISTENT: Time = 10 * NS
"""How long it is asked for."""
NOWHERE = "it is not known where it is, and so not where it is to hold"


class Reclaiming:
    """Of one vehicle. stream: what it is sent meanwhile. hold: what makes it hold still where it
    is, None where that is not known. follows: asks for the mode in which it follows; whether it is
    in it. `is_unasked`: whether it is to come back though nobody asks."""

    def __init__(
        self, modes: Modes, stream: Stream, hold: Callable[[], Command | None],
        follows: Callable[[Time], bool],
    ) -> None:  # fmt: skip
        self._modes, self._stream, self._hold, self._follows = modes, stream, hold, follows
        self._holding: Command | None = None
        self._asked: Time = 0
        self.is_unasked = False
        self._left_for = ""

    @property
    def is_under_way(self) -> bool:
        return self._holding is not None

    @property
    def is_elsewhere(self) -> bool:
        """Whether a person may have one that is to come back unasked: it is flown by hand, or
        neither in the mode of its failsafe nor in the one in which it follows."""
        mode = self._modes.reported
        is_other = mode != self._left_for and not self._modes.is_in("offboard")
        return mode in BY_HAND or is_other

    def expect(self) -> None:
        """It is to come back unasked, from the mode in which it is now."""
        self.is_unasked, self._left_for = True, self._modes.reported

    def begin(self, now: Time) -> str:
        """Ask for it from now on; why that can't be, empty where it can."""
        self._holding, self._asked = self._hold(), now
        if self._holding is None:
            return NOWHERE
        self._modes.want("offboard")
        return ""

    def forget(self) -> None:
        """It is asked for something else now."""
        self._holding, self.is_unasked = None, False

    def end(self) -> None:
        """It is not asked for any more, and not to come unasked."""
        self.forget()
        self._stream.stop()
        self._modes.want(None)

    def lasts(self, now: Time) -> str:
        """Why it does not come, once it was asked for long enough; empty before."""
        if now - self._asked <= INSISTENT:
            return ""
        return f"{self._modes.trouble}, asked for {INSISTENT / NS:.0f} s"

    def step(self, now: Time) -> bool:
        """Whether it is back; once a tick while it is under way."""
        if self._holding is not None:
            self._stream.feed(self._holding, now)
        return self._follows(now)
