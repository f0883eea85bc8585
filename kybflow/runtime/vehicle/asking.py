"""What is asked of a vehicle beside commands: to arm, to stop its rotors, to obey again.

Whatever the link raises fails the vehicle as reading and sending do, but for a refusal, which is
the vehicle's answer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from kybflow.core.errors import Refused
from kybflow.core.signals import Command, Estimate, Time
from kybflow.parts import Check, Link, Said, Taken


class Asking:
    """Of one vehicle, over `link`; `failed` is told of what that raises. `is_told`, `speaks`:
    whether the link heeds where the vehicle is, and says things of it. Most do neither, and need
    not be asked in every tick."""

    def __init__(self, link: Link, failed: Callable[[Exception], None]) -> None:
        self._link, self._failed = link, failed
        self.is_told = getattr(link.tell, "__func__", None) is not Link.tell
        self.speaks = getattr(link.said, "__func__", None) is not Link.said

    @property
    def taken(self) -> Taken | None:
        """Why the vehicle does not obey, though its link lives; None while it does."""
        return self._link.taken

    @property
    def armed(self) -> bool | None:
        """Whether its rotors may turn, as the vehicle says; None where it says nothing."""
        return self._link.armed

    def arm(self, command: Command, now: Time) -> bool:
        """Ask the vehicle to get ready to obey; whether it is. Raises Refused."""
        try:
            return self._link.arm(command, now)
        except Refused:
            raise
        except Exception as error:  # a part may raise anything; it fails this vehicle alone
            self._failed(error)
            return False

    def cut(self, now: Time) -> None:
        """Stop the rotors at once."""
        try:
            self._link.cut(now)
        except Exception as error:  # see arm
            self._failed(error)

    def reclaim(self, now: Time) -> None:
        """Ask for a vehicle back that was taken."""
        try:
            self._link.reclaim(now)
        except Exception as error:  # see arm
            self._failed(error)

    def tell(self, estimate: Estimate, now: Time) -> None:
        """Tell the vehicle where it is."""
        try:
            self._link.tell(estimate, now)
        except Exception as error:  # see arm
            self._failed(error)

    def checks(self, now: Time) -> Sequence[Check]:
        """What the vehicle itself has to say before take-off."""
        try:
            return self._link.checks(now)
        except Exception as error:  # see arm
            self._failed(error)
            return ()

    def said(self) -> Sequence[Said]:
        """What the vehicle said of itself since the last call."""
        try:
            return self._link.said()
        except Exception as error:  # see arm
            self._failed(error)
            return ()
