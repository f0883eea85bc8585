"""One vehicle of the resolved mission as YAML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from kybflow.core.params import fields_of
from kybflow.core.units import ANGLE, DURATION, LENGTH
from kybflow.dsl.document import (
    ChainEntry,
    EstimatorEntry,
    StateEntry,
    TransitionEntry,
    VehicleEntry,
)
from kybflow.dsl.schema.world import AirframeCameraParams
from kybflow.dsl.writing.values import (
    YamlLine,
    given,
    goal,
    origin,
    part,
    place,
    quantity,
    quoted,
    value,
    vector,
    way,
    written_fields,
)
from kybflow.world.vehicle_context import Airframe, Parcel


def vehicle_lines(vehicle: VehicleEntry) -> Iterator[YamlLine]:
    """The vehicle under `vehicles:`, whole."""
    at = {key: span.at for key, span in vehicle.spans.items()}
    yield f"  {vehicle.name.text}:", vehicle.span.at
    yield "    airframe:", at.get("airframe", "")
    for field in fields_of(Airframe):
        own = getattr(vehicle.airframe, field.name)
        if own is not None:
            came_from = place(vehicle.airframe_spans.get(field.name))
            yield f"      {field.name}: {value(own, field)}", came_from
    if vehicle.cameras:
        yield "      cameras:", place(vehicle.airframe_spans.get("cameras"))
    for camera in vehicle.cameras:
        fields = ", ".join(written_fields(camera.params, fields_of(AirframeCameraParams)))
        yield f"        {camera.name.text}: {{{fields}}}", camera.span.at
    start, heading = vector(vehicle.start, LENGTH), quantity(vehicle.heading, ANGLE)
    came_from = at["start"] + given("at", vehicle.start_span) if "start" in at else ""
    yield f"    start: {{at: {start}, heading: {heading}}}", came_from
    if vehicle.home is not None:
        yield f"    home: {vector(vehicle.home, LENGTH)}", place(vehicle.home_span)
    if vehicle.payload is not None:
        carried = ", ".join(written_fields(vehicle.payload, fields_of(Parcel)))
        yield f"    payload: {{{carried}}}", at.get("payload", "")
    estimators = [(_estimator(e), origin(e.part)) for e in vehicle.estimators]
    yield from _list("estimators", estimators, at)
    yield from _list("processors", [(part(p), origin(p)) for p in vehicle.processors], at)
    tracker = vehicle.own_tracker or vehicle.tracker
    yield f"    tracker: {part(tracker)}", origin(tracker)
    watched = [(part(s), "" if s.span == vehicle.span else origin(s)) for s in vehicle.supervisors]
    yield from _list("supervisors", watched, at)
    begin = vehicle.begin.span.at if "begin" in at else ""
    yield f"    begin: {vehicle.begin.text}", begin
    yield "    behaviors:", at.get("behaviors", "")
    for state in vehicle.states.values():
        for chain in vehicle.chains.values():
            if chain.transitions and vehicle.goal(chain.name.text) == state.name.text:
                yield f"      {chain.name.text}: {_chain(chain)}", chain.span.at
        yield f"      {state.name.text}: {_state(state)}", _origin(state)


def _list(key: str, items: Sequence[YamlLine], origins: dict[str, str]) -> Iterator[YamlLine]:
    yield f"    {key}:{'' if items else ' []'}", origins.get(key, "")
    for text, came_from in items:
        yield f"      - {text}", came_from


def _origin(state: StateEntry) -> str:
    limits = (("within", a.span) for a in state.transitions if a.cause == "within" and not a.since)
    return place(state.span) + origin(state.part, *limits).removeprefix(state.part.span.at)


def _estimator(estimator: EstimatorEntry) -> str:
    more = [f"recover_after: {quantity(estimator.recover_after, DURATION)}"]
    if estimator.healthy is not None:
        more.insert(0, f"healthy: {quoted(estimator.healthy.text)}")
    if estimator.for_at_most is not None:
        more.append(f"for_at_most: {quantity(estimator.for_at_most, DURATION)}")
    return part(estimator.part, more=tuple(more))


def _state(state: StateEntry) -> str:
    own = [transition for transition in state.transitions if not transition.since]
    first = ", ".join(name.text for name in state.estimators)
    more = (f"estimators: [{first}]",) if first else ()
    return part(state.part, "do", (*more, *_transitions(own)))


def _chain(chain: ChainEntry) -> str:
    return "{" + ", ".join(_transitions(chain.transitions)) + "}"


def _transitions(transitions: Sequence[TransitionEntry]) -> Iterator[str]:
    ways = [way(transition) for transition in transitions if transition.cause == "next"]
    if ways:
        yield f"next: [{', '.join(ways)}]"
    for transition in transitions:
        if transition.cause in ("then", "failed"):
            yield f"{transition.cause}: {goal(transition)}"
        elif transition.cause == "within" and transition.after is not None:
            yield f"within: {quantity(transition.after, DURATION)}"
