"""The state machines of vehicles and flows: built from the plan, run by the library `transitions`,
which no other module imports.

The library's machine holds the state: it checks that a transition is legal, and calls the owner on
exit from a state and on entry into one. Its triggers are:

- `begin`: enter the first state.
- `step`: take a transition of the mission; the order is `next`, end of the behavior, `within`.
- `give_up`: enter `brake` or `landed`, if the behavior of no other state of a vehicle starts.
- `switch STATE`: enter the state that an operator, a flow or a callback requests.
- `built-in STATE`: enter a built-in state of a vehicle, from every state: the failsafe reacts, or
  the run ends.
- `end`: leave every phase of a flow.

A trigger costs several microseconds. A tick therefore evaluates each guard once, without the
library, and calls the trigger `step` only for a transition that is due. The `Exit` passed to the
trigger names that transition, and the library's conditions compare it with their own. `switch
STATE` is declared at the first request, because declaring it between all pairs of a thousand states
would take a million transitions.

The library adds its methods to a private model, and it is given callables instead of names to
import. The return values of triggers are ignored; the state shows the result. A trigger that is
called on entry into a state runs when the present transition is complete. Chains are states with
dotted names (ADR 6), so the machines are flat.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from collections.abc import Set as AbstractSet
from typing import Literal, NamedTuple

from transitions import Machine

from kybflow.dsl.expressions import Expression
from kybflow.dsl.names import BRAKE, FAULT, LANDED
from kybflow.dsl.plan import END, FlowPlan, TransitionPlan, VehiclePlan
from kybflow.parts.observables import chains_of, is_in

Outcome = Literal["running", "done", "failed"]
Guard = Callable[[], bool]
Conditions = Callable[[Expression], Guard]

_ORDER = {"next": 0, "then": 1, "failed": 1, "within": 2}
_ROUNDING = 1e-9
_START = "(start)"
"""The state of a vehicle's machine before its first state; a mission can't have a state of this
name."""
_NOTHING: frozenset[str] = frozenset()


class Exit(NamedTuple):
    """Why a state is left.

    how: an `ExitName`, or `begin`: `next`, `done`, `failed` or `within` for a transition of the
    mission; `refused` if the behavior did not start; `asked` for a switch; `failsafe` for a
    built-in state that is entered regardless of the mission, also at the end of a run or by a
    reset. Flows also end with `operator` or `failed`. at: the mission line that caused the exit, or
    empty. transition: the transition of the mission, if there is one.
    """

    how: str
    at: str = ""
    transition: TransitionPlan | None = None


class _Model:
    """The object to which `transitions` adds its methods: it sets `state` and adds `trigger`."""

    state: str
    trigger: Callable[[str, Exit], object]


class _Timer:
    """Counts for how many seconds a condition has held since the state was entered. held: that
    time, None while the condition does not hold."""

    __slots__ = ("condition", "held")

    def __init__(self, condition: Guard) -> None:
        self.condition = condition
        self.held: float | None = None

    def restart(self) -> None:
        self.held = None

    def count(self, dt: float) -> None:
        if not self.condition():
            self.held = None
        else:
            self.held = 0.0 if self.held is None else self.held + dt


class _Way(NamedTuple):
    """A transition of the mission. guard: returns whether the transition is due."""

    guard: Guard
    transition: TransitionPlan

    def exit(self) -> Exit:
        cause = self.transition.cause
        how = "done" if cause == "then" else cause
        return Exit(how, self.transition.at, self.transition)


class _Watched(NamedTuple):
    """What a tick evaluates in one state. timers: the timers of its conditions. ways: the
    transitions out of the state, in order. ways_while_running: those that may be due before the
    behavior ends."""

    timers: list[_Timer]
    ways: list[_Way]
    ways_while_running: list[_Way]


class StateMachine:
    """The base of the machines of vehicles and flows.

    The guards of its transitions read elapsed: seconds in the active state; chains: seconds spent
    in each chain that contains the state, up to the entry into the state; heard: the events since
    the last tick; outcome: whether the behavior is running, done or failed.

    The machine is in the state `initial` until it begins. on_exit: called before the state changes.
    on_enter: called with the name of the new state. welcome: returns whether a state may be entered
    through `next`; otherwise that transition is skipped.
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
        self.elapsed = 0.0
        self.chains: dict[str, float] = {}
        self.heard: AbstractSet[str] = _NOTHING
        self.outcome: Outcome = "running"
        self._model = _Model()
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

        Called once a tick. elapsed: seconds in the state. heard: the events since the last tick.
        outcome: whether the behavior is running, done or failed. dt: seconds since the last call.
        """
        self.elapsed, self.heard, self.outcome = elapsed, heard, outcome
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
        """Call a trigger. Raises ValueError if none of its transitions leaves the active state."""
        if trigger not in self._machine.get_triggers(self.state):
            raise ValueError(f"no transition `{trigger}` leaves `{self.state}`")
        self._model.trigger(trigger, reason)

    def _exited(self, reason: Exit) -> None:
        """Add the time in the state to that of the chains around it. The count continues only after
        a transition of the mission that does not re-enter the chain."""
        taken = reason.transition
        self.chains = {
            chain: seconds + self.elapsed
            for chain, seconds in self.chains.items()
            if taken is not None and not (taken.enters and is_in(chain, taken.enters))
        }
        self._on_exit(reason)

    def _entered(self, _: Exit) -> None:
        """Restart the timers of the new state and report the entry to the owner."""
        name = self.state
        self.chains = {chain: self.chains.get(chain, 0.0) for chain in chains_of(name)}
        self._watch(name)
        for timer in self._timers:
            timer.restart()
        self._on_enter(name)

    def _watch(self, name: str) -> None:
        self._timers, self._ways, self._ways_while_running = self._watched[name]

    def _declare_ways(
        self, state: str, leaving: Sequence[TransitionPlan], conditions: Conditions
    ) -> None:
        """Declare the mission's transitions out of a state. Their guards are evaluated in order
        while the state is active."""
        timers, ways, while_running = self._watched[state]
        for transition in sorted(leaving, key=lambda t: _ORDER[t.cause]):
            way = _Way(_guard(transition, self, conditions, timers), transition)
            ways.append(way)
            if transition.cause in ("next", "within"):
                while_running.append(way)
            self._machine.add_transition("step", state, transition.target, _is_due(transition))

    def _switch(self, state: str, at: str, *conditions: Callable[[Exit], bool]) -> None:
        """Call the trigger `switch STATE`, which is declared at the first request."""
        trigger = f"switch {state}"
        if not self._machine.get_transitions(trigger, self.state):
            self._machine.add_transition(trigger, self.state, state, [*conditions])
        self._pull(trigger, Exit("asked", at))


class VehicleMachine(StateMachine):
    """The machine of one vehicle, whose owner builds a behavior on entry into each state.

    starts: builds the behavior of a requested state before the present state is left; if it raises,
    nothing changes. off_ground: decides between `brake` and `landed` if a behavior did not start
    and no transition leads elsewhere. latched: returns whether the failsafe is latched; if so, a
    transition to `landed` leads to `fault` instead.
    """

    def __init__(
        self,
        vehicle: VehiclePlan,
        conditions: Conditions,
        on_enter: Callable[[str], None],
        on_exit: Callable[[Exit], None],
        starts: Callable[[str], bool],
        off_ground: Callable[[], bool],
        latched: Callable[[], bool],
        welcome: Callable[[str], bool] = lambda _: True,
    ) -> None:
        states = vehicle.states
        super().__init__(_START, states, on_enter, on_exit, welcome)
        self._healthy, self._starts = states.keys() - {FAULT}, starts
        declare = self._machine.add_transition

        def rests_in_fault(reason: Exit) -> bool:
            return reason.how != "refused" and latched()

        declare("begin", _START, vehicle.begin)
        for name, state in states.items():
            for landing in (t for t in state.transitions if t.target == LANDED):
                declare("step", name, FAULT, [_is_due(landing), rests_in_fault])
            self._declare_ways(name, state.transitions, conditions)
            if state.built_in:
                declare(f"built-in {name}", list(states), name)
        declare("give_up", list(states), BRAKE, lambda _: off_ground())
        declare("give_up", list(states), LANDED)

    def enter_built_in(self, state: str) -> None:
        """Enter a built-in state, from any state, regardless of the mission. Raises ValueError for
        a state that is not built in."""
        self._pull(f"built-in {state}", Exit("failsafe"))

    def switch(self, state: str, at: str) -> None:
        """Enter a state that was requested at a line of the mission. Passes on what `starts`
        raises; raises ValueError if the state can't be requested now."""
        if not {state, self.state} <= self._healthy:
            raise ValueError(f"no transition `switch {state}` leaves `{self.state}`")
        self._switch(state, at, lambda _: self._starts(state))

    def refuse(self, refused: AbstractSet[str]) -> None:
        """Leave a state whose behavior did not start, as if the behavior had failed at once.
        refused: the states whose behavior has not started; they are not entered unless `give_up`
        leads there."""
        self.elapsed, self.heard, self.outcome = 0.0, _NOTHING, "failed"
        for way in self._ways:
            if way.guard() and self._may_enter(way.transition, refused):
                self._pull("step", Exit("refused", transition=way.transition))
                return
        self._pull("give_up", Exit("refused"))


