"""Computes the least time that a vehicle needs from state to state, as far as this is known before
the flight. It combines the least time of each behavior's footprint, the waits of `next`, and the
quickest path through the graph of states.

Every number is a lower bound for a flight without failures. Unknown times count as zero.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import replace
from heapq import heappop, heappush
from itertools import count
from math import inf
from typing import NamedTuple, TypeVar

from kybflow.core.geometry import Vec3
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.flows import phases
from kybflow.dsl.checks.reachability import (
    FlightEdge,
    FlightNode,
    endless_states,
    entries_of,
    flight_graph,
    may_end,
)
from kybflow.dsl.diagnostics import Span
from kybflow.dsl.expressions import And, Compare, Condition, Quantity, Read
from kybflow.dsl.names import end_of
from kybflow.dsl.plan import StatePlan, TransitionPlan, VehiclePlan
from kybflow.parts import AIR, GROUND
from kybflow.parts.observables import is_in

_TIME_SHARE = 0.95
"""A least time exceeds a limit only if this share of it does, because positions are known only to a
few centimetres."""
_STOPPING_TIME_S = 3.0
"""Time in which a vehicle that enters a state in motion comes to rest before the behavior begins,
s."""
_MOST_SHOWN = 5
_HOVERS = frozenset({"brake", "hover"})
"""Built-in states that lead to a landing after the hover limit."""


_DISTURBING = frozenset({"switch", "phase", "stop"})
"""Actions that change which states follow or end the mission."""


class Way(NamedTuple):
    """The quickest path to a node. seconds: its total time. state: the last state that it leaves.
    spent: the time in that state, s. before: the path up to that state."""

    seconds: float
    state: str = ""
    spent: float = 0.0
    before: Way | None = None

    def steps(self) -> list[tuple[str, float]]:
        """Return each state on the path that takes time, in order, with its least seconds."""
        found, way = [], self
        while way.before is not None:
            if way.spent > 0.0:
                found.append((way.state, way.spent))
            way = way.before
        return found[::-1]

    def longest(self) -> str:
        """Return the state that takes the most time."""
        return max(self.steps(), key=lambda step: step[1])[0]


def sum_of(way: Way) -> str:
    """Return a note that adds up the times of a path: `13.6 s = `up` 4.76 s + ...`."""
    steps = way.steps()
    shown = sorted(sorted(steps, key=lambda s: -s[1])[:_MOST_SHOWN], key=steps.index)
    terms = [f"`{state}` {seconds_of(spent)}" for state, spent in shown]
    if len(steps) == 1:
        return terms[0]
    rest = way.seconds - sum(spent for _, spent in shown)
    if len(steps) > len(shown):
        terms.append(f"{len(steps) - len(shown)} others {seconds_of(rest)}")
    return f"{seconds_of(way.seconds)} = " + " + ".join(terms)


N = TypeVar("N", bound=Hashable)
_Edge = tuple[FlightNode, float]


def disturbances(case: Case) -> Iterator[str]:
    """Yield the actions that change which states follow, end the mission, or change how a behavior
    flies."""
    for callback in case.plan.callbacks:
        for action in callback.do:
            is_tuned = action.name == "set" and ".behaviors." in (action.target or "")
            if action.name in _DISTURBING or action.part is not None or is_tuned:
                yield action.name
    for _, phase in phases(case.plan):
        yield from (option for option in phase.set if ".behaviors." in option)


def exceeds(least: float, limit: float) -> bool:
    """Return whether a least time certainly exceeds a limit."""
    return least * _TIME_SHARE > limit


def seconds_of(value: float) -> str:
    """Return a time as text for a report."""
    return f"{value:.0f} s" if value >= 100.0 else f"{value:.3g} s"


def least_time(case: Case, vehicle: VehiclePlan, state: StatePlan) -> float:
    """Return the least seconds from the entry of a state to the normal end of its behavior, over
    all known entry positions."""
    times: dict[str, float] = vehicle.known.setdefault("least times", {})
    name = state.name
    if name not in times:
        entries = entries_of(vehicle)
        candidates = entries[name].candidates() if name in entries else [None]
        times[name] = min([least_from(case, state, entry) for entry in candidates])
    return times[name]


def least_from(case: Case, state: StatePlan, entry: Vec3 | None) -> float:
    """Return the least seconds that a state takes from one entry position. A landing counts as zero
    if there are obstacles, because it may end early on top of one."""
    footprint = state.footprint(entry)
    lands = any(leg.end is GROUND and leg.start is not GROUND for leg in state.legs)
    if footprint is None or (case.plan.obstacles and lands):
        return 0.0
    return footprint.least_time(entry)


def longest_time(vehicle: VehiclePlan, state: StatePlan) -> float:
    """Return the seconds after which the behavior of a state has certainly ended; infinite if
    unknown."""
    entries = entries_of(vehicle).get(state.name)
    footprints = [state.footprint(entry) for entry in entries.candidates()] if entries else []
    ends = [
        inf if found is None or found.longest is None else found.longest for found in footprints
    ]
    return max(ends, default=inf) + _STOPPING_TIME_S


def ways_from(
    case: Case,
    vehicle: VehiclePlan,
    first: Iterable[FlightNode],
    through: Callable[[FlightNode], bool] = lambda _: True,
) -> dict[FlightNode, Way]:
    """Return the quickest path from any node in `first` to each node that is reachable without
    failures. Paths continue only through nodes that `through` accepts."""
    edges, begins = _ahead(case, vehicle), set(first)
    landed = FlightNode("landed", GROUND), 0.0
    built_in: dict[str, _Edge] = {
        "brake": (FlightNode("hover", AIR), 0.0),
        "hover": (FlightNode("auto_land", AIR), case.plan.hover_limit),
        "auto_land": landed,
        "land_blind": landed,
    }

    def ahead(node: FlightNode) -> Iterable[_Edge]:
        if node not in begins and not through(node):
            return ()
        own = edges.get(node, ())
        return (*own, built_in[node.state]) if node.state in built_in else own

    return quickest(sorted(begins, key=str), ahead, lambda node: node.state)


def quickest(
    first: Iterable[N], ahead: Callable[[N], Iterable[tuple[N, float]]], name: Callable[[N], str]
) -> dict[N, Way]:
    """Return the quickest path from any node in `first` to each node (Dijkstra). ahead: returns the
    successors of a node, each with the seconds until then. name: returns a node's name for
    `sum_of`."""
    found, order = dict[N, Way](), count()
    queue = [(0.0, next(order), node, Way(0.0)) for node in first]
    while queue:
        seconds, _, node, way = heappop(queue)
        if node in found:
            continue
        found[node] = way
        for target, spent in ahead(node):
            if target not in found:
                onward = Way(seconds + spent, name(node), spent, way)
                heappush(queue, (onward.seconds, next(order), target, onward))
    return found


def quickest_into(ways: Mapping[FlightNode, Way], state: str) -> Way | None:
    """Return the quickest of the paths that end in a state, or in a chain of that name; None if
    there is none."""
    ends = (way for node, way in ways.items() if is_in(node.state, state))
    return min(ends, key=lambda way: way.seconds, default=None)


def no_way_exceeds(case: Case, vehicle: VehiclePlan, limit: float) -> bool:
    """Return whether the times of all states of the vehicle together fit into a limit. This cheap
    test often makes a search for paths unnecessary."""
    if "most" not in vehicle.known:
        ahead = _ahead(case, vehicle).values()
        brakes = any(target.state in _HOVERS for edges in ahead for target, _ in edges)
        most = sum([max([spent for _, spent in edges]) for edges in ahead])
        vehicle.known["most"] = most + case.plan.hover_limit if brakes else most
    return not exceeds(vehicle.known["most"], limit)


def _ahead(case: Case, vehicle: VehiclePlan) -> dict[FlightNode, list[_Edge]]:
    """Return the successors of each node of the vehicle's own states, with the least seconds until
    they are entered. A vehicle with a fault may fail at once."""
    found: dict[FlightNode, list[_Edge]] = vehicle.known.setdefault("ahead", {})
    if found:
        return found
    flights, endless = flight_graph(case, vehicle), endless_states(vehicle)
    is_broken = any(fault.vehicle == vehicle.name for fault in case.plan.faults)
    for link in flights.links:
        is_endless = link.source.state in endless  # and may be meant to fail
        fails = link.transition.cause == "failed" and (is_broken or is_endless)
        if fails or may_end(link.transition, is_endless):
            target = FlightNode(link.transition.target, link.flight)
            spent = _least_before(case, vehicle, link)
            found.setdefault(link.source, []).append((target, spent))
    for node in flights.nodes:
        state = vehicle.states.get(node.state)
        if state is None or node.state in endless:
            continue
        if any(t.cause == "then" for t in state.transitions):
            continue
        legs = [leg for leg in state.legs if leg.start is node.flight][:1]
        ends = FlightNode(end_of(legs), legs[0].end if legs else GROUND)
        found.setdefault(node, []).append((ends, _least_end(case, vehicle, node)))
    return found


def _least_before(case: Case, vehicle: VehiclePlan, link: FlightEdge) -> float:
    transition = link.transition
    if transition.cause == "then":
        return _least_end(case, vehicle, link.source)
    scope = case.scopes.condition(vehicle.name)
    when = case.condition(transition, "when", scope)
    return max(own_wait(transition), _least_elapsed(when, vehicle.name))


def own_wait(transition: TransitionPlan) -> float:
    """Return how long a transition waits in its own state before it can be taken, s. For a
    transition of a whole chain this is zero, because its wait began in an earlier state."""
    after = 0.0 if transition.since else transition.after or 0.0
    return max(after, transition.hold)


def _least_elapsed(when: Condition | None, own: str) -> float:
    match when:
        case Compare(">" | ">=", Read(who, "elapsed"), Quantity(seconds)) if who in (None, own):
            return seconds
        case And(parts):
            return max(_least_elapsed(part, own) for part in parts)
    return 0.0


def _least_end(case: Case, vehicle: VehiclePlan, node: FlightNode) -> float:
    """Return the least time that the behavior of a state takes after it is entered at `node`, s. It
    is zero on the ground if the behavior can also begin in the air, because it may be done at
    once."""
    state = vehicle.states[node.state]
    if node.flight is GROUND and len({leg.start for leg in state.legs}) > 1:
        return 0.0
    return least_time(case, vehicle, state)


def blamed(case: Case, vehicle: VehiclePlan, state: StatePlan) -> Span:
    """Return where the duration of a state is written: the parameter that makes the state at least
    twice as long as its default would, or else the behavior's name."""
    part, entries = state.behavior, entries_of(vehicle)[state.name].candidates()
    quickest = 0.5 * least_time(case, vehicle, state)
    span = part.span
    for field in part.fields:
        if not part.is_written(field.key) or field.required:
            continue
        params = replace(part.params, **{field.name: field.default})
        shorter = replace(state, behavior=replace(part, params=params))
        seconds = min(least_from(case, shorter, entry) for entry in entries)
        if seconds < quickest:
            span, quickest = part.span_of(field.key), seconds
    return span
