"""State machines built from a plan alone."""

from __future__ import annotations

from typing import Any

import pytest

from kybflow.core.units import LENGTH
from kybflow.dsl.expressions import Compare, Expression, Number, Read
from kybflow.dsl.machine import VehicleMachine
from kybflow.dsl.plan import PartPlan, StatePlan, TransitionPlan, VehiclePlan
from kybflow.parts import AIR, GROUND
from kybflow.world.vehicle_context import Airframe

PART = PartPlan("any", object, None, "any")
HIGH = Compare(">", Read(None, "state.altitude"), Number(1.0, LENGTH))
NOTHING: frozenset[str] = frozenset()


def arrow(cause: Any, target: str, **rest: Any) -> TransitionPlan:
    return TransitionPlan(cause, target, **rest)


def machine(*arrows: TransitionPlan, holds: dict[Expression, bool] | None = None) -> VehicleMachine:
    """A machine of `first` with `arrows`, `second`, and the built-in `brake`."""
    known = holds if holds is not None else {}
    states = {
        "first": StatePlan("first", PART, (GROUND >> AIR,), arrows),
        "second": StatePlan("second", PART, (AIR >> AIR,), (arrow("then", "first"),)),
        "brake": StatePlan("brake", PART, (AIR >> AIR,), (), built_in=True),
    }
    airframe = Airframe(mass=1.0, diameter=0.5, inertia=(0.01,) * 3, thrust=6.0, rotor_time=0.05)
    vehicle = VehiclePlan(
        "a", airframe, (0.0, 0.0, 0.0), 0.0, (), (), PART, (), PART, "first", states
    )
    return VehicleMachine(vehicle, lambda expression: lambda: known[expression])


def test_nothing_is_due_while_the_behavior_runs() -> None:
    made = machine(arrow("then", "second"), arrow("within", "brake", after=5.0))
    assert made.due(1.0, NOTHING, "running", 0.004) is None
    assert made.state == "first"


@pytest.mark.parametrize(("outcome", "target"), [("done", "second"), ("failed", "brake")])
def test_the_end_of_a_behavior_takes_its_arrow(outcome: Any, target: str) -> None:
    made = machine(arrow("then", "second"), arrow("failed", "brake"))
    due = made.due(1.0, NOTHING, outcome, 0.004)
    assert due is not None
    made.fire(due)
    assert target == made.state


def test_next_is_asked_before_the_end_and_the_end_before_the_time_out() -> None:
    soon = arrow("within", "first", after=0.0)
    done = arrow("then", "second")
    heard = arrow("next", "brake", event="operator.go")
    made = machine(soon, done, heard)
    assert heard is made.due(1.0, {"operator.go"}, "done", 0.004)
    assert done is made.due(1.0, NOTHING, "done", 0.004)
    assert soon is made.due(1.0, NOTHING, "running", 0.004)


def test_time_outs_come_on_the_tick_and_not_one_later() -> None:
    made = machine(arrow("within", "brake", after=0.3))
    assert made.due(0.296, NOTHING, "running", 0.004) is None
    assert made.due(3 * 0.1, NOTHING, "running", 0.004) is not None


def test_a_condition_must_hold_for_its_time_without_a_gap() -> None:
    holds = {HIGH: True}
    made = machine(arrow("next", "second", when=HIGH, hold=0.02), holds=holds)

    def ask(times: int) -> list[bool]:
        return [made.due(1.0, NOTHING, "running", 0.01) is not None for _ in range(times)]

    assert ask(2) == [False, False]
    holds[HIGH] = False
    assert ask(1) == [False]
    holds[HIGH] = True
    assert ask(3) == [False, False, True]


def test_entering_a_state_starts_its_timers_anew() -> None:
    made = machine(arrow("next", "first", when=HIGH, hold=0.02), holds={HIGH: True})
    dues = [made.due(1.0, NOTHING, "running", 0.01) for _ in range(3)]
    assert dues[2] is not None
    made.fire(dues[2])
    assert made.due(0.0, NOTHING, "running", 0.01) is None


