"""The boxes and edges that are drawn for the state machines of vehicles and flows, and their text
for Mermaid.

The mission's own transitions are drawn, and those that the language adds for the normal course; the
failure transitions that the language adds are not. Vehicles with the same machine share a drawing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from kybflow.core.units import DURATION
from kybflow.dsl.expressions import describe
from kybflow.dsl.expressions.tree import quantity
from kybflow.dsl.plan import END, FlowPlan, Plan, StatePlan, Switch, TransitionPlan, VehiclePlan


class StateBox(NamedTuple):
    """One box of a drawing: a state, a phase, or a flow or callback that may request states.

    name: its name. part: the behavior of a state, or what a phase requests. flight: where a state
    begins and ends (ground or air), in words; empty for others. is_asker: whether the box is a flow
    or callback.
    """

    name: str
    part: str
    flight: str
    is_built_in: bool
    is_asker: bool = False


class Edge(NamedTuple):
    """One arrow of a drawing. It stands for all transitions from `source` to `target`. labels: one
    for each transition. is_implied: whether the language adds them all. is_request: whether the
    arrow instead means that the flow or callback `source` may request the state `target`."""

    source: str
    target: str
    labels: tuple[str, ...]
    is_implied: bool
    is_request: bool = False


class Drawing(NamedTuple):
    """The drawing of one machine. title: the names of the vehicles that have this machine, or of
    its flow."""

    title: str
    begin: str
    boxes: tuple[StateBox, ...]
    edges: tuple[Edge, ...]


Requests = Mapping[str, tuple[str, ...]]
"""The requested states, by the flow or callback that requests them."""


def requests_to(plan: Plan, vehicle: str) -> Requests:
    """Return the states of `vehicle` that each flow and callback may request, without
    repetition."""
    found: dict[str, dict[str, None]] = {}
    for flow in plan.flows:
        for phase in flow.phases.values():
            if vehicle in phase.run:
                found.setdefault(f"flow {flow.name}", {})[phase.run[vehicle].state] = None
    for callback in plan.callbacks:
        when = describe(callback.when) if callback.when and not callback.event else callback.event
        for action in callback.actions:
            if isinstance(action, Switch) and action.vehicle == vehicle:
                found.setdefault(f"on {when}", {})[action.state] = None
    return {name: tuple(states) for name, states in found.items()}


Groups = Mapping[str, tuple[str, ...]]


def drawings(plan: Plan) -> list[Drawing]:
    """Return one drawing for each machine; its title names the vehicles that have the machine."""
    same: dict[Drawing, list[str]] = {}
    for vehicle in plan.vehicles:
        same.setdefault(_machine(vehicle, requests_to(plan, vehicle.name)), []).append(vehicle.name)
    vehicles = [drawing._replace(title=", ".join(names)) for drawing, names in same.items()]
    return [*vehicles, *(_flow(flow, plan.groups) for flow in plan.flows)]


def _machine(vehicle: VehiclePlan, askers: Requests) -> Drawing:
    """Return the drawing of a vehicle's machine, without a title."""
    drawn = _reached(vehicle, askers)
    boxes = tuple(
        StateBox(
            name,
            state.behavior.name,
            f"{state.legs[0].start.value} → {state.legs[0].end.value}",
            state.built_in,
        )
        for name, state in vehicle.states.items()
        if name in drawn
    )
    labels: dict[tuple[str, str], list[str]] = {}
    implied: dict[tuple[str, str], bool] = {}
    for box in boxes:
        for transition in _drawn(vehicle.states[box.name]):
            added = transition.implied or box.is_built_in
            ends = (box.name, transition.target)
            labels.setdefault(ends, []).append(cause_of(transition))
            implied[ends] = implied.get(ends, True) and added
    edges = tuple(Edge(*ends, tuple(text), implied[ends]) for ends, text in labels.items())
    asking = tuple(StateBox(name, "asks", "", False, is_asker=True) for name in askers)
    entries = tuple(
        Edge(name, state, (), False, is_request=True)
        for name, states in askers.items()
        for state in states
    )
    return Drawing("", vehicle.begin, (*boxes, *asking), (*edges, *entries))


def _reached(vehicle: VehiclePlan, askers: Requests) -> set[str]:
    """Return the mission's own states, the requested ones, and the built-in ones to which a drawn
    transition leads."""
    own = (name for name, state in vehicle.states.items() if not state.built_in)
    waiting = [*own, vehicle.begin, *(state for states in askers.values() for state in states)]
    reached = set(waiting)
    while waiting:
        for transition in _drawn(vehicle.states[waiting.pop()]):
            if transition.target not in reached:
                reached.add(transition.target)
                waiting.append(transition.target)
    return reached


