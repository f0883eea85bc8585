"""The proof that every vehicle that flies also lands: KYB205, KYB251 and KYB252.

It follows the graph of states by flight condition (`flights`), along the mission's transitions and
those that the language adds. A behavior that ends without a `then`, or fails without a `failed`, is
followed by `brake`, `hover` and a landing. A landing that fails lands blind.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from collections.abc import Set as AbstractSet
from functools import partial

from kybflow.dsl.checks.case import TARGETS, Case
from kybflow.dsl.checks.events import given_by_a_person
from kybflow.dsl.checks.reachability import (
    FlightEdge,
    FlightGraph,
    FlightNode,
    comes_down,
    endless_states,
    flight_graph,
)
from kybflow.dsl.checks.transitions import reached_states
from kybflow.dsl.diagnostics import Diagnostic, Related, Severity
from kybflow.dsl.expressions import Compare, Quantity, Read
from kybflow.dsl.plan import TransitionPlan, VehiclePlan
from kybflow.parts import AIR, GROUND


def never_lands(case: Case) -> Iterator[Diagnostic]:
    """KYB205: no sequence of transitions leads from a behavior in the air to the ground.

    A behavior that ends without `then` is followed by `brake`, `hover` and, after the hover limit,
    a landing. The finding therefore means a behavior without an end that no `next` or `within`
    leaves, or a cycle of `then` that no `next` leaves, if no callback or flow requests a landing
    either. Failures do not count as an exit, nor does a `within` if the behavior ends before it. A
    `then` that is never taken is reported only as KYB206.
    """
    for vehicle, flights in case.cached(_sound):
        states = vehicle.states.values()
        told = {s.name for s in states if any(t.cause == "then" for t in s.transitions)}
        endless = endless_states(vehicle) - told
        down = comes_down(vehicle, flights, endless)
        is_requested = any(FlightNode(state, AIR) in down for state in vehicle.requested)
        if is_requested or not vehicle.requested <= vehicle.states.keys():
            continue
        for path in _traps(vehicle, flights, flights.nodes - down, endless):
            yield Diagnostic(
                "KYB205",
                f"after `{path[0]}` the vehicle never lands",
                vehicle.states[path[0]].span,
                label="no transitions lead to the ground",
                notes=(_told_path(vehicle, flights, path),),
                help=_way_out(path),
                related=_round(vehicle, path),
            )


def comes_down_by_chance(case: Case) -> Iterator[Diagnostic]:
    """KYB251: only a condition or an event ends a behavior or a cycle in the air. If it never
    comes, the vehicle flies until its battery or the time limit of the run lands it.

    To avoid this, let a behavior of the cycle lead elsewhere when it ends; give a behavior without
    an end a `within`, or an `after` without a condition. An event that a person gives is also
    enough, and so are a request by a callback or a flow, and a condition on the remaining battery
    that hovering reaches within the `time_limit`.
    """
    for vehicle, flights in case.cached(_sound):
        endless = endless_states(vehicle)
        down = comes_down(vehicle, flights, endless)
        if vehicle.requested or not flights.nodes <= down:
            continue
        drains = partial(_drains, case, vehicle)
        surely = comes_down(vehicle, flights, endless, partial(_comes_surely, case, drains))
        for path in _traps(vehicle, flights, flights.nodes - surely, endless):
            yield Diagnostic(
                "KYB251",
                f"only a condition or an event ends `{path[0]}`",
                vehicle.states[path[0]].span,
                label="might never end",
                notes=(_told_path(vehicle, flights, path),),
                help=_way_out(path),
                severity=Severity.WARNING,
            )


def failures_in_a_cycle(case: Case) -> Iterator[Diagnostic]:
    """KYB252: a behavior in the air that fails or takes too long returns to itself through failures
    alone, so a permanent failure keeps the vehicle in the air.

    Without a `failed` of its own, a failed behavior brakes and lands, and a failed landing lands
    blind, so that every failure ends on the ground.
    """
    for vehicle, flights in case.cached(_sound):
        failing = {link.source: link for link in flights.links if link.transition.cause == "failed"}
        told: set[str] = set()
        for node in sorted(failing, key=lambda n: list(vehicle.states).index(n.state)):
            cycle = _failures(node, failing)
            if not cycle or node.flight is GROUND or node.state in told:
                continue
            told.update(link.source.state for link in cycle)
            states = [link.source.state for link in cycle]
            yield Diagnostic(
                "KYB252",
                f"if `{node.state}` keeps failing, the vehicle never lands",
                cycle[0].transition.target_span,
                label="leads back through failures alone",
                notes=("`" + "` → `".join([*states, states[0]]) + "` → ...",),
                help="write `failed: auto_land` in one of them, or remove `failed`",
            )


def _failures(first: FlightNode, failing: dict[FlightNode, FlightEdge]) -> list[FlightEdge]:
    """Return the failure transitions from `first` back to itself; empty if they end elsewhere."""
    cycle = [failing[first]]
    for _ in failing:
        link = cycle[-1]
        successor = FlightNode(link.transition.target, link.flight)
        if successor.state == first.state:
            return cycle
        if successor not in failing:
            break
        cycle.append(failing[successor])
    return []


def _sound(case: Case) -> Iterator[tuple[VehiclePlan, FlightGraph]]:
    """Yield each vehicle whose transitions all have valid targets, with its graph. Nothing can be
    proven about the others."""
    for vehicle in case.plan.vehicles:
        flights = flight_graph(case, vehicle)
        if not flights.broken and reached_states(vehicle) <= {*vehicle.states, *TARGETS}:
            yield vehicle, flights


def _drains(case: Case, vehicle: VehiclePlan, transition: TransitionPlan) -> bool:
    """Return whether a transition waits only for the vehicle's own battery to fall below a charge
    that hovering reaches within the mission's time limit."""
    if transition.event is not None or transition.after is not None or transition.hold > 0.0:
        return False
    own = vehicle.name
    match case.condition(transition, "when", case.scopes.condition(own)):
        case Compare("<", Read(who, "battery.remaining"), Quantity(share)) if who in (None, own):
            return (1.0 - share) * vehicle.airframe.endurance < case.plan.time_limit
    return False


