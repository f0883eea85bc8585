"""The state machine of a vehicle, and of a flow, built with `transitions` from the plan: the only
import of it.

Each arrow of the plan is a trigger of its own whose condition is the arrow's guard: that its `when`
has held, its event is heard, its time has passed, its behavior has ended. `due` asks the guards
without `transitions`, because that is done in every tick; `fire` goes through it.

`transitions` puts its methods on a private model, resolves no callback by name, and what its
triggers return is not read: the state tells.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import Literal, NamedTuple

from transitions import Machine

from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import END, FlowPlan, TransitionPlan, VehiclePlan
from kybflow.parts.observables import chains_of, is_in

Outcome = Literal["running", "done", "failed"]
Guard = Callable[[], bool]
Conditions = Callable[[Expression], Guard]

_ORDER = {"next": 0, "then": 1, "failed": 1, "within": 2}
_ROUNDING = 1e-9


class _Model:
    """What `transitions` may put its methods on; it sets `state` and gives `trigger`."""

    state: str
    trigger: Callable[[str], object]


class _Facts:
    """What the arrows of this tick are judged by."""

    __slots__ = ("elapsed", "heard", "outcome")

    def __init__(self) -> None:
        self.elapsed = 0.0
        self.heard: AbstractSet[str] = frozenset()
        self.outcome: Outcome = "running"


class _Timer:
    """For how long a condition has held since the state was entered; `held` None: it does not."""

    __slots__ = ("condition", "held")

    def __init__(self, condition: Guard) -> None:
        self.condition = condition
        self.held: float | None = None

    def count(self, dt: float) -> None:
        if not self.condition():
            self.held = None
        else:
            self.held = 0.0 if self.held is None else self.held + dt


class _Arrow(NamedTuple):
    guard: Guard
    transition: TransitionPlan
    trigger: str


Arrows = Mapping[str, Sequence[TransitionPlan]]
"""The arrows out of each state."""


class StateMachine:
    """A machine in the state `begin`. `conditions` turns an expression of the plan into a function
    of nothing."""

    def __init__(self, arrows: Arrows, begin: str, conditions: Conditions) -> None:
        self._conditions = conditions
        self._facts = _Facts()
        self._timers: dict[str, list[_Timer]] = {name: [] for name in arrows}
        self._arrows = {name: self._arrows_of(name, leaving) for name, leaving in arrows.items()}
        self._arrows_while_running = {
            name: tuple(a for a in arrows if a.transition.cause in ("next", "within"))
            for name, arrows in self._arrows.items()
        }
        self._spent: dict[str, float] = {}
        self._model = _Model()
        self._machine = _assembled(begin, self._arrows, self._model)
        self._enter("")

    @property
    def state(self) -> str:
        """The name of the active state."""
        return self._name

    def due(
        self, elapsed: float, heard: AbstractSet[str], outcome: Outcome, dt: float
    ) -> TransitionPlan | None:
        """The arrow to take now: `next` from the top, then the behavior's end, then `within`.

        Asked once a tick: `elapsed` seconds in the state, the events `heard` since the last tick,
        how the behavior stands, and `dt` seconds since the last question.
        """
        facts = self._facts
        facts.elapsed, facts.heard, facts.outcome = elapsed, heard, outcome
        for timer in self._active_timers:
            timer.count(dt)
        for guard, transition, _ in self._running if outcome == "running" else self._active_arrows:
            if guard():
                return transition
        return None

    def fire(self, transition: TransitionPlan) -> None:
        """Take an arrow that `due` gave in this tick. Raises ValueError for one that is not due."""
        for arrow in self._active_arrows:
            if arrow.transition is transition and arrow.guard():
                left, elapsed = self._name, self._facts.elapsed
                self._model.trigger(arrow.trigger)
                self._enter(left, elapsed, transition.enters)
                return
        raise ValueError(f"no arrow from `{self.state}` to `{transition.target}` is due")

    def force(self, state: str) -> None:
        """Enter a state from wherever the vehicle is: the failsafe's way, and that of a wish."""
        self._machine.set_state(state, self._model)
        self._enter("")

    def _enter(self, left: str, elapsed: float = 0.0, anew: str = "") -> None:
        """Take note of the state that was entered. The time of a chain in which `left` was too,
        for `elapsed` seconds, goes on, unless an arrow enters it `anew`."""
        self._name = self._model.state
        self._spent = {
            chain: self._spent.get(chain, 0.0) + elapsed
            if is_in(left, chain) and not (anew and is_in(chain, anew))
            else 0.0
            for chain in chains_of(self._name)
        }
        self._active_arrows = self._arrows[self._name]
        self._running = self._arrows_while_running[self._name]
        self._active_timers = self._timers[self._name]
        for timer in self._active_timers:
            timer.held = None

    def _arrows_of(self, state: str, leaving: Sequence[TransitionPlan]) -> tuple[_Arrow, ...]:
        ordered = sorted(leaving, key=lambda t: _ORDER[t.cause])
        return tuple(
            _Arrow(self._guard(state, arrow), arrow, f"{state} arrow {index}")
            for index, arrow in enumerate(ordered)
        )

    def _guard(self, state: str, arrow: TransitionPlan) -> Guard:
        facts = self._facts
        if arrow.cause == "then":
            return lambda: facts.outcome == "done"
        if arrow.cause == "failed":
            return lambda: facts.outcome == "failed"
        return _all(list(self._requirements(state, arrow)))

    def _requirements(self, state: str, arrow: TransitionPlan) -> Iterable[Guard]:
        facts = self._facts
        if arrow.after is not None:
            yield self._time(arrow.after - _ROUNDING, arrow.since)
        if arrow.event is not None:
            event = arrow.event
            yield lambda: event in facts.heard
        if arrow.when is not None:
            yield self._when(state, arrow.when, arrow.hold)

    def _time(self, after: float, chain: str) -> Guard:
        facts = self._facts
        if not chain:
            return lambda: facts.elapsed >= after
        return lambda: self._spent.get(chain, 0.0) + facts.elapsed >= after

    def _when(self, state: str, when: Expression, hold: float) -> Guard:
        condition = self._conditions(when)
        if hold <= 0.0:
            return condition
        timer = _Timer(condition)
        self._timers[state].append(timer)
        needed = hold - _ROUNDING
        return lambda: timer.held is not None and timer.held >= needed


class VehicleMachine(StateMachine):
    """The machine of one vehicle, in its first state."""

    def __init__(self, vehicle: VehiclePlan, conditions: Conditions) -> None:
        arrows = {state.name: state.transitions for state in vehicle.states.values()}
        super().__init__(arrows, vehicle.begin, conditions)


class FlowMachine(StateMachine):
    """The machine of one flow, whose states are its phases and `end`, in its first phase."""

    def __init__(self, flow: FlowPlan, conditions: Conditions) -> None:
        phases = {phase.name: phase.transitions for phase in flow.phases.values()}
        super().__init__({**phases, END: ()}, flow.begin, conditions)


def _assembled(begin: str, arrows: dict[str, tuple[_Arrow, ...]], model: _Model) -> Machine:
    machine = Machine(
        model=model,
        states=list(arrows),
        initial=begin,
        auto_transitions=False,
        send_event=False,
    )
    for state, leaving in arrows.items():
        for arrow in leaving:
            target = arrow.transition.target
            machine.add_transition(arrow.trigger, state, target, conditions=[arrow.guard])
    return machine


def _all(guards: list[Guard]) -> Guard:
    """Every guard open; with none of them, never."""
    if len(guards) == 1:
        return guards[0]
    if not guards:
        return lambda: False
    return lambda: all(guard() for guard in guards)
