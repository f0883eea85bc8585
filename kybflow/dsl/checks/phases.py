"""Checks flows phase by phase: which flow controls a vehicle (KYB198, KYB199, KYB242), and whether
the vehicle can enter the state that a phase requests (KYB243).

The first search begins in a flow's first phase with the vehicles that the flow has from the start.
A vehicle that was given away returns with the event `FLOW.finished` of the flow that received it.
After any other transition it is unknown which flow controls it, and the runtime decides.

In the second search, a vehicle that waits in `landed` stays on the ground until a phase requests a
state. If the condition of a transition names a vehicle's state, it determines whether the vehicle
is in the air when the next phase begins. Everything else is unknown, and the runtime decides.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.flows import ASKED, Assignment, assignments, handovers, phases, runs_of
from kybflow.dsl.checks.reachability import PHRASES
from kybflow.dsl.diagnostics import Diagnostic, Severity, Span
from kybflow.dsl.expanding.flows import GROUNDED, named_vehicles, own_vehicles
from kybflow.dsl.expressions import And, Condition, GroupInState, InState
from kybflow.dsl.plan import FlowPlan, PhasePlan, Plan, TransitionPlan
from kybflow.parts import AIR, GROUND, MOVING, Flight


class _Holder(NamedTuple):
    """The flow that controls a vehicle. given: where another flow gave it the vehicle, or None.
    is_sure: whether this flow controls the vehicle along every path."""

    flow: str
    given: Span | None = None
    is_sure: bool = True

    @property
    def doubtful(self) -> _Holder:
        return self._replace(is_sure=False)


_Holders = dict[str, _Holder]


def two_drivers(case: Case) -> Iterator[Diagnostic]:
    """KYB198: two flows control a vehicle from the start.

    A flow has every vehicle that it names and that no other flow gives it. Only one flow can
    control a vehicle at a time: let one give it to the other.
    """
    first: dict[str, FlowPlan] = {}
    for flow in case.plan.flows:
        for vehicle in own_vehicles(case.plan, flow):
            if vehicle not in first:
                first[vehicle] = flow
                continue
            other = first[vehicle]
            named = (
                assignment.who.span
                for phase in flow.phases.values()
                for key in ASKED
                for assignment in assignments(case.plan, phase, key)
                if assignment.vehicle == vehicle
            )
            yield Diagnostic(
                "KYB198",
                f"`{flow.name}` and `{other.name}` both control `{vehicle}`",
                next(named, flow.span),
                label=f"`{other.name}` has it from the start",
                help=f"let one give it to the other: `give: {{{vehicle}: {flow.name}}}`",
            )


def not_driven(case: Case) -> Iterator[Diagnostic]:
    """KYB199: a phase runs or gives a vehicle that another flow controls at that time. It is a
    warning if that depends on how the phase was reached."""
    for flow in case.plan.flows:
        holders = _holders(case.plan, flow)
        for name, phase in flow.phases.items():
            held = dict(holders.get(name, {}))
            for assignment in handovers(case.plan, phase):
                yield from _taken(assignment, held, flow, phase)
                held[assignment.vehicle] = _Holder(assignment.goal.text, assignment.who.span)
            for assignment in assignments(case.plan, phase, "run"):
                yield from _taken(assignment, held, flow, phase)


def _taken(
    assignment: Assignment, held: _Holders, flow: FlowPlan, phase: PhasePlan
) -> Iterator[Diagnostic]:
    holder = held.get(assignment.vehicle)
    if holder is None or holder.flow == flow.name:
        return
    sure, given = holder.is_sure, holder.given
    yield Diagnostic(
        "KYB199",
        f"`{holder.flow}` {'controls' if sure else 'may control'} `{assignment.vehicle}` in phase "
        f"`{phase.name}`",
        assignment.who.span,
        label=f"`{flow.name}` {'does' if sure else 'may'} not have it",
        notes=(f"it was given at {given.at}",) if given is not None else (),
        help=(
            f"wait for its return with `{{event: {holder.flow}.finished, go: ...}}`"
            if given is not None
            else "give a flow all its vehicles in one phase"
        ),
        severity=Severity.ERROR if sure else Severity.WARNING,
    )


def _holders(plan: Plan, flow: FlowPlan) -> dict[str, _Holders]:
    """Return which flow controls each vehicle when a phase is entered, by phase."""
    own = _Holder(flow.name)
    entered: dict[str, _Holders] = {flow.begin: _first(plan, flow)}
    waiting = [flow.begin]
    while waiting:
        phase = flow.phases.get(waiting.pop())
        if phase is None:
            continue
        held = dict(entered[phase.name])
        for assignment in handovers(plan, phase):
            held[assignment.vehicle] = _Holder(assignment.goal.text, assignment.who.span)
        for transition in phase.transitions:
            event = transition.event or ""
            left = {
                v: own if flow.name == h.flow or event == f"{h.flow}.finished" else h.doubtful
                for v, h in held.items()
            }
            target = transition.target
            before = entered.get(target)
            merged = left if before is None else {v: _merged(before[v], left[v]) for v in left}
            if merged != before:
                entered[target] = merged
                waiting.append(target)
    return entered


def _first(plan: Plan, flow: FlowPlan) -> _Holders:
    """Return which flow controls each vehicle when `flow` begins. A flow without vehicles of its
    own waits until others hand it some; it is certain to have a vehicle only if each of these
    others hands over that vehicle."""
    own, had = _Holder(flow.name), own_vehicles(plan, flow)
    givers = [
        (other.name, {w.vehicle for w in given})
        for other, phase in plan.giving
        if (given := [w for w in assignments(plan, phase, "give") if w.goal.text == flow.name])
    ]
    held: _Holders = {}
    for vehicle in named_vehicles(plan, flow):
        sure = vehicle in had or (not had and all(vehicle in given for _, given in givers))
        giver = next((name for name, given in givers if vehicle in given), flow.name)
        held[vehicle] = own if sure else _Holder(giver, is_sure=False)
    return held


def _merged(a: _Holder, b: _Holder) -> _Holder:
    """Return the holder where two paths meet. If the paths disagree, it is not sure, and a flow to
    which the vehicle was given is preferred."""
    if a == b:
        return a
    return (a if a.given is not None else b).doubtful


_ASKED = {"run": "behaviors", "give": "flows"}


def assigned_twice(case: Case) -> Iterator[Diagnostic]:
    """KYB242: a phase requests two different things from one vehicle, through its own name and a
    group, or through two groups."""
    for _, phase in phases(case.plan):
        for key in ASKED:
            first: dict[str, Assignment] = {}
            for assignment in assignments(case.plan, phase, key):
                before = first.setdefault(assignment.vehicle, assignment)
                if before.goal.text != assignment.goal.text:
                    yield Diagnostic(
                        "KYB242",
                        f"this phase gives `{assignment.vehicle}` two {_ASKED[key]}: "
                        f"`{before.goal.text}` and `{assignment.goal.text}`",
                        assignment.who.span,
                        notes=tuple(
                            f"`{assignment.vehicle}` is a member of `{who}`"
                            for who in dict.fromkeys((before.who.text, assignment.who.text))
                            if who != assignment.vehicle
                        ),
                        help="name each vehicle once per phase",
                    )


_ANY = frozenset({GROUND, AIR, MOVING})
_Places = dict[str, frozenset[Flight]]
"""The flight conditions in which each vehicle can be."""
_DISTURBING = frozenset({"switch", "phase"})


def can_not_enter(case: Case) -> Iterator[Diagnostic]:
    """KYB243: a phase runs a state that its vehicle can't enter from where it surely is at that
    time, such as a flight on the ground.

    This is not checked if callbacks switch vehicles or enter phases.
    """
    actions = [action for callback in case.plan.callbacks for action in callback.do]
    if any(a.name in _DISTURBING or a.part is not None for a in actions):
        return
    for flow in case.plan.flows:
        for name, places in _flight_conditions(case, flow).items():
            for own, _, goal in assignments(case.plan, flow.phases[name], "run"):
                vehicle = case.plan.fleet[own]
                starts = {leg.start for leg in case.legs(vehicle, vehicle.goal(goal.text))}
                if not starts or not starts.isdisjoint(places[own]):
                    continue
                fits = (
                    s for s in vehicle.states for p in places[own] if case.accepts(vehicle, s, p)
                )
                other = next(fits, None)
                yield Diagnostic(
                    "KYB243",
                    f"`{own}` can't enter `{goal.text}` here",
                    goal.span,
                    label=f"needs a vehicle {_said(starts)}",
                    notes=(f"`{own}` is {_said(places[own])} when this phase begins",),
                    help=f"did you mean `{other}`?" if other else "",
                )


def _said(places: set[Flight] | frozenset[Flight]) -> str:
    return " or ".join(PHRASES[place] for place in (GROUND, AIR, MOVING) if place in places)


def _flight_conditions(case: Case, flow: FlowPlan) -> dict[str, _Places]:
    """Return the flight conditions in which each vehicle can be on entry to each phase."""
    plan = case.plan
    own = own_vehicles(plan, flow)
    first = {
        name: frozenset({GROUND}) if name in own and plan.fleet[name].begin == GROUNDED else _ANY
        for name in named_vehicles(plan, flow)
    }
    entered = {flow.begin: first} if flow.begin in flow.phases else {}
    waiting = list(entered)
    while waiting:
        phase = flow.phases[waiting.pop()]
        for transition in phase.transitions:
            left = _conditions_after(case, phase, transition, entered[phase.name])
            target, before = transition.target, entered.get(transition.target)
            merged = left if before is None else {v: left[v] | before[v] for v in left}
            if target in flow.phases and merged != before:
                entered[target] = merged
                waiting.append(target)
    return entered


def _conditions_after(
    case: Case, phase: PhasePlan, transition: TransitionPlan, places: _Places
) -> _Places:
    """Return the flight conditions in which each vehicle can be after a transition of a phase."""
    plan = case.plan
    asked = {*runs_of(case, phase)}
    asked |= {assignment.vehicle for assignment in handovers(plan, phase)}
    still = frozenset({GROUND})
    left = {v: p if p == still and v not in asked else _ANY for v, p in places.items()}
    for vehicle, state in said_states(case.condition(transition, "when", case.scopes.flow())):
        if vehicle in left:
            left[vehicle] = _places_of(case, vehicle, state)
    return left


def said_states(when: Condition | None) -> Iterator[tuple[str, str]]:
    """Yield (vehicle, state) for every state that a condition requires."""
    match when:
        case InState(vehicle, state):
            yield vehicle, state
        case GroupInState("all", _, vehicles, state):
            yield from ((vehicle, state) for vehicle in vehicles)
        case And(parts):
            for part in parts:
                yield from said_states(part)


def _places_of(case: Case, vehicle: str, state: str) -> frozenset[Flight]:
    """Return the flight conditions in which a vehicle in a state can be; MOVING during a take-off
    or landing."""
    owner = case.plan.fleet[vehicle]
    if state not in owner.states and owner.goal(state) != state:
        return _ANY  # a chain of states
    legs = case.legs(owner, state)
    return frozenset(
        place
        for leg in legs
        for place in ((leg.start,) if leg.start is leg.end else (MOVING, leg.end))
    )