def test_everything_that_an_arrow_names_must_hold_together() -> None:
    holds = {HIGH: False}
    made = machine(arrow("next", "second", when=HIGH, event="go", after=1.0), holds=holds)
    assert made.due(2.0, {"go"}, "running", 0.004) is None
    holds[HIGH] = True
    assert made.due(0.5, {"go"}, "running", 0.004) is None
    assert made.due(2.0, NOTHING, "running", 0.004) is None
    assert made.due(2.0, {"go"}, "running", 0.004) is not None


def test_an_arrow_that_names_nothing_is_never_due() -> None:
    assert machine(arrow("next", "second")).due(9.0, NOTHING, "running", 0.004) is None


def test_firing_what_is_not_due_is_refused() -> None:
    then = arrow("then", "second")
    made = machine(then)
    made.due(1.0, NOTHING, "running", 0.004)
    with pytest.raises(ValueError, match="no arrow from `first` to `second` is due"):
        made.fire(then)
    assert made.state == "first"


def test_the_failsafe_forces_a_built_in_state_from_anywhere() -> None:
    made = machine()
    made.force("brake")
    assert made.state == "brake"
    made.force("brake")
    assert made.state == "brake"


def chained(*inner: StatePlan) -> VehicleMachine:
    """A machine of `inner` and of `out`, the first of them first."""
    out = StatePlan("out", PART, (AIR >> AIR,), (arrow("then", inner[0].name, enters="chain"),))
    airframe = Airframe(mass=1.0, diameter=0.5, inertia=(0.01,) * 3, thrust=6.0, rotor_time=0.05)
    states = {state.name: state for state in (*inner, out)}
    vehicle = VehiclePlan(
        "a", airframe, (0.0, 0.0, 0.0), 0.0, (), (), PART, (), PART, inner[0].name, states
    )
    return VehicleMachine(vehicle, lambda expression: lambda: False)


def taken(made: VehicleMachine, elapsed: float, outcome: Any = "running") -> str:
    """The state after a tick."""
    due = made.due(elapsed, NOTHING, outcome, 0.004)
    if due is not None:
        made.fire(due)
    return made.state


def test_a_chain_is_bounded_from_its_entry_on() -> None:
    late = arrow("within", "out", after=10.0, since="chain")
    a = StatePlan("chain.a", PART, (AIR >> AIR,), (arrow("then", "chain.b"), late))
    b = StatePlan("chain.b", PART, (AIR >> AIR,), (arrow("then", "chain.a"), late))
    made = chained(a, b)
    assert taken(made, 6.0, "done") == "chain.b"
    assert taken(made, 3.9) == "chain.b"
    assert taken(made, 4.0) == "out"
    assert taken(made, 1.0, "done") == "chain.a"
    assert taken(made, 9.9) == "chain.a"


def test_a_chain_that_enters_itself_begins_anew() -> None:
    late = arrow("within", "out", after=10.0, since="chain")
    again = arrow("then", "chain.a", enters="chain")
    a = StatePlan("chain.a", PART, (AIR >> AIR,), (arrow("then", "chain.b"), late))
    b = StatePlan("chain.b", PART, (AIR >> AIR,), (again, late))
    made = chained(a, b)
    taken(made, 5.0, "done")
    assert taken(made, 4.0, "done") == "chain.a"
    assert taken(made, 9.9) == "chain.a"


def test_a_state_that_is_asked_for_begins_its_chain_anew() -> None:
    late = arrow("within", "out", after=10.0, since="chain")
    a = StatePlan("chain.a", PART, (AIR >> AIR,), (arrow("then", "chain.b"), late))
    b = StatePlan("chain.b", PART, (AIR >> AIR,), (late,))
    made = chained(a, b)
    taken(made, 5.0)
    made.force("chain.b")
    assert taken(made, 9.9) == "chain.b"
