"""The state machines of vehicles and flows: built from the plan, run by `transitions`, which no
other file imports.

The library's machine owns the state: it checks that a transition is legal, and calls the owner on
exit from a state and on entry into one. Its triggers are:

- `begin`: into the first state.
- `step`: the mission's transitions, in the order `next`, end of the behavior, `within`.
- `give_up`: to `brake` or `landed`, when no other state of a vehicle would start.
- `switch STATE`: into the state that a person, a flow or a callback requests.
- `failsafe STATE`: into a built-in state of a vehicle, from every state.
- `end`: out of every phase of a flow.

A trigger costs several microseconds, so a tick evaluates each guard itself, once, and pulls `step`
only for a transition that is due. The `Exit` that it passes names that transition, and the
library's conditions compare it.
`switch STATE` is declared at the first request: a transition between every two states would
be a million for a thousand states.

The library puts its methods on a private model and is given callables, no names to import. What its
triggers return is not read: the state tells. A trigger that is pulled on entry runs when the
transition that is under way is complete. Chains are states with dotted names (ADR 6), so that the
machines are flat.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
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
_START = "(start)"
"""Where a vehicle's machine is before its first state; a mission can't name a state like this."""
_NOTHING: frozenset[str] = frozenset()


class Exit(NamedTuple):
    """Why a state is left.

    `how` is `next`, `done`, `failed` or `within` for a transition of the mission, `refused` when
    the behavior would not start, `asked` for a switch, and `failsafe`; flows also end because of an
    `operator` or because they `failed`. `at` is the mission line that led to it.
    """

    how: str
    at: str = ""
    transition: TransitionPlan | None = None


class _Model:
    """What `transitions` puts its methods on: it sets `state` and adds `trigger`."""

    state: str
    trigger: Callable[[str, Exit], object]


class _Facts:
    """The values that guards read.

    `elapsed` counts seconds in the state, `chains` seconds in each chain around it until the state
    was entered. `heard` holds the events since the last tick.
    """

    __slots__ = ("chains", "elapsed", "heard", "outcome")

    def __init__(self) -> None:
        self.elapsed = 0.0
        self.chains: dict[str, float] = {}
        self.heard: AbstractSet[str] = _NOTHING
        self.outcome: Outcome = "running"


class _Timer:
    """Counts the seconds for which a condition has held since the state was entered; `held` is
    None while the condition does not hold."""

    __slots__ = ("condition", "held")

    def __init__(self, condition: Guard) -> None:
        self.condition = condition
        self.held: float | None = None

    def count(self, dt: float) -> None:
        if not self.condition():
            self.held = None
        else:
            self.held = 0.0 if self.held is None else self.held + dt


class _Way(NamedTuple):
    """A transition of the mission, and the guard that is open when it is due."""

    guard: Guard
    transition: TransitionPlan

    def exit(self) -> Exit:
        cause = self.transition.cause
        how = "done" if cause == "then" else cause
        return Exit(how, self.transition.at, self.transition)


class _Watched(NamedTuple):
    """What a tick evaluates in one state: its timers, the ways out in order, and those among them
    that may open before the behavior ends."""

    timers: list[_Timer]
    ways: list[_Way]
    ways_while_running: list[_Way]


class StateMachine:
    """The base of the machines of vehicles and flows.

    The machine waits in `initial` until it begins. `on_exit` is called while the state is still the
    one that is left, `on_enter` with the name of the state that was entered. A `next` that is open
    leads nowhere while its target is not `welcome`.
    """

    def __init__(
        self,
        initial: str,
        states: Iterable[str],
        on_enter: Callable[[str], None],
        on_exit: Callable[[Exit], None],
        welcome: Callable[[str], bool] = lambda _: True,
    ) -> None:
        self._on_enter, self._on_exit, self._welcome = on_enter, on_exit, welcome
        self._facts, self._model = _Facts(), _Model()
        self._watched = {name: _Watched([], [], []) for name in (initial, *states)}
        self._machine = Machine(None, initial=initial, auto_transitions=False, queued=True)
        self._machine.get_state(initial).add_callback("enter", self._entered)
        self._machine.add_states(list(states), on_enter=[self._entered], on_exit=[self._exited])
        self._machine.add_model(self._model)
        self._watch(initial)

    @property
    def state(self) -> str:
        """The name of the active state."""
        return self._model.state

    def begin(self) -> None:
        """Enter the first state."""
        self._pull("begin", Exit("begin"))

    def step(self, elapsed: float, heard: AbstractSet[str], outcome: Outcome, dt: float) -> None:
        """Take the first transition that is due: `next` from the top, then the behavior's end, then
        `within`.

        Called once a tick: `elapsed` seconds in the state, the events `heard` since the last tick,
        how the behavior stands, and `dt` seconds since the last call.
        """
        facts = self._facts
        facts.elapsed, facts.heard, facts.outcome = elapsed, heard, outcome
        for timer in self._timers:
            timer.count(dt)
        for way in self._ways_while_running if outcome == "running" else self._ways:
            if way.guard() and self._may_enter(way.transition):
                self._pull("step", way.exit())
                return

    def _may_enter(self, transition: TransitionPlan, refused: AbstractSet[str] = _NOTHING) -> bool:
        target = transition.target
        return target not in refused and (transition.cause != "next" or self._welcome(target))

    def _pull(self, trigger: str, reason: Exit) -> None:
        """Pull a trigger. Raises ValueError where no transition of it leaves the active state."""
        if trigger not in self._machine.get_triggers(self.state):
            raise ValueError(f"no transition `{trigger}` leaves `{self.state}`")
        self._model.trigger(trigger, reason)

    def _exited(self, reason: Exit) -> None:
        """Add up the time in the chains around the state; only the mission's transitions let it go
        on, and not those that enter the chain anew."""
        taken, facts = reason.transition, self._facts
        facts.chains = {
            chain: seconds + facts.elapsed
            for chain, seconds in facts.chains.items()
            if taken is not None and not (taken.enters and is_in(chain, taken.enters))
        }
        self._on_exit(reason)

    def _entered(self, _: Exit) -> None:
        """Start the timers of the state that was entered."""
        facts, name = self._facts, self.state
        facts.chains = {chain: facts.chains.get(chain, 0.0) for chain in chains_of(name)}
        self._watch(name)
        for timer in self._timers:
            timer.held = None
        self._on_enter(name)

    def _watch(self, name: str) -> None:
        self._timers, self._ways, self._ways_while_running = self._watched[name]

    def _declare_ways(
        self, state: str, leaving: Sequence[TransitionPlan], conditions: Conditions
    ) -> None:
        """Declare the mission's transitions out of a state, whose guards are asked in order while
        the state is active."""
        timers, ways, while_running = self._watched[state]
        for transition in sorted(leaving, key=lambda t: _ORDER[t.cause]):
            way = _Way(_guard(transition, self._facts, conditions, timers), transition)
            ways.append(way)
            if transition.cause in ("next", "within"):
                while_running.append(way)
            self._machine.add_transition("step", state, transition.target, _is_due(transition))

    def _switch(self, state: str, at: str, *conditions: Callable[[Exit], bool]) -> None:
        """Pull `switch STATE`, which is declared at the first request."""
        trigger = f"switch {state}"
        if not self._machine.get_transitions(trigger, self.state):
            self._machine.add_transition(trigger, self.state, state, [*conditions])
        self._pull(trigger, Exit("asked", at))


class VehicleMachine(StateMachine):
    """The machine of one vehicle, whose owner builds a behavior on entry into each state.

    `starts` builds the behavior of a requested state before the present one is left; when it
    raises, nothing changes. `airborne` decides between `brake` and `landed` for a vehicle whose
    behavior would not start and whose state has no other way out. While its failsafe has `latched`
    it enters `fault` in place of `landed` when it steps.
    """

    def __init__(
        self,
        vehicle: VehiclePlan,
        conditions: Conditions,
        on_enter: Callable[[str], None],
        on_exit: Callable[[Exit], None],
        starts: Callable[[str], bool],
        airborne: Callable[[], bool],
        latched: Callable[[], bool],
        welcome: Callable[[str], bool] = lambda _: True,
    ) -> None:
        states = vehicle.states
        super().__init__(_START, states, on_enter, on_exit, welcome)
        self._healthy, self._starts = states.keys() - {"fault"}, starts
        declare = self._machine.add_transition

        def rests_in_fault(reason: Exit) -> bool:
            return reason.how != "refused" and latched()

        declare("begin", _START, vehicle.begin)
        for name, state in states.items():
            for landing in (t for t in state.transitions if t.target == "landed"):
                declare("step", name, "fault", [_is_due(landing), rests_in_fault])
            self._declare_ways(name, state.transitions, conditions)
            if state.built_in:
                declare(f"failsafe {name}", list(states), name)
        declare("give_up", list(states), "brake", lambda _: airborne())
        declare("give_up", list(states), "landed")

    def failsafe(self, state: str) -> None:
        """Enter a built-in state from wherever the vehicle is. Raises ValueError for another."""
        self._pull(f"failsafe {state}", Exit("failsafe"))

    def switch(self, state: str, at: str) -> None:
        """Enter a state that was requested at a line of the mission. Raises what `starts` raises,
        and ValueError for a state that can't be requested."""
        if not {state, self.state} <= self._healthy:
            raise ValueError(f"no transition `switch {state}` leaves `{self.state}`")
        self._switch(state, at, lambda _: self._starts(state))

    def refuse(self, refused: AbstractSet[str]) -> None:
        """Leave a state whose behavior has refused to start: as if it had failed at once, but to no
        state that has `refused` already, unless it is the last way out."""
        facts = self._facts
        facts.elapsed, facts.heard, facts.outcome = 0.0, _NOTHING, "failed"
        for way in self._ways:
            if way.guard() and self._may_enter(way.transition, refused):
                self._pull("step", Exit("refused", transition=way.transition))
                return
        self._pull("give_up", Exit("refused"))


