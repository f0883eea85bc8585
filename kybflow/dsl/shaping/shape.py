"""The tree after `resolve` to the typed document: SI values, parts with their parameters, a span on
everything."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from kybflow.core.units import DURATION, FREQUENCY, Dimension
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, has_errors
from kybflow.dsl.document import AirframeUse, Document, PartUse, Vehicle
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, entries_of, items_of
from kybflow.dsl.reading.source import Span, Text
from kybflow.dsl.reading.values import decode, quantity_field
from kybflow.dsl.resolving.points import placed, with_points
from kybflow.dsl.resolving.resolve import Resolved
from kybflow.dsl.shaping.asked import with_asked
from kybflow.dsl.shaping.callbacks import callbacks
from kybflow.dsl.shaping.faults import faults_of
from kybflow.dsl.shaping.flows import flows_of, groups_of, with_waiting
from kybflow.dsl.shaping.rates import needed_rate
from kybflow.dsl.shaping.sensors import with_sensors
from kybflow.dsl.shaping.targets import drivers_of, other_targets, target_of, with_trackers
from kybflow.dsl.shaping.uses import Uses
from kybflow.dsl.shaping.vehicles import Vehicles
from kybflow.dsl.shaping.world.cameras import cameras_of, without_cameras
from kybflow.dsl.shaping.world.world import world_of
from kybflow.world.vehicle_context import Airframe

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

CODES = {
    "KYB152": "A control rate that is no whole number of Hz, or one that nothing flies with.",
}
LEAST_CONTROL, MOST_CONTROL = 25, 1000
HOVER_LIMIT = 30.0
TIME_LIMIT = 600.0
_LACKING = frozenset({"KYB108", "KYB385"})


def shape(
    resolved: Resolved, catalog: Catalog, target: str | None, found: list[Diagnostic]
) -> Document | None:
    """The document; None when a vehicle, a part or a value has errors."""
    world = world_of(resolved.root.get("world"), found)
    root = resolved.root
    if resolved.names_points:
        root = with_points(root, world.points, found)
    uses = Uses(catalog, found, resolved.chains)
    name = target_of(root, target, uses)
    drivers = drivers_of(root, name, uses)
    found += other_targets(root, name, catalog)
    vehicles = _vehicles(root, drivers, Vehicles(uses))
    vehicles = with_trackers(root, name, uses, with_sensors(root, name, uses, vehicles))
    document = Document(
        mission=_text(root, "mission"),
        summary=_text(root, "summary").text,
        target=name,
        parameters=placed(resolved.parameters, world.points),
        fence=world.fence,
        control_rate=_control(root, needed_rate(v.driver for v in vehicles.values()), found),
        control_span=_span_of(root.get("control")),
        hover_limit=_duration(root, "hover_limit", HOVER_LIMIT, found),
        time_limit=_duration(root, "time_limit", TIME_LIMIT, found),
        vehicles=vehicles,
        expect=tuple(
            item.as_text for item in items_of(root.get("expect")) if isinstance(item, Scalar)
        ),
        airframes=tuple(airframes_of(root, catalog, found)),
        spans=_spans(root),
        points=world.points,
        point_spans=world.point_spans,
        obstacles=world.obstacles,
        tags=world.tags,
        groups=groups_of(root.get("groups")),
        group_spans={n: e.key.span for n, e in entries_of(root.get("groups")).items()},
        flows=flows_of(root.get("flows"), found),
        callbacks=callbacks(root.get("on"), uses),
        faults=faults_of(root.get("faults"), uses),
    )
    return None if has_errors(found) else with_asked(with_waiting(document))


def _spans(root: Mapping) -> dict[str, Span]:
    """The span of each key of the top level, and of the fence."""
    fence = entries_of(root.get("world")).get("fence")
    spans = {key: entry.key.span for key, entry in root.entries.items()}
    return spans if fence is None else {**spans, "fence": fence.key.span}


def _text(root: Mapping, key: str) -> Text:
    node = root.get(key)
    return node.as_text if isinstance(node, Scalar) else Text("", root.span)


def _span_of(node: Node | None) -> Any:
    return None if node is None else node.span


def _duration(root: Mapping, key: str, default: float, found: list[Diagnostic]) -> float:
    value: float = _quantity(root.get(key), key, DURATION, default, found)
    return value


def _quantity(
    node: Node | None, key: str, dimension: Dimension, default: Any, found: list[Diagnostic]
) -> Any:
    if node is None:
        return default
    value = decode(node, quantity_field(key, dimension, above=0.0), found)
    return default if value is None else value


def _control(root: Mapping, needed: int, found: list[Diagnostic]) -> int:
    node = root.get("control")
    rate: float = _quantity(node, "control", FREQUENCY, float(needed), found)
    if node is not None and not rate.is_integer():
        message = f"`control` must be a whole number of Hz, but this is {rate:g} Hz"
        found.append(Diagnostic("KYB152", message, node.span))
    elif node is not None and not LEAST_CONTROL <= rate <= MOST_CONTROL:
        message = f"`control` can't be {rate:g} Hz"
        hint = f"fly with {LEAST_CONTROL} to {MOST_CONTROL} Hz: below, no tracker holds a vehicle"
        found.append(Diagnostic("KYB152", message, node.span, help=hint))
    return int(rate)


def airframes_of(root: Mapping, catalog: Catalog, found: list[Diagnostic]) -> Iterator[AirframeUse]:
    """Those of the file itself. One that lacks something may be there to start from."""
    for entry in entries_of(root.get("airframes")).values():
        body, findings = entry.value, list[Diagnostic]()
        assert isinstance(body, Mapping)
        own = without_cameras(body)
        airframe = Uses(catalog, findings).params(Airframe, own, "airframe", entry.key.span)
        list(cameras_of(body, findings))
        found += [finding for finding in findings if finding.code not in _LACKING]
        if airframe is not None:
            spans = {key: value.value.span for key, value in own.entries.items()}
            yield AirframeUse(entry.key.as_text, airframe, spans)


def _vehicles(root: Mapping, drivers: dict[str, PartUse], vehicles: Vehicles) -> dict[str, Vehicle]:
    decoded: dict[str, Vehicle] = {}
    for name, entry in entries_of(root.get("vehicles")).items():
        vehicle = vehicles.one(entry, drivers.get(name))
        if vehicle is not None:
            decoded[name] = vehicle
    return decoded
