"""The mission after everything, as YAML: no import, no `like`, no parameter, every default written,
and where each line came from. Reading it back gives the same plan."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from kybflow.dsl.document import Document, EstimatorUse, PartUse, State, Transition, Vehicle
from kybflow.dsl.source import Span, Text
from kybflow.params import Field, fields_of
from kybflow.site import Airframe
from kybflow.units import ANGLE, DURATION, FREQUENCY, LENGTH, Dimension

Line = tuple[str, str]
"""A line of YAML, and where it came from; empty for a default."""
_PLAIN_FIRST = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ")


def written(document: Document) -> str:
    """The text, each line with its origin as a comment."""
    lines = list(_mission(document))
    width = min(max(len(line) for line, _ in lines), 76)
    return "".join(
        f"{line:<{width}}  # {origin or 'default'}\n" if line.strip() else "\n"
        for line, origin in lines
    )


def _mission(document: Document) -> Iterator[Line]:
    at = document.mission.span.at
    yield "kybflow: 1", document.spans["kybflow"].at
    yield f"mission: {_quoted(document.mission.text)}", at
    if document.summary:
        yield f"summary: {_quoted(document.summary)}", at
    origin = {key: span.at for key, span in document.spans.items()}
    rate = _quantity(float(document.control_rate), FREQUENCY)
    yield f"control: {rate}", origin.get("control", "")
    yield f"hover_limit: {_quantity(document.hover_limit, DURATION)}", origin.get("hover_limit", "")
    yield f"time_limit: {_quantity(document.time_limit, DURATION)}", origin.get("time_limit", "")
    if document.fence is not None:
        low, high = (_vector(corner, LENGTH) for corner in document.fence)
        yield "world:", origin.get("world", "")
        yield f"  fence: {{from: {low}, to: {high}}}", origin.get("world", "")
    yield "vehicles:", origin.get("vehicles", "")
    for vehicle in document.vehicles.values():
        yield from _vehicle(vehicle)
    if document.expect:
        yield "expect:", origin.get("expect", "")
        for text in document.expect:
            yield f"  - {_quoted(text.text)}", text.span.at
    yield "targets:", origin.get("targets", "")
    yield f"  {document.target.text}:", origin.get("targets", "")
    for name, vehicle in document.vehicles.items():
        at = vehicle.driver.span.at if "targets" in document.spans else ""
        yield f"    {name}: {{driver: {_use(vehicle.driver)}}}", at


def _vehicle(vehicle: Vehicle) -> Iterator[Line]:
    at = vehicle.span.at
    yield f"  {vehicle.name.text}:", at
    yield "    airframe:", at
    for field in fields_of(Airframe):
        value = getattr(vehicle.airframe, field.name)
        span = vehicle.airframe_spans.get(field.name)
        yield f"      {field.name}: {_value(value, field)}", span.at if span else ""
    place = _vector(vehicle.start, LENGTH)
    heading = _quantity(vehicle.heading, ANGLE)
    yield f"    start: {{at: {place}, heading: {heading}}}", vehicle.start_span.at
    yield from _list("estimators", [(_estimator(e), e.part.span) for e in vehicle.estimators])
    yield from _list("processors", [(_use(p), p.span) for p in vehicle.processors])
    yield f"    tracker: {_use(vehicle.tracker)}", vehicle.tracker.span.at
    yield from _list(
        "supervisors",
        [(_use(s), None if s.span == vehicle.span else s.span) for s in vehicle.supervisors],
    )
    yield f"    begin: {vehicle.begin.text}", vehicle.begin.span.at
    yield "    behaviors:", at
    for state in vehicle.states.values():
        yield f"      {state.name.text}: {_state(state)}", state.span.at


def _list(key: str, items: Sequence[tuple[str, Span | None]]) -> Iterator[Line]:
    yield f"    {key}:{'' if items else ' []'}", ""
    for text, span in items:
        yield f"      - {text}", span.at if span else ""


def _use(use: PartUse, word: str = "use", more: tuple[str, ...] = ()) -> str:
    pairs = [f"{word}: {use.spec.name}"]
    if word == "use" and use.label != use.spec.name:
        pairs.append(f"as: {use.label}")
    for field in use.spec.fields:
        value = getattr(use.params, field.name)
        if value is not None:
            pairs.append(f"{field.name}: {_value(value, field)}")
    return "{" + ", ".join((*pairs, *more)) + "}"


def _estimator(estimator: EstimatorUse) -> str:
    more = [f"recover_after: {_quantity(estimator.recover_after, DURATION)}"]
    if estimator.healthy is not None:
        more.insert(0, f"healthy: {_quoted(estimator.healthy.text)}")
    if estimator.for_at_most is not None:
        more.append(f"for_at_most: {_quantity(estimator.for_at_most, DURATION)}")
    return _use(estimator.part, more=tuple(more))


def _state(state: State) -> str:
    more = []
    ways = [_way(t) for t in state.transitions if t.cause == "next"]
    if ways:
        more.append(f"next: [{', '.join(ways)}]")
    for arrow in state.transitions:
        if arrow.cause in ("then", "failed"):
            more.append(f"{arrow.cause}: {arrow.target.text}")
        elif arrow.cause == "within" and arrow.after is not None:
            more.append(f"within: {_quantity(arrow.after, DURATION)}")
    return _use(state.part, "do", tuple(more))


def _way(arrow: Transition) -> str:
    texts: tuple[tuple[str, Text | None], ...] = (("when", arrow.when), ("event", arrow.event))
    pairs = [f"{key}: {_quoted(text.text)}" for key, text in texts if text is not None]
    if arrow.after is not None:
        pairs.append(f"after: {_quantity(arrow.after, DURATION)}")
    if arrow.hold:
        pairs.append(f"for: {_quantity(arrow.hold, DURATION)}")
    pairs.append(f"go: {arrow.target.text}")
    return "{" + ", ".join(pairs) + "}"


def _value(value: Any, field: Field) -> str:
    if field.shape == "path" and field.dimension is not None:
        return "[" + ", ".join(_vector(point, field.dimension) for point in value) + "]"
    if field.shape == "vector" and field.dimension is not None:
        return _vector(value, field.dimension)
    if field.shape == "scalar" and field.dimension is not None:
        return _quantity(value, field.dimension)
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value) if field.shape == "integer" else _quoted(str(value))


def _vector(value: tuple[float, ...], dimension: Dimension) -> str:
    return "[" + ", ".join(_quantity(number, dimension) for number in value) + "]"


def _quantity(value: float, dimension: Dimension) -> str:
    """The exact value in SI, with its unit."""
    number = f"{value:g}" if float(f"{value:g}") == value else repr(value)
    return f"{number} {dimension.si}".rstrip()


def _quoted(text: str) -> str:
    """Text that YAML reads as itself, everywhere."""
    if text[:1] in _PLAIN_FIRST and text.replace("_", "").isalnum() and text not in _RESERVED:
        return text
    return "'" + text.replace("'", "''").replace("\n", " ") + "'"


_RESERVED = frozenset({"true", "false", "null", "True", "False", "Null", "yes", "no", "on", "off"})