class FlowMachine(StateMachine):
    """The machine of one flow, whose states are its phases, and `end` before and after them."""

    def __init__(
        self,
        flow: FlowPlan,
        conditions: Conditions,
        on_enter: Callable[[str], None],
        on_exit: Callable[[Exit], None],
    ) -> None:
        super().__init__(END, flow.phases, on_enter, on_exit)
        for phase in flow.phases.values():
            self._declare_ways(phase.name, phase.transitions, conditions)
        self._machine.add_transition("begin", END, flow.begin)
        self._machine.add_transition("end", list(flow.phases), END)

    def switch(self, phase: str, at: str) -> None:
        """Enter a phase that was requested at a line of the mission."""
        self._switch(phase, at)

    def end(self, how: str) -> None:
        """End the flow. Raises ValueError for one that has not begun."""
        self._pull("end", Exit(how))


def _is_due(transition: TransitionPlan) -> Callable[[Exit], bool]:
    return lambda reason: reason.transition is transition


def _guard(
    transition: TransitionPlan, facts: _Facts, conditions: Conditions, timers: list[_Timer]
) -> Guard:
    """Open when all that the transition requires holds; never without a requirement."""
    if transition.cause == "then":
        return lambda: facts.outcome == "done"
    if transition.cause == "failed":
        return lambda: facts.outcome == "failed"
    guards: list[Guard] = []
    if transition.after is not None:
        after, chain = transition.after - _ROUNDING, transition.since
        if chain:
            guards.append(lambda: facts.chains.get(chain, 0.0) + facts.elapsed >= after)
        else:
            guards.append(lambda: facts.elapsed >= after)
    if transition.event is not None:
        event = transition.event
        guards.append(lambda: event in facts.heard)
    if transition.when is not None:
        condition = conditions(transition.when)
        guards.append(condition if transition.hold <= 0.0 else _held(condition, transition, timers))
    if len(guards) == 1:
        return guards[0]
    return (lambda: all(guard() for guard in guards)) if guards else lambda: False


def _held(condition: Guard, transition: TransitionPlan, timers: list[_Timer]) -> Guard:
    timer, needed = _Timer(condition), transition.hold - _ROUNDING
    timers.append(timer)
    return lambda: timer.held is not None and timer.held >= needed
