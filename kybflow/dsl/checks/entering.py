"""Whether a vehicle can enter the state that a phase asks it for: KYB243.

A vehicle that waits in `landed` is on the ground until a phase asks something of it; a way out
whose condition says in which state a vehicle is, says where it is when the next phase begins. Of
all else nothing is known, and the runtime decides.
"""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.flights import PHRASES
from kybflow.dsl.checks.phases import Wish, gifts, wishes
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.document import Flow, Phase, Transition
from kybflow.dsl.expressions import And, Condition, GroupInState, InState
from kybflow.dsl.shaping.flows import GROUNDED, named_vehicles, own_vehicles
from kybflow.parts import AIR, GROUND, MOVING, Flight

_ANY = frozenset({GROUND, AIR, MOVING})
_Places = dict[str, frozenset[Flight]]
"""Where each vehicle can be."""
_DISTURBING = frozenset({"switch", "phase"})


def can_not_enter(case: Case) -> Iterator[Diagnostic]:
    """KYB243: a phase runs a state that its vehicle can't enter where it surely is then, such as a
    flight on the ground.

    Nothing is said where callbacks switch vehicles or enter phases, because anything may be then.
    """
    actions = [action for callback in case.document.callbacks for action in callback.actions]
    if any(a.name.text in _DISTURBING or a.part is not None for a in actions):
        return
    for flow in case.document.flows.values():
        for name, places in _walk(case, flow).items():
            for wish in wishes(case.document, flow.phases[name].run):
                yield from _impossible(case, wish, places[wish.vehicle])


def _impossible(case: Case, wish: Wish, places: frozenset[Flight]) -> Iterator[Diagnostic]:
    vehicle = case.document.vehicles[wish.vehicle]
    goal = vehicle.goal(wish.goal.text)
    starts = {leg.start for leg in case.legs(vehicle, goal)}
    if not starts or not starts.isdisjoint(places):
        return
    fits = [s for s in vehicle.states if any(case.accepts(vehicle, s, p) for p in places)]
    yield Diagnostic(
        "KYB243",
        f"`{wish.vehicle}` can't enter `{wish.goal.text}` here",
        wish.goal.span,
        label=f"needs a vehicle {_said(starts)}",
        notes=(f"`{wish.vehicle}` is {_said(places)} when this phase begins",),
        help=f"did you mean `{fits[0]}`?" if fits else "",
    )


def _said(places: set[Flight] | frozenset[Flight]) -> str:
    return " or ".join(PHRASES[place] for place in (GROUND, AIR, MOVING) if place in places)


def _walk(case: Case, flow: Flow) -> dict[str, _Places]:
    """Where each vehicle can be when a phase is entered."""
    document = case.document
    own = own_vehicles(document, flow)
    first = {
        name: frozenset({GROUND})
        if name in own and document.vehicles[name].begin.text == GROUNDED
        else _ANY
        for name in named_vehicles(document, flow)
    }
    entered = {flow.begin.text: first} if flow.begin.text in flow.phases else {}
    waiting = list(entered)
    while waiting:
        phase = flow.phases[waiting.pop()]
        for arrow in phase.transitions:
            target, left = arrow.target.text, _left(case, phase, arrow, entered[phase.name.text])
            before = entered.get(target)
            merged = left if before is None else {v: left[v] | before[v] for v in left}
            if target in flow.phases and merged != before:
                entered[target] = merged
                waiting.append(target)
    return entered


def _left(case: Case, phase: Phase, arrow: Transition, places: _Places) -> _Places:
    """Where each vehicle can be after a way out of a phase."""
    document = case.document
    asked = {wish.vehicle for wish in wishes(document, phase.run)}
    asked |= {wish.vehicle for wish in gifts(document, phase)}
    still = frozenset({GROUND})
    left = {v: p if p == still and v not in asked else _ANY for v, p in places.items()}
    for vehicle, state in _said_states(case.condition(arrow.when, case.scopes.flow())):
        if vehicle in left:
            left[vehicle] = _places_of(case, vehicle, state)
    return left


def _said_states(when: Condition | None) -> Iterator[tuple[str, str]]:
    """(vehicle, state) of everything that a condition requires."""
    match when:
        case InState(vehicle, state):
            yield vehicle, state
        case GroupInState("all", _, vehicles, state):
            yield from ((vehicle, state) for vehicle in vehicles)
        case And(parts):
            for part in parts:
                yield from _said_states(part)


def _places_of(case: Case, vehicle: str, state: str) -> frozenset[Flight]:
    """Where a vehicle in a state can be: between the ends of a take-off or a landing it moves."""
    owner = case.document.vehicles[vehicle]
    if state not in owner.states and owner.goal(state) != state:
        return _ANY  # a chain of states
    legs = case.legs(owner, state)
    return frozenset(
        place
        for leg in legs
        for place in ((leg.start,) if leg.start is leg.end else (MOVING, leg.end))
    )
