"""State machines built from a plan alone: which transitions are legal, which is taken when, and
what the machine tells its owner."""

from __future__ import annotations

from typing import Any

import pytest
from plans import NANO

from kybflow.core.units import LENGTH
from kybflow.dsl.expressions import Compare, Expression, Quantity, Read
from kybflow.dsl.machine import Exit, FlowMachine, VehicleMachine
from kybflow.dsl.plan import FlowPlan, PartPlan, PhasePlan, StatePlan, TransitionPlan, VehiclePlan
from kybflow.parts import AIR, GROUND

PART = PartPlan("any", object, None, "any")
HIGH = Compare(">", Read(None, "state.altitude"), Quantity(1.0, LENGTH))
NOTHING: frozenset[str] = frozenset()
BUILT_IN = ("brake", "auto_land", "landed", "fault")


def transition(cause: Any, target: str, **rest: Any) -> TransitionPlan:
    return TransitionPlan(target=target, cause=cause, **rest)


class Owner:
    """The owner of a machine: it writes down what it is told. A state in `refuses` does not start,
    and is left at once."""

    def __init__(
        self,
        *states: StatePlan,
        holds: dict[Expression, bool] | None = None,
        refuses: tuple[str, ...] = (),
        off_ground: bool = True,
        latched: bool = False,
    ) -> None:
        self.told: list[str] = []
        self.exits: list[Exit] = []
        self.refuses, self.refused, self.broken = refuses, NOTHING, ""
        known = holds if holds is not None else {}
        built_in = [StatePlan(n, PART, (AIR >> AIR,), (), built_in=True) for n in BUILT_IN]
        every = {state.name: state for state in (*states, *built_in)}
        vehicle = VehiclePlan(
            name="a", airframe=NANO, start=(0.0, 0.0, 0.0), heading=0.0, tracker=PART,
            driver=PART, begin=states[0].name, states=every,
        )  # fmt: skip
        self.machine = VehicleMachine(
            vehicle, lambda expression: lambda: known[expression], on_enter=self.enter,
            on_exit=self.exit, starts=self.starts, off_ground=lambda: off_ground,
            latched=lambda: latched,
        )  # fmt: skip

    def enter(self, state: str) -> None:
        assert state == self.machine.state
        self.told.append(f"enter {state}")
        if state == self.broken:
            raise RuntimeError(f"{state} is broken")
        if state in self.refuses:
            self.refused |= {state}
            self.machine.refuse(self.refused)

    def exit(self, reason: Exit) -> None:
        self.exits.append(reason)
        self.told.append(f"exit {self.machine.state}: {reason.how}")

    def starts(self, state: str) -> bool:
        if state in self.refuses:
            raise RuntimeError(f"{state} refuses")
        return True

    def ask(
        self,
        elapsed: float,
        heard: set[str] | frozenset[str] = NOTHING,
        outcome: Any = "running",
        dt: float = 0.004,
    ) -> str:
        """The state after one tick."""
        self.machine.step(elapsed, heard, outcome, dt)
        return self.machine.state


def begun(*leaving: TransitionPlan, **more: Any) -> Owner:
    """An owner in `first`, which has these transitions; `second` goes back to it when done."""
    owner = Owner(
        StatePlan("first", PART, (GROUND >> AIR,), leaving),
        StatePlan("second", PART, (AIR >> AIR,), (transition("then", "first"),)),
        **more,
    )
    owner.machine.begin()
    return owner


def test_nothing_is_taken_while_the_behavior_runs() -> None:
    owner = begun(transition("then", "second"), transition("within", "brake", after=5.0))
    assert owner.ask(1.0) == "first"
    assert owner.told == ["enter first"]


@pytest.mark.parametrize(("outcome", "target"), [("done", "second"), ("failed", "brake")])
def test_the_end_of_a_behavior_takes_its_transition(outcome: Any, target: str) -> None:
    owner = begun(transition("then", "second"), transition("failed", "brake"))
    assert owner.ask(1.0, outcome=outcome) == target


def test_next_is_asked_before_the_end_and_the_end_before_the_time_out() -> None:
    def after(heard: set[str], outcome: Any) -> str:
        soon = transition("within", "first", after=0.0)
        done = transition("then", "second")
        go = transition("next", "brake", event="operator.go")
        owner = begun(soon, done, go)
        owner.ask(1.0, heard, outcome)
        return owner.told[-2] + ", " + owner.told[-1]

    assert after({"operator.go"}, "done") == "exit first: next, enter brake"
    assert after(set(), "done") == "exit first: done, enter second"
    assert after(set(), "running") == "exit first: within, enter first"


def test_next_is_asked_from_the_top() -> None:
    owner = begun(transition("next", "second", event="go"), transition("next", "brake", event="go"))
    assert owner.ask(1.0, {"go"}) == "second"


def test_time_outs_come_on_the_tick_and_not_one_later() -> None:
    owner = begun(transition("within", "brake", after=0.3))
    assert owner.ask(0.296) == "first"
    assert owner.ask(3 * 0.1) == "brake"


