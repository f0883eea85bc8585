"""The state machines of vehicles and flows: built from the plan, run by `transitions`, which no
other file imports.

The library's machine owns the state. It knows every legal transition, picks the one that is taken,
and calls the owner on exit from a state and on entry into one. Its triggers are:

- `begin`: into the first state.
- `step`: the mission's transitions, in the order `next`, end of the behavior, `within`. The guard
  of each is its condition: that its `when` has held, its event was heard, its time has passed, its
  behavior has ended. A vehicle whose behavior would not start steps too, at last to `brake` or
  `landed`.
- `switch STATE`: what a person, a flow or a callback asks for.
- `failsafe STATE`: into a built-in state of a vehicle, from every state.
- `end`: out of every phase of a flow.

A trigger costs several microseconds, so a tick pulls `step` only when a guard is open.

The library puts its methods on a private model and is given callables, no names to import. What its
triggers return is not read: the state tells. A trigger that is pulled on entry runs when the
transition that is under way is complete. Chains are states with dotted names (ADR 6), so that the
machines are flat.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from functools import partial
from typing import Literal, NamedTuple

from transitions import EventData, Machine, Transition
from transitions.core import Condition

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


_STEP = Exit("step")
"""What stands for the reason until a transition of the mission is taken, which has its own."""
_REFUSED = Exit("refused")


class _Model:
    """What `transitions` puts its methods on: it sets `state` and adds `trigger`."""

    state: str
    trigger: Callable[[str], object]


class _Facts:
    """What guards are judged by.

    `elapsed` counts seconds in the state, `chains` seconds in each chain around it until the state
    was entered. `heard` holds the events since the last tick, `refused` the states that would not
    start just now.
    """

    __slots__ = ("chains", "elapsed", "heard", "outcome", "refused")

    def __init__(self) -> None:
        self.elapsed = 0.0
        self.chains: dict[str, float] = {}
        self.heard: AbstractSet[str] = _NOTHING
        self.outcome: Outcome = "running"
        self.refused: AbstractSet[str] = _NOTHING


class _Timer:
    """For how many seconds a condition has held since the state was entered; `held` is None while
    it does not hold."""

    __slots__ = ("condition", "held")

    def __init__(self, condition: Guard) -> None:
        self.condition = condition
        self.held: float | None = None

    def count(self, dt: float) -> None:
        if not self.condition():
            self.held = None
        else:
            self.held = 0.0 if self.held is None else self.held + dt


class _Watched(NamedTuple):
    """What a tick looks at in one state: its timers, the guards of its transitions, and those
    guards among them that may open before the behavior ends."""

    timers: list[_Timer]
    guards: list[Guard]
    while_running: list[Guard]


class _FromAnyState(Transition):
    """A transition that leaves many states; its source is the state that the machine is in."""

    def __init__(self, target: str, *guards: Guard) -> None:
        super().__init__("", target)
        self.conditions.extend(Condition(guard) for guard in guards)

    def execute(self, event_data: EventData) -> bool:
        self.source = event_data.state.name
        return bool(super().execute(event_data))


class _FromEach(Mapping[str, list[Transition]]):
    """The transitions of one trigger where each of `states` has the same: they are kept once, since
    a transition between every two states would be a million for a thousand states."""

    def __init__(self, states: Collection[str], transitions: list[Transition]) -> None:
        self._states, self._transitions = states, transitions

    def __getitem__(self, state: str) -> list[Transition]:
        if state not in self._states:
            raise KeyError(state)
        return self._transitions

    def __iter__(self) -> Iterator[str]:
        return iter(self._states)

    def __len__(self) -> int:
        return len(self._states)


class StateMachine:
    """What the machines of vehicles and flows share.

    The machine waits in `initial` until it begins. `on_exit` is called while the state is still the
    one that is left, `on_enter` with the name of the state that was entered.
    """

    def __init__(
        self,
        initial: str,
        states: Iterable[str],
        on_enter: Callable[[str], None],
        on_exit: Callable[[Exit], None],
    ) -> None:
        self._on_enter, self._on_exit = on_enter, on_exit
        self._facts, self._reason = _Facts(), Exit("")
        self._watched = {name: _Watched([], [], []) for name in (initial, *states)}
        self._model = _Model()
        self._machine = Machine(None, initial=initial, auto_transitions=False, queued=True)
        self._machine.get_state(initial).add_callback("enter", self._entered)
        self._machine.add_states(list(states), on_enter=[self._entered], on_exit=[self._exited])
        self._machine.add_transition("step", [], initial)
        self._machine.add_model(self._model)
        self._watch(initial)

    @property
    def state(self) -> str:
        """The name of the active state."""
        return self._model.state

    @property
    def triggers(self) -> list[str]:
        """The triggers for which the active state has a transition."""
        return list(self._machine.get_triggers(self._model.state))

    def begin(self) -> None:
        """Enter the first state."""
        self._pull("begin")

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
        for guard in self._guards_while_running if outcome == "running" else self._guards:
            if guard():
                facts.refused = _NOTHING
                self._pull("step")
                return

    def _pull(self, trigger: str, reason: Exit = _STEP) -> None:
        """Pull a trigger. Raises ValueError where no transition of it leaves the active state."""
        if trigger not in self.triggers:
            raise ValueError(f"no transition `{trigger}` leaves `{self.state}`")
        self._reason = reason
        self._model.trigger(trigger)

    def _exited(self) -> None:
        """Add up the time in the chains around the state; only the mission's transitions let it go
        on, and not those that enter the chain anew."""
        taken, facts = self._reason.transition, self._facts
        facts.chains = {
            chain: seconds + facts.elapsed
            for chain, seconds in facts.chains.items()
            if taken is not None and not (taken.enters and is_in(chain, taken.enters))
        }
        self._on_exit(self._reason)

    def _entered(self) -> None:
        """Start the timers of the state that was entered."""
        facts, name = self._facts, self._model.state
        facts.chains = {chain: facts.chains.get(chain, 0.0) for chain in chains_of(name)}
        self._watch(name)
        for timer in self._timers:
            timer.held = None
        self._on_enter(name)

    def _watch(self, name: str) -> None:
        self._timers, self._guards, self._guards_while_running = self._watched[name]

    def _guarded(
        self, state: str, leaving: Sequence[TransitionPlan], conditions: Conditions
    ) -> Iterator[tuple[TransitionPlan, Guard]]:
        """The mission's transitions out of a state, in order, each with its guard, which is watched
        while the state is active."""
        timers, guards, while_running = self._watched[state]
        for transition in sorted(leaving, key=lambda t: _ORDER[t.cause]):
            guard = _guard(transition, self._facts, conditions, timers)
            guards.append(guard)
            if transition.cause in ("next", "within"):
                while_running.append(guard)
            yield transition, guard

    def _declare(
        self, source: str, target: str, transition: TransitionPlan, *guards: Guard
    ) -> None:
        """Declare a transition of the mission. The machine takes the first whose guards are all
        open."""
        taken = partial(self._taken, transition)
        self._machine.add_transition("step", source, target, [*guards], before=[taken])

    def _taken(self, transition: TransitionPlan) -> None:
        if self._reason is _REFUSED:
            self._reason = _REFUSED._replace(transition=transition)
        else:
            how = "done" if transition.cause == "then" else transition.cause
            self._reason = Exit(how, transition.at, transition)

    def _declare_from(
        self, states: Collection[str], trigger: str, target: str, *guards: Guard
    ) -> None:
        """Declare one transition that leaves each of `states` by a trigger of its own."""
        self._machine.add_transition(trigger, [], target)
        leaving = _FromEach(states, [_FromAnyState(target, *guards)])
        self._machine.events[trigger].transitions = leaving  # type: ignore[assignment]


class VehicleMachine(StateMachine):
    """The machine of one vehicle, whose owner builds a behavior on entry into each state.

    `starts` builds the behavior of a state that is asked for before anything is left; what it
    raises leaves all as it was. `airborne` decides between `brake` and `landed` for a vehicle whose
    behavior would not start and whose state has no other way out. While its failsafe has `latched`
    it enters `fault` in place of `landed` when it steps. A `next` that is open leads nowhere while
    its target is not `welcome`.
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
        super().__init__(_START, states, on_enter, on_exit)
        self._machine.add_transition("begin", _START, vehicle.begin)
        last_way_out = [
            _FromAnyState("brake", self._has_refused, airborne),
            _FromAnyState("landed", self._has_refused),
        ]
        for name, state in states.items():
            for transition, guard in self._guarded(name, state.transitions, conditions):
                target = transition.target
                if target == "landed":
                    self._declare(name, "fault", transition, guard, latched, self._has_started)
                guards: list[Guard] = [guard, partial(self._may_enter, target)]
                guards += [partial(welcome, target)] if transition.cause == "next" else []
                self._declare(name, target, transition, *guards)
            self._machine.events["step"].transitions[name].extend(last_way_out)
        healthy = states.keys() - {"fault"}
        for name in states:
            if name in healthy:
                self._declare_from(healthy, f"switch {name}", name, partial(starts, name))
            if states[name].built_in:
                self._declare_from(states, f"failsafe {name}", name)

    def failsafe(self, state: str) -> None:
        """Enter a built-in state from wherever the vehicle is. Raises ValueError for another."""
        self._pull(f"failsafe {state}", Exit("failsafe"))

    def switch(self, state: str, at: str) -> None:
        """Enter a state that somebody asked for at a line of the mission. Raises what `starts`
        raises, and ValueError for a state that can't be asked for."""
        self._pull(f"switch {state}", Exit("asked", at))

    def refuse(self, refused: AbstractSet[str]) -> None:
        """Leave a state whose behavior has refused to start: as if it had failed at once, but to no
        state that has `refused` already, unless it is the last way out."""
        facts = self._facts
        facts.elapsed, facts.heard, facts.outcome = 0.0, _NOTHING, "failed"
        facts.refused = refused
        self._pull("step", _REFUSED)

    def _has_started(self) -> bool:
        return not self._facts.refused

    def _has_refused(self) -> bool:
        return bool(self._facts.refused)

    def _may_enter(self, state: str) -> bool:
        return state not in self._facts.refused