def _drawn(state: StatePlan) -> list[TransitionPlan]:
    """Return the transitions to draw: the mission's own and the implied ones, except those for
    failures and those for the end of a behavior that never ends by itself."""
    footprint = state.behavior.cls.footprint(state.behavior.params, None)
    is_endless = footprint is not None and footprint.is_endless
    return [
        transition
        for transition in state.transitions
        if not (transition.implied or state.built_in)
        or not (transition.cause == "failed" or (transition.cause == "then" and is_endless))
    ]


def cause_of(transition: TransitionPlan) -> str:
    """Return in words when a transition is taken."""
    if transition.cause == "then":
        return "done"
    if transition.cause == "failed":
        return "failed"
    if transition.cause == "within":
        whole = f"{transition.since} " if transition.since else ""
        return f"{whole}not done within {quantity(transition.after or 0.0, DURATION)}"
    parts = [describe(transition.when)] if transition.when is not None else []
    if transition.hold > 0.0:
        parts.append(f"for {quantity(transition.hold, DURATION)}")
    if transition.event is not None:
        parts.append(f"event {transition.event}")
    if transition.after is not None:
        inside = f" in {transition.since}" if transition.since else ""
        parts.append(f"after {quantity(transition.after, DURATION)}{inside}")
    if transition.emit is not None:
        parts.append(f"emits {transition.emit}")
    return " ".join(parts)


def _flow(flow: FlowPlan, groups: Groups) -> Drawing:
    """Return the drawing of a flow: its phases, and `end` if a transition leads there."""
    labels: dict[tuple[str, str], list[str]] = {}
    boxes: list[StateBox] = []
    for phase in flow.phases.values():
        asked = {name: request.chain or request.state for name, request in phase.run.items()}
        texts = [f"{names}: {state}" for names, state in _together(asked, groups)]
        texts += [f"arrive {phase.arrive}"] if phase.arrive else []
        texts += [f"{names} to {goal}" for names, goal in _together(phase.give, groups)]
        boxes.append(StateBox(phase.name, " · ".join(texts) or "asks nothing", "", False))
        for transition in phase.transitions:
            labels.setdefault((phase.name, transition.target), []).append(cause_of(transition))
        if phase.ends or not phase.transitions:
            labels.setdefault((phase.name, END), []).append("done")

    if any(target == END for _, target in labels):
        boxes.append(StateBox(END, "the flow is over", "", True))
    edges = tuple(Edge(*ends, tuple(text), False) for ends, text in labels.items())
    return Drawing(f"flow {flow.name}", flow.begin, tuple(boxes), edges)


def _together(requests_to: Mapping[str, str], groups: Groups) -> Iterator[tuple[str, str]]:
    """Yield (vehicles, goal) for each goal. vehicles: the names of the vehicles that share the
    goal, or the name of their group."""
    for goal in dict.fromkeys(requests_to.values()):
        names = tuple(name for name, own in requests_to.items() if own == goal)
        group = next((g for g, of in groups.items() if set(of) == set(names)), None)
        yield group or ", ".join(names), goal


def mermaid(plan: Plan) -> str:
    """Return the state machines as one `stateDiagram-v2`, each in its own box."""
    lines = ["---", f"title: {plan.mission}", "---", "stateDiagram-v2"]
    for number, drawing in enumerate(drawings(plan), start=1):
        prefix = f"m{number}"
        ids = {box.name: f"{prefix}s{index}" for index, box in enumerate(drawing.boxes, start=1)}
        lines += [f'  state "{drawing.title}" as {prefix} {{', f"    [*] --> {ids[drawing.begin]}"]
        for box in drawing.boxes:
            label = _escaped(f"{box.name}<br>{box.part}{', ' if box.flight else ''}{box.flight}")
            lines.append(f'    state "{label}" as {ids[box.name]}')
        for edge in drawing.edges:
            label = "asks" if edge.is_request else _escaped("<br>".join(edge.labels))
            lines.append(f"    {ids[edge.source]} --> {ids[edge.target]} : {label}")
        lines.append("  }")
        if asking := ",".join(ids[box.name] for box in drawing.boxes if box.is_asker):
            lines += [
                f"  classDef asks{prefix} fill: #efe9f6, stroke: #8468ad, stroke-dasharray: 2",
                f"  class {asking} asks{prefix}",
            ]
        if built_in := ",".join(ids[box.name] for box in drawing.boxes if box.is_built_in):
            lines += [
                f"  classDef builtIn{prefix} stroke-dasharray: 4, fill: none",
                f"  class {built_in} builtIn{prefix}",
            ]
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    """Return text for a label of Mermaid, in which only our line breaks remain markup."""
    escapes = {"#": "#35;", '"': "#quot;", "<": "#lt;", ">": "#gt;", ":": "#58;", ";": "#59;"}
    return "<br>".join("".join(escapes.get(c, c) for c in line) for line in text.split("<br>"))