def test_a_condition_must_hold_for_its_time_without_a_gap() -> None:
    holds = {HIGH: True}
    owner = begun(transition("next", "second", when=HIGH, hold=0.02), holds=holds)

    def ask(times: int) -> list[str]:
        return [owner.ask(1.0, dt=0.01) for _ in range(times)]

    assert ask(2) == ["first", "first"]
    holds[HIGH] = False
    assert ask(1) == ["first"]
    holds[HIGH] = True
    assert ask(3) == ["first", "first", "second"]


def test_entering_a_state_starts_its_timers_anew() -> None:
    owner = begun(transition("next", "first", when=HIGH, hold=0.02), holds={HIGH: True})
    for _ in range(3):
        owner.ask(1.0, dt=0.01)
    assert owner.told == ["enter first", "exit first: next", "enter first"]
    owner.ask(0.0, dt=0.01)
    assert len(owner.told) == 3


def test_everything_that_a_transition_names_must_hold_together() -> None:
    holds = {HIGH: False}
    owner = begun(transition("next", "second", when=HIGH, event="go", after=1.0), holds=holds)
    assert owner.ask(2.0, {"go"}) == "first"
    holds[HIGH] = True
    assert owner.ask(0.5, {"go"}) == "first"
    assert owner.ask(2.0) == "first"
    assert owner.ask(2.0, {"go"}) == "second"


def test_a_transition_that_names_nothing_is_never_taken() -> None:
    assert begun(transition("next", "second")).ask(9.0) == "first"


def test_the_owner_is_told_of_the_exit_before_and_of_the_entry_after_the_state_changes() -> None:
    leaving = transition("within", "second", after=1.0, at="a.yaml:3")
    owner = begun(leaving)
    owner.ask(1.0)
    assert owner.told == ["enter first", "exit first: within", "enter second"]
    assert owner.exits == [Exit("within", "a.yaml:3", leaving)]


def test_a_guard_is_asked_once_a_tick() -> None:
    answers = iter([False, True])
    owner = begun(transition("next", "second", when=HIGH), holds=_Answers(answers))
    assert owner.ask(1.0) == "first"
    assert owner.ask(1.0) == "second"
    assert owner.told == ["enter first", "exit first: next", "enter second"]


class _Answers(dict[Any, Any]):
    def __init__(self, answers: Any) -> None:
        self.answers = answers

    def __missing__(self, key: Any) -> bool:
        return bool(next(self.answers))


def test_the_failsafe_enters_a_built_in_state_from_everywhere() -> None:
    owner = begun()
    for state in (*BUILT_IN, "fault", "landed"):
        owner.machine.enter_built_in(state)
        assert state == owner.machine.state
    assert owner.told[:3] == ["enter first", "exit first: failsafe", "enter brake"]
    again = ["exit fault: failsafe", "enter fault", "exit fault: failsafe", "enter landed"]
    assert owner.told[-4:] == again


@pytest.mark.parametrize("state", ["second", "nowhere"])
def test_the_failsafe_enters_no_state_of_the_mission(state: str) -> None:
    owner = begun()
    with pytest.raises(ValueError, match=f"no transition `built-in {state}` leaves `first`"):
        owner.machine.enter_built_in(state)
    assert owner.told == ["enter first"]


def test_what_is_asked_for_is_entered_from_every_state_but_fault() -> None:
    owner = begun()
    for state in ("second", "second", "auto_land", "first"):
        owner.machine.switch(state, "a.yaml:7")
        assert state == owner.machine.state
    assert Exit("asked", "a.yaml:7") == owner.exits[-1]
    owner.machine.enter_built_in("fault")
    with pytest.raises(ValueError, match="no transition `switch first` leaves `fault`"):
        owner.machine.switch("first", "")
    assert owner.machine.state == "fault"


def test_fault_can_not_be_asked_for() -> None:
    owner = begun()
    with pytest.raises(ValueError, match="no transition `switch fault` leaves `first`"):
        owner.machine.switch("fault", "")
    assert owner.machine.state == "first"


def test_what_is_asked_for_and_refuses_to_start_changes_nothing() -> None:
    owner = begun(refuses=("second",))
    with pytest.raises(RuntimeError, match="second refuses"):
        owner.machine.switch("second", "")
    assert owner.told == ["enter first"]
    assert owner.machine.state == "first"


def test_a_machine_begins_once_and_does_nothing_before() -> None:
    owner = Owner(StatePlan("first", PART, (GROUND >> AIR,), (transition("then", "brake"),)))
    owner.machine.step(0.0, NOTHING, "done", 0.004)
    with pytest.raises(ValueError, match="no transition `built-in brake`"):
        owner.machine.enter_built_in("brake")
    owner.machine.begin()
    assert owner.told == ["enter first"]
    with pytest.raises(ValueError, match="no transition `begin` leaves `first`"):
        owner.machine.begin()


