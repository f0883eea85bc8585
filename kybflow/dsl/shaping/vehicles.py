"""One vehicle of the tree to one of the document: its airframe, its chain of parts, its states."""

from __future__ import annotations

from typing import Any

from kybflow.core.geometry import ZERO
from kybflow.core.units import ANGLE, LENGTH
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, every
from kybflow.dsl.diagnostics.spans import Span, Text
from kybflow.dsl.document import EstimatorEntry, PartUse, VehicleEntry
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Scalar, entries_of
from kybflow.dsl.reading.values import decode, quantity_field
from kybflow.dsl.schema.mission import ESTIMATOR_KEYS
from kybflow.dsl.shaping.cameras import cameras_of, without_cameras
from kybflow.dsl.shaping.parts import PartDecoder, params_of
from kybflow.dsl.shaping.states import States, duration, states_of
from kybflow.world.vehicle_context import Airframe, Parcel


def vehicle_of(
    entry: MappingEntry, driver: PartUse | None, uses: PartDecoder
) -> Diagnosed[VehicleEntry | None]:
    """The vehicle; None when it has errors."""
    name, body = entry.key, entry.value
    assert isinstance(body, Mapping)
    airframe = yield from _airframe(name, body)
    start, heading, start_span = yield from _start(name, body)
    estimators = yield from _estimators(body, uses)
    processors = yield from uses.many("processors", body.get("processors"))
    tracker = yield from _tracker(name, body, uses)
    states = yield from _states(name, body, uses)
    supervisors = yield from _supervisors(body, name.span, uses)
    begin, home = _begin(body, states), body.get("home")
    if airframe is None or tracker is None or driver is None or begin is None:
        return None
    home_at = quantity_field("home", LENGTH, "vector")
    return VehicleEntry(
        name=name.as_text,
        airframe=airframe,
        start=start,
        start_span=start_span,
        heading=heading,
        estimators=estimators,
        processors=tuple(use for use, _ in processors),
        tracker=tracker,
        supervisors=supervisors,
        driver=driver,
        begin=begin,
        states=states.states,
        span=name.span,
        airframe_spans={key: e.value.span for key, e in entries_of(body.get("airframe")).items()},
        home=None if home is None else (yield from decode(home, home_at)),
        home_span=None if home is None else home.span,
        spans={**{key: e.key.span for key, e in body.entries.items()}, **_heading_span(body)},
        chains=states.chains,
        cameras=(yield from cameras_of(body.get("airframe"))),
        payload=(yield from _payload(body)),
    )


def _missing(name: Scalar, key: str, help: str) -> Diagnostic:
    message = f"the vehicle `{name.text}` needs `{key}`"
    return Diagnostic("KYB102", message, name.span, help=help)


def _airframe(name: Scalar, body: Mapping) -> Diagnosed[Airframe | None]:
    node = body.get("airframe")
    if not isinstance(node, Mapping):
        yield _missing(name, "airframe", "name one: `airframe: std.mk_quadro`")
        return None
    head = body.entries["airframe"].key.span
    return (yield from params_of(Airframe, without_cameras(node), "airframe", head))


def _payload(body: Mapping) -> Diagnosed[Parcel | None]:
    node = body.get("payload")
    if not isinstance(node, Mapping):
        return None
    return (yield from params_of(Parcel, node, "payload", body.entries["payload"].key.span))


def _start(name: Scalar, body: Mapping) -> Diagnosed[tuple[Any, float, Span]]:
    node = body.get("start")
    if not isinstance(node, Mapping):
        return ZERO, 0.0, name.span
    place, turn = node.get("at"), node.get("heading")
    at, angle = quantity_field("at", LENGTH, "vector"), quantity_field("heading", ANGLE)
    start = ZERO if place is None else (yield from decode(place, at))
    heading = 0.0 if turn is None else (yield from decode(turn, angle))
    return start, heading or 0.0, node.span if place is None else place.span


def _heading_span(body: Mapping) -> dict[str, Span]:
    start = body.get("start")
    turn = start.get("heading") if isinstance(start, Mapping) else None
    return {} if turn is None else {"heading": turn.span}


def _tracker(name: Scalar, body: Mapping, uses: PartDecoder) -> Diagnosed[PartUse | None]:
    node = body.get("tracker")
    if node is None:
        yield _missing(name, "tracker", "name one: `tracker: cascade`")
        return None
    return (yield from uses.one("trackers", node))


def _estimators(body: Mapping, uses: PartDecoder) -> Diagnosed[tuple[EstimatorEntry, ...]]:
    several = yield from uses.many("estimators", body.get("estimators"), frozenset(ESTIMATOR_KEYS))
    decoded = []
    for use, node in several:
        keys = node if isinstance(node, Mapping) else Mapping({}, node.span)
        healthy = keys.get("healthy")
        recover = yield from duration(keys, "recover_after")
        limit = yield from duration(keys, "for_at_most", above=0.0)
        text = healthy.as_text if isinstance(healthy, Scalar) else None
        decoded.append(EstimatorEntry(use, text, recover or 0.0, limit))
    return tuple(decoded)


def _supervisors(body: Mapping, span: Span, uses: PartDecoder) -> Diagnosed[tuple[PartUse, ...]]:
    """The supervisors that are written, then those that every vehicle has."""
    written = [use for use, _ in (yield from uses.many("supervisors", body.get("supervisors")))]
    names = {use.name.text for use in written}
    specs = (s for s in uses.catalog.always("supervisors") if s.name not in names)
    always = yield from every(uses.one("supervisors", Scalar(s.name, span)) for s in specs)
    return (*written, *(use for use in always if use is not None))


def _states(name: Scalar, body: Mapping, uses: PartDecoder) -> Diagnosed[States]:
    behaviors = body.get("behaviors")
    if not isinstance(behaviors, Mapping) or not behaviors.entries:
        yield _missing(name, "behaviors", "a vehicle does one thing at least")
        behaviors = Mapping({}, name.span)
    elif body.entries["behaviors"].inherited:
        own = {k: e._replace(inherited=True) for k, e in behaviors.entries.items()}
        behaviors = Mapping(own, behaviors.span)
    return (yield from states_of(behaviors, uses))


def _begin(body: Mapping, states: States) -> Text | None:
    """The first state: the one that is named, else the topmost."""
    begin = body.get("begin")
    if isinstance(begin, Scalar):
        return states.goal(begin.as_text)[0]
    return next((state.name for state in states.states.values()), None)