class FlowMachine(StateMachine):
    """The machine of one flow, whose states are its phases, and `end` before and after them."""

    def __init__(
        self,
        flow: FlowPlan,
        conditions: Conditions,
        on_enter: Callable[[str], None],
        on_exit: Callable[[Exit], None],
    ) -> None:
        phases = flow.phases
        super().__init__(END, phases, on_enter, on_exit)
        for phase in phases.values():
            for transition, guard in self._guarded(phase.name, phase.transitions, conditions):
                self._declare(phase.name, transition.target, transition, guard)
        self._machine.add_transition("begin", END, flow.begin)
        self._declare_from(phases, "end", END)
        for name in phases:
            self._declare_from((END, *phases), f"switch {name}", name)

    def switch(self, phase: str, at: str) -> None:
        """Enter a phase that somebody asked for at a line of the mission."""
        self._pull(f"switch {phase}", Exit("asked", at))

    def end(self, how: str) -> None:
        """End the flow. Raises ValueError for one that has not begun."""
        self._pull("end", Exit(how))


def _guard(
    transition: TransitionPlan, facts: _Facts, conditions: Conditions, timers: list[_Timer]
) -> Guard:
    if transition.cause == "then":
        return lambda: facts.outcome == "done"
    if transition.cause == "failed":
        return lambda: facts.outcome == "failed"
    return _all(list(_requirements(transition, facts, conditions, timers)))


def _requirements(
    transition: TransitionPlan, facts: _Facts, conditions: Conditions, timers: list[_Timer]
) -> Iterator[Guard]:
    if transition.after is not None:
        yield _time(transition.after - _ROUNDING, transition.since, facts)
    if transition.event is not None:
        event = transition.event
        yield lambda: event in facts.heard
    if transition.when is not None:
        yield _when(conditions(transition.when), transition.hold, timers)


def _time(after: float, chain: str, facts: _Facts) -> Guard:
    if not chain:
        return lambda: facts.elapsed >= after
    return lambda: facts.chains.get(chain, 0.0) + facts.elapsed >= after


def _when(condition: Guard, hold: float, timers: list[_Timer]) -> Guard:
    if hold <= 0.0:
        return condition
    timer = _Timer(condition)
    timers.append(timer)
    needed = hold - _ROUNDING
    return lambda: timer.held is not None and timer.held >= needed


def _all(guards: list[Guard]) -> Guard:
    """Open when every guard is; without any, never."""
    if len(guards) == 1:
        return guards[0]
    if not guards:
        return lambda: False
    return lambda: all(guard() for guard in guards)
