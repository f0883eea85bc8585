"""How each state of a vehicle can be entered: in which flight condition (on the ground, in the air
or moving), and at which positions, as far as that is known before the flight.

The search begins on the ground in the first state. Only the normal end of a behavior completes its
flight type. If a take-off or landing is left in any other way, the vehicle is MOVING.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from typing import NamedTuple

from kybflow.core.geometry import Vec3, distance
from kybflow.dsl.checks.case import TARGETS, Case
from kybflow.dsl.plan import Cause, StatePlan, TransitionPlan, VehiclePlan
from kybflow.parts import AIR, GROUND, MOVING, Flight, Leg


class FlightNode(NamedTuple):
    """A state entered in a flight condition."""

    state: str
    flight: Flight


class FlightEdge(NamedTuple):
    """A transition of the mission that leaves a node. flight: the vehicle's flight condition after
    the transition."""

    source: FlightNode
    transition: TransitionPlan
    flight: Flight


@dataclass(frozen=True, slots=True)
class FlightGraph:
    """The graph of states by flight condition.

    nodes: the reachable ones. links: the valid transitions. broken: transitions whose target can't
    start in the flight condition in which the source leaves the vehicle. Transitions to unknown
    names are left out.
    """

    nodes: frozenset[FlightNode]
    links: tuple[FlightEdge, ...]
    broken: tuple[FlightEdge, ...]


def flight_graph(case: Case, vehicle: VehiclePlan) -> FlightGraph:
    """Return the graph of all transitions from the first state and from the states that may be
    requested, in each flight condition in which these can start."""
    if "flights" in vehicle.known:
        known: FlightGraph = vehicle.known["flights"]
        return known
    requested = [
        FlightNode(s, leg.start) for s in sorted(vehicle.requested) for leg in case.legs(vehicle, s)
    ]
    first = [FlightNode(vehicle.begin, GROUND), *requested]
    found, links, broken = set(first), list[FlightEdge](), list[FlightEdge]()
    waiting = [node for node in first if node.state in vehicle.states]
    while waiting:
        node = waiting.pop()
        for link in _links(vehicle.states[node.state], node):
            target = link.transition.target
            if target not in vehicle.states and target not in TARGETS:
                continue
            if not case.accepts(vehicle, target, link.flight):
                broken.append(link)
                continue
            links.append(link)
            successor = FlightNode(target, link.flight)
            if target in vehicle.states and successor not in found:
                found.add(successor)
                waiting.append(successor)
    graph = FlightGraph(frozenset(found), tuple(links), tuple(broken))
    vehicle.known["flights"] = graph
    return graph


def _links(state: StatePlan, node: FlightNode) -> Iterator[FlightEdge]:
    legs = [leg for leg in state.legs if leg.start is node.flight]
    for leg in legs[:1]:
        left_early = leg.end if leg.start is leg.end else MOVING
        for transition in state.transitions:
            flight = leg.end if transition.cause == "then" else left_early
            yield FlightEdge(node, transition, flight)


def may_end(transition: TransitionPlan, is_endless: bool) -> bool:
    """Return whether a flight without failures may take a transition. is_endless: whether the
    behavior never ends by itself; only then a `within` is not a failure."""
    if transition.cause == "within":
        return is_endless
    return transition.cause == "next" or (transition.cause == "then" and not is_endless)


def comes_down(
    vehicle: VehiclePlan,
    flights: FlightGraph,
    endless: AbstractSet[str],
    counts: Callable[[TransitionPlan, bool], bool] = may_end,
) -> frozenset[FlightNode]:
    """Return the nodes from which the vehicle reaches the ground without a failure, by transitions
    for which `counts` is true.

    A behavior without `then` is followed by `brake`, `hover` and then `auto_land`, or ends on the
    ground. The states in `endless` have no normal end.
    """
    before: dict[FlightNode, list[FlightNode]] = {}
    waiting = [node for node in flights.nodes if node.flight is GROUND]
    ending = (node for node in flights.nodes if node.state not in endless)
    waiting += [node for node in ending if _ends_by_default(vehicle, node)]
    for link in flights.links:
        target = link.transition.target
        if not counts(link.transition, link.source.state in endless):
            continue
        if target in vehicle.states:
            before.setdefault(FlightNode(target, link.flight), []).append(link.source)
        else:
            waiting.append(link.source)
    down = set(waiting)
    while waiting:
        fresh = [node for node in before.get(waiting.pop(), ()) if node not in down]
        down.update(fresh)
        waiting += fresh
    return frozenset(down)


def _ends_by_default(vehicle: VehiclePlan, node: FlightNode) -> bool:
    state = vehicle.states.get(node.state)
    if state is None:
        return True
    lands = any(leg == Leg(node.flight, GROUND) for leg in state.legs)
    return lands or all(t.cause != "then" for t in state.transitions)


PHRASES = {GROUND: "on the ground", AIR: "in the air", MOVING: "moving"}
"""The flight conditions in words for reports."""


_MOST_POINTS = 16
_SAME_PLACE = 1e-6


@dataclass(slots=True)
class Entries:
    """The known entry positions of a state. known: false if the state can also be entered
    elsewhere."""

    points: list[Vec3] = field(default_factory=list)
    known: bool = True

    def add(self, point: Vec3 | None) -> bool:
        """Add an entry position and return whether this changes anything. After None, or too many
        positions, the state counts as entered anywhere."""
        if point is None or len(self.points) >= _MOST_POINTS:
            changed, self.known = self.known, False
            return changed
        if any(distance(point, p) < _SAME_PLACE for p in self.points):
            return False
        self.points.append(point)
        return True

    def candidates(self) -> list[Vec3 | None]:
        """Return the entry positions for which to compute a footprint; None stands for an unknown
        one."""
        return [*self.points] if self.known else [*self.points, None]


def entries_of(vehicle: VehiclePlan) -> dict[str, Entries]:
    """Return the entry positions of every state of the vehicle that is reachable from its start. A
    state that a callback or a flow may request can be entered anywhere; a flow's first request
    finds the vehicle at its start."""
    if "entries" in vehicle.known:
        known: dict[str, Entries] = vehicle.known["entries"]
        return known
    found = {vehicle.begin: Entries([vehicle.start])}
    waiting: list[tuple[str, Vec3 | None]] = [(vehicle.begin, vehicle.start)]
    for name in sorted(vehicle.requested):
        found.setdefault(name, Entries()).add(None)
        waiting.append((name, None))
    for name in sorted(vehicle.requested_first):
        found[name].add(vehicle.start)
        waiting.append((name, vehicle.start))
    vehicle.known["entries"] = _followed(vehicle, found, waiting)
    return found


def entries_after(vehicle: VehiclePlan, goals: Iterable[str]) -> dict[str, Entries]:
    """Return the entry positions of every state reached from `goals`, which can be entered
    anywhere."""
    waiting: list[tuple[str, Vec3 | None]] = [(goal, None) for goal in goals]
    return _followed(vehicle, {goal: Entries([], known=False) for goal, _ in waiting}, waiting)


def _followed(
    vehicle: VehiclePlan, found: dict[str, Entries], waiting: list[tuple[str, Vec3 | None]]
) -> dict[str, Entries]:
    """Return `found` with the entry positions of every state that follows the `waiting` ones."""
    while waiting:
        name, entry = waiting.pop()
        state = vehicle.states.get(name)
        if state is None:
            found.pop(name, None)
            continue
        for transition in state.transitions:
            left = left_at(state, transition.cause, entry)
            target = transition.target
            if target in vehicle.states and found.setdefault(target, Entries()).add(left):
                waiting.append((target, left))
    return found


def endless_states(vehicle: VehiclePlan) -> frozenset[str]:
    """Return the states whose behavior, with its parameters, has no normal end."""
    if "endless" not in vehicle.known:
        footprints = (
            (name, vehicle.states[name].footprint(entry))
            for name, entries in entries_of(vehicle).items()
            for entry in entries.candidates()
        )
        vehicle.known["endless"] = frozenset(
            name for name, footprint in footprints if footprint and footprint.is_endless
        )
    endless: frozenset[str] = vehicle.known["endless"]
    return endless


def left_at(state: StatePlan, cause: Cause, entry: Vec3 | None) -> Vec3 | None:
    """Return where the vehicle is when a transition for `cause` leaves the state; None if
    unknown."""
    cls = state.behavior.cls
    if all(leg.start is GROUND and leg.end is GROUND for leg in cls.flight):
        return entry
    footprint = state.footprint(entry)
    if footprint is None:
        return None
    if cause == "then":
        return footprint.exit
    return footprint.points[0] if stays(state, entry) else None


def stays(state: StatePlan, entry: Vec3 | None) -> bool:
    """Return whether a behavior is certain to keep its vehicle in one place."""
    footprint = state.footprint(entry)
    if footprint is None or not footprint.points:
        return False
    return all(distance(p, footprint.points[0]) < _SAME_PLACE for p in footprint.points)
