"""The mode in which a vehicle follows, asked for before anybody arms it: what it says of its
readiness is about the mode that it is in."""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.signals import NS, Command, Time
from kybflow.drivers.mavlink.control.modes import Modes
from kybflow.drivers.mavlink.control.stream import Stream

AGAIN: Time = 2 * NS
"""After this it is asked anew for a mode that it has left."""


class Preparing:
    """Of one autopilot. stream: where set-points must flow before the mode. hold: what makes it
    hold still where it is, None where that is not known. follows: asks for the mode in which it
    follows; whether it is in it."""

    def __init__(
        self, modes: Modes, stream: Stream | None, hold: Callable[[], Command | None],
        follows: Callable[[Time], bool],
    ) -> None:  # fmt: skip
        self._modes, self._stream, self._hold, self._follows = modes, stream, hold, follows
        self._left: Time | None = None

    def step(self, now: Time) -> str:
        """Why it is not in it, empty when it is; once a tick, disarmed."""
        self._modes.want("offboard")
        if self._stream is not None:
            if (holding := self._hold()) is None:
                return "it has no position to hold, which it must be sent first"
            self._stream.feed(holding, now)
        self._come_back(now)
        return "" if self._follows(now) else self._modes.trouble

    def _come_back(self, now: Time) -> None:
        if not self._modes.has_left:
            self._left = None
        elif self._left is None:
            self._left = now
        elif now - self._left > AGAIN:
            self._left = None
            self._modes.again()
