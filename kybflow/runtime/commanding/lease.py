"""The lease: who commands a run. The first who gives a command holds it until they release it or
another takes it. `land`, `pause` and `stop` need no lease, nor does the run's own schedule."""

from __future__ import annotations

from kybflow.dsl.plan import Stop
from kybflow.runtime.commanding.orders import LandOrder, Order, PauseOrder, ReleaseLease

SCHEDULE = "command line"
"""The name under which scheduled commands are given."""
_FROM_ANYONE = (LandOrder, PauseOrder, Stop)


def is_for_anyone(order: Order) -> bool:
    """Return whether a command needs no lease, because it makes the flight safer."""
    return isinstance(order, _FROM_ANYONE)


class Lease:
    """holder: the name of who commands the run, None without one."""

    def __init__(self) -> None:
        self.holder: str | None = None

    def objection(self, order: Order, by: str, take: bool) -> str | None:
        """Return why `by` may not give a command now; if they may, give them the lease."""
        if by == SCHEDULE or is_for_anyone(order):
            return None
        if self.holder not in (None, by) and not take:
            return f"`{self.holder}` commands this run; take the lease (`--take`) to command it"
        self.holder = None if isinstance(order, ReleaseLease) else by
        return None