def _comes_surely(
    case: Case,
    drains: Callable[[TransitionPlan], bool],
    transition: TransitionPlan,
    is_endless: bool,
) -> bool:
    """Return whether a transition is certain to be taken."""
    if drains(transition):
        return True
    if transition.event is not None:
        return transition.when is None and given_by_a_person(transition.event, case.plan)
    if not is_endless:
        return transition.cause == "then"
    return transition.cause == "within" or (transition.cause == "next" and transition.when is None)


def _way_out(path: list[str]) -> str:
    """Return the help line for a trap: a cycle of states, or a state that never ends."""
    if len(path) > 1:
        return "let the last of them lead to a landing, such as `auto_land`"
    return "add a `within`, or a `next` with `after: 60 s`, that leads to a landing"


def _traps(
    vehicle: VehiclePlan,
    flights: FlightGraph,
    stuck: AbstractSet[FlightNode],
    endless: AbstractSet[str],
) -> Iterator[list[str]]:
    """Yield the states of each trap once: a state among the `stuck` nodes that never ends, or a
    cycle of `then`. A cycle ends with its first state again."""
    names = {node.state for node in stuck}
    thens = (link for link in flights.links if link.transition.cause == "then")
    ahead = {link.source.state: link.transition.target for link in thens}
    told: set[str] = set()
    for name in [*(n for n in vehicle.states if n in endless), *vehicle.states]:
        if name in names and name not in told:
            path = _along(name, ahead, endless)
            if told.isdisjoint(path):
                yield path
            told.update(path)


def _along(name: str, ahead: dict[str, str], endless: AbstractSet[str]) -> list[str]:
    """Return `name` and the states that follow it by `then`, up to the first one that repeats or
    never ends."""
    path, passed = [name], {name}
    while path[-1] in ahead and path[-1] not in endless:
        path.append(ahead[path[-1]])
        if path[-1] in passed:
            break
        passed.add(path[-1])
    return path


def _round(vehicle: VehiclePlan, path: list[str]) -> tuple[Related, ...]:
    """Return the source locations of the states of a cycle, without the first of the path."""
    cycle = path[path.index(path[-1]) : -1]
    return tuple(Related(vehicle.states[n].span, f"`{n}`") for n in cycle if n != path[0])


def _told_path(vehicle: VehiclePlan, flights: FlightGraph, path: list[str]) -> str:
    """Return the path into a trap and around it as text: the counter-example to the proof."""
    ahead: dict[str, list[str]] = {}
    for link in flights.links:
        ahead.setdefault(link.source.state, []).append(link.transition.target)
    came, waiting = {vehicle.begin: ""}, [vehicle.begin]
    for state in waiting:
        for target in ahead.get(state, ()):
            if target not in came:
                came[target] = state
                waiting.append(target)
    names = list(path)  # nothing leads to a first state that a callback or a flow requests
    while before := came.get(names[0]):
        names.insert(0, before)
    shown = "`" + "` → `".join(names) + "`"
    if path[-1] in path[:-1]:
        return f"{shown} → ..."
    part = vehicle.states[path[-1]].behavior.name
    return f"{shown} ({part}) never ends by itself"
