"""Who commands a run."""

from __future__ import annotations

from kybflow.dsl.plan import Emit, Stop
from kybflow.runtime.commanding.lease import SCHEDULE, Lease
from kybflow.runtime.commanding.orders import LandOrder, PauseOrder, ReleaseLease

GO = Emit("operator.go")


def test_the_first_who_commands_holds_it_and_a_second_is_refused_by_name() -> None:
    lease = Lease()
    assert lease.objection(GO, "anna", False) is None
    refused = "`anna` commands this run; take the lease (`--take`) to command it"
    assert lease.objection(GO, "ben", False) == refused
    assert lease.objection(ReleaseLease(), "ben", False) == refused
    assert lease.objection(GO, "anna", False) is None


def test_who_takes_it_has_it_and_who_releases_it_does_not() -> None:
    lease = Lease()
    assert lease.objection(GO, "anna", False) is None
    assert lease.objection(GO, "ben", True) is None
    assert lease.holder == "ben"
    assert lease.objection(ReleaseLease(), "ben", False) is None
    assert lease.holder is None


def test_land_pause_and_stop_are_heard_from_anyone_and_take_nothing() -> None:
    lease = Lease()
    for order in (LandOrder(), PauseOrder(("a",)), Stop("")):
        assert lease.objection(order, "ben", True) is None
        assert lease.holder is None
    assert lease.objection(GO, SCHEDULE, False) is None
    assert lease.holder is None
