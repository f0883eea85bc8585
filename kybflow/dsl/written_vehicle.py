"""One vehicle of the resolved mission."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from kybflow.dsl.camera_params import CameraParams
from kybflow.dsl.document import ChainUse, EstimatorUse, State, Transition, Vehicle
from kybflow.dsl.source import Span
from kybflow.dsl.written_values import (
    Line,
    goal,
    part,
    place,
    quantity,
    quoted,
    value,
    vector,
    way,
    written_fields,
)
from kybflow.params import fields_of
from kybflow.site import Airframe, Parcel
from kybflow.units import ANGLE, DURATION, LENGTH


def vehicle_lines(vehicle: Vehicle) -> Iterator[Line]:
    """The vehicle under `vehicles:`, whole."""
    at = {key: span.at for key, span in vehicle.spans.items()}
    yield f"  {vehicle.name.text}:", vehicle.span.at
    yield "    airframe:", at.get("airframe", "")
    for field in fields_of(Airframe):
        own = value(getattr(vehicle.airframe, field.name), field)
        yield f"      {field.name}: {own}", place(vehicle.airframe_spans.get(field.name))
    if vehicle.cameras:
        yield "      cameras:", place(vehicle.airframe_spans.get("cameras"))
    for camera in vehicle.cameras:
        fields = ", ".join(written_fields(camera.params, fields_of(CameraParams)))
        yield f"        {camera.name.text}: {{{fields}}}", camera.span.at
    start, heading = vector(vehicle.start, LENGTH), quantity(vehicle.heading, ANGLE)
    yield f"    start: {{at: {start}, heading: {heading}}}", at.get("start", "")
    if vehicle.home is not None:
        yield f"    home: {vector(vehicle.home, LENGTH)}", at.get("home", "")
    if vehicle.payload is not None:
        carried = ", ".join(written_fields(vehicle.payload, fields_of(Parcel)))
        yield f"    payload: {{{carried}}}", at.get("payload", "")
    estimators = [(_estimator(e), e.part.span) for e in vehicle.estimators]
    yield from _list("estimators", estimators, at)
    yield from _list("processors", [(part(p), p.span) for p in vehicle.processors], at)
    yield f"    tracker: {part(vehicle.tracker)}", vehicle.tracker.span.at
    watched = [(s, None if s.span == vehicle.span else s.span) for s in vehicle.supervisors]
    yield from _list("supervisors", [(part(s), span) for s, span in watched], at)
    begin = vehicle.begin.span.at if "begin" in at else ""
    yield f"    begin: {vehicle.begin.text}", begin
    yield "    behaviors:", at.get("behaviors", "")
    for state in vehicle.states.values():
        for chain in vehicle.chains.values():
            if chain.transitions and vehicle.goal(chain.name.text) == state.name.text:
                yield f"      {chain.name.text}: {_chain(chain)}", chain.span.at
        yield f"      {state.name.text}: {_state(state)}", state.span.at


def _list(
    key: str, items: Sequence[tuple[str, Span | None]], origins: dict[str, str]
) -> Iterator[Line]:
    yield f"    {key}:{'' if items else ' []'}", origins.get(key, "")
    for text, span in items:
        yield f"      - {text}", place(span)


def _estimator(estimator: EstimatorUse) -> str:
    more = [f"recover_after: {quantity(estimator.recover_after, DURATION)}"]
    if estimator.healthy is not None:
        more.insert(0, f"healthy: {quoted(estimator.healthy.text)}")
    if estimator.for_at_most is not None:
        more.append(f"for_at_most: {quantity(estimator.for_at_most, DURATION)}")
    return part(estimator.part, more=tuple(more))


def _state(state: State) -> str:
    own = [arrow for arrow in state.transitions if not arrow.since]
    first = ", ".join(name.text for name in state.estimators)
    more = (f"estimators: [{first}]",) if first else ()
    return part(state.part, "do", (*more, *_arrows(own)))


def _chain(chain: ChainUse) -> str:
    return "{" + ", ".join(_arrows(chain.transitions)) + "}"


def _arrows(arrows: Sequence[Transition]) -> Iterator[str]:
    ways = [way(arrow) for arrow in arrows if arrow.cause == "next"]
    if ways:
        yield f"next: [{', '.join(ways)}]"
    for arrow in arrows:
        if arrow.cause in ("then", "failed"):
            yield f"{arrow.cause}: {goal(arrow)}"
        elif arrow.cause == "within" and arrow.after is not None:
            yield f"within: {quantity(arrow.after, DURATION)}"
