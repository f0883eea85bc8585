"""The lease: the right to command a run. The first person who gives a command holds the lease until
they release it or another person takes it. `land`, `pause` and `stop` need no lease, nor do the
run's scheduled commands."""

from __future__ import annotations

from kybflow.dsl.plan import Stop
from kybflow.runtime.commanding.orders import LandOrder, Order, PauseOrder, ReleaseLease

SCHEDULE = "command line"
"""The name of the requester of scheduled commands."""
_FROM_ANYONE = (LandOrder, PauseOrder, Stop)


def is_for_anyone(order: Order) -> bool:
    """Return whether a command needs no lease, because it makes the flight safer."""
    return isinstance(order, _FROM_ANYONE)


class Lease:
    """The lease of a run. holder: the name of the person who holds it, or None."""

    def __init__(self) -> None:
        self.holder: str | None = None

    def objection(self, order: Order, by: str, take: bool) -> str | None:
        """Return why the person `by` may not give this command now. If they may, give them the
        lease if the command needs it, and return None. take: whether to take the lease from
        another."""
        if by == SCHEDULE or is_for_anyone(order):
            return None
        if self.holder not in (None, by) and not take:
            return f"`{self.holder}` commands this run; take the lease (`--take`) to command it"
        self.holder = None if isinstance(order, ReleaseLease) else by
        return None