@pytest.mark.parametrize(("latched", "rests"), [(False, "landed"), (True, "fault")])
def test_a_latched_vehicle_that_lands_rests_in_fault(latched: bool, rests: str) -> None:
    owner = begun(transition("then", "landed"), latched=latched)
    assert rests == owner.ask(1.0, outcome="done")
    assert owner.told == ["enter first", "exit first: done", f"enter {rests}"]


def test_a_behavior_that_refuses_to_start_goes_where_its_failure_leads() -> None:
    second = StatePlan("second", PART, (AIR >> AIR,), (transition("failed", "third", at="a:2"),))
    third = StatePlan("third", PART, (AIR >> AIR,), ())
    first = StatePlan("first", PART, (AIR >> AIR,), (transition("then", "second"),))
    owner = Owner(first, second, third, refuses=("second",))
    owner.machine.begin()
    owner.ask(1.0, outcome="done")
    left = ["exit first: done", "enter second", "exit second: refused", "enter third"]
    assert owner.told[1:] == left
    assert not owner.exits[-1].at


@pytest.mark.parametrize(("off_ground", "last"), [(True, "brake"), (False, "landed")])
def test_behaviors_that_refuse_in_a_circle_brake_or_stay_on_the_ground(
    off_ground: bool, last: str
) -> None:
    owner = begun(
        transition("failed", "second"), refuses=("first", "second"), off_ground=off_ground
    )
    assert last == owner.machine.state
    tried = ["enter first", "exit first: refused", "enter second", "exit second: refused"]
    assert owner.told == [*tried, f"enter {last}"]


def test_what_an_owner_raises_on_entry_comes_out_and_the_machine_goes_on() -> None:
    owner = begun(transition("then", "second"))

    owner.broken = "second"
    with pytest.raises(RuntimeError, match="second is broken"):
        owner.ask(1.0, outcome="done")
    assert owner.machine.state == "second"
    owner.machine.enter_built_in("brake")
    assert owner.told[-2:] == ["exit second: failsafe", "enter brake"]


def chained(*inner: StatePlan) -> Owner:
    """An owner in the first of `inner`, with `out` beside them."""
    back = transition("then", inner[0].name, enters="chain")
    out = StatePlan("out", PART, (AIR >> AIR,), (back,))
    owner = Owner(*inner, out)
    owner.machine.begin()
    return owner


LATE = transition("within", "out", after=10.0, since="chain")


def link(name: str, *leaving: TransitionPlan) -> StatePlan:
    return StatePlan(f"chain.{name}", PART, (AIR >> AIR,), (*leaving, LATE))


def test_a_chain_is_bounded_from_its_entry_on() -> None:
    to_a, to_b = transition("then", "chain.a"), transition("then", "chain.b")
    owner = chained(link("a", to_b), link("b", to_a))
    assert owner.ask(6.0, outcome="done") == "chain.b"
    assert owner.ask(3.9) == "chain.b"
    assert owner.ask(4.0) == "out"
    assert owner.ask(1.0, outcome="done") == "chain.a"
    assert owner.ask(9.9) == "chain.a"


def test_a_chain_that_enters_itself_begins_anew() -> None:
    again = transition("then", "chain.a", enters="chain")
    owner = chained(link("a", transition("then", "chain.b")), link("b", again))
    owner.ask(5.0, outcome="done")
    assert owner.ask(4.0, outcome="done") == "chain.a"
    assert owner.ask(9.9) == "chain.a"


def test_a_state_that_is_asked_for_begins_its_chain_anew() -> None:
    owner = chained(link("a", transition("then", "chain.b")), link("b"))
    owner.ask(5.0)
    owner.machine.switch("chain.b", "")
    assert owner.ask(9.9) == "chain.b"


def flow_machine(*phases: PhasePlan) -> tuple[FlowMachine, list[str]]:
    """The machine of a flow, and what it tells."""
    told: list[str] = []
    by_name = {phase.name: phase for phase in phases}
    machine = FlowMachine(
        FlowPlan(name="team", begin=phases[0].name, vehicles=("a",), phases=by_name),
        lambda expression: lambda: True,
        on_enter=lambda phase: told.append(f"enter {phase}"),
        on_exit=lambda reason: told.append(f"exit: {reason.how}"),
    )
    return machine, told


def phase(name: str, *leaving: TransitionPlan) -> PhasePlan:
    return PhasePlan(name=name, run={}, give={}, options=(), transitions=leaving)


def test_a_flow_goes_through_its_phases_and_may_begin_again() -> None:
    machine, told = flow_machine(phase("up", transition("next", "end", event="go")), phase("down"))
    machine.begin()
    machine.step(0.0, {"go"}, "running", 0.1)
    assert told == ["enter up", "exit: next", "enter end"]
    machine.begin()
    machine.switch("down", "")
    machine.end("operator")
    assert told[3:] == ["enter up", "exit: asked", "enter down", "exit: operator", "enter end"]


def test_a_flow_that_is_over_can_not_end() -> None:
    machine, told = flow_machine(phase("up"))
    with pytest.raises(ValueError, match="no transition `end` leaves `end`"):
        machine.end("done")
    assert not told