class FlowMachine(StateMachine):
    """The machine of one flow. Its states are the phases; it is in the state `end` before the first
    and after the last."""

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
        """End the flow. Raises ValueError if it has not begun."""
        self._pull("end", Exit(how))


def _is_due(transition: TransitionPlan) -> Callable[[Exit], bool]:
    return lambda reason: reason.transition is transition


def _guard(
    transition: TransitionPlan, machine: StateMachine, conditions: Conditions, timers: list[_Timer]
) -> Guard:
    """Return a guard that is true when everything that the transition requires holds; it is never
    true if nothing is required."""
    if transition.cause == "then":
        return lambda: machine.outcome == "done"
    if transition.cause == "failed":
        return lambda: machine.outcome == "failed"
    guards: list[Guard] = []
    if transition.after is not None:
        after, chain = transition.after - _ROUNDING, transition.since
        if chain:
            guards.append(lambda: machine.chains.get(chain, 0.0) + machine.elapsed >= after)
        else:
            guards.append(lambda: machine.elapsed >= after)
    if transition.event is not None:
        event = transition.event
        guards.append(lambda: event in machine.heard)
    if transition.when is not None:
        condition = conditions(transition.when)
        if transition.hold <= 0.0:
            guards.append(condition)
        else:
            timer, needed = _Timer(condition), transition.hold - _ROUNDING
            timers.append(timer)
            guards.append(lambda: timer.held is not None and timer.held >= needed)
    if len(guards) == 1:
        return guards[0]
    return (lambda: all(guard() for guard in guards)) if guards else lambda: False
