"""The tree after `resolve` to the typed document: SI values, parts with their parameters, a span on
everything."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kybflow.core.units import DURATION, FREQUENCY, Dimension
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, collect, passed
from kybflow.dsl.diagnostics.spans import Span, Text
from kybflow.dsl.document import AirframeEntry, Document, PartUse, VehicleEntry
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, entries_of, items_of
from kybflow.dsl.reading.values import decode, quantity_field
from kybflow.dsl.resolving.resolve import Resolved
from kybflow.dsl.schema.judge import misplaced
from kybflow.dsl.shaping.callbacks import callbacks, faults_of
from kybflow.dsl.shaping.cameras import cameras_of, without_cameras
from kybflow.dsl.shaping.flows import flows_of, groups_of, with_requests, with_waiting
from kybflow.dsl.shaping.inputs import inputs_of
from kybflow.dsl.shaping.parts import PartDecoder, params_of
from kybflow.dsl.shaping.targets import (
    drivers_of,
    needed_rate,
    other_targets,
    target_of,
    with_sensors,
    with_trackers,
)
from kybflow.dsl.shaping.vehicles import vehicle_of
from kybflow.dsl.shaping.world import with_coordinates, with_points, world_of
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


def shape(resolved: Resolved, catalog: Catalog, target: str | None) -> Diagnosed[Document]:
    """The document. Raises Stopped when a vehicle, a part or a value has errors."""
    document = yield from passed(_document(resolved, catalog, target))
    return with_requests(with_waiting(document))


def _document(resolved: Resolved, catalog: Catalog, target: str | None) -> Diagnosed[Document]:
    world = yield from world_of(resolved.root.get("world"))
    root = resolved.root
    if resolved.names_points:
        root = yield from with_points(root, world.points)
    if root is not resolved.root or resolved.has_positions:
        yield from passed(_placed(root, None if resolved.has_positions else resolved.root))
    uses = PartDecoder(catalog, resolved.chains)
    name = yield from target_of(root, target, uses)
    drivers = yield from drivers_of(root, name, uses)
    yield from other_targets(root, name, catalog)
    vehicles = yield from _vehicles(root, drivers, uses)
    vehicles = yield from with_sensors(root, name, uses, vehicles)
    vehicles = yield from with_trackers(root, name, uses, vehicles)
    rate = needed_rate(vehicle.driver for vehicle in vehicles.values())
    return Document(
        mission=_text(root, "mission"),
        summary=_text(root, "summary").text,
        target=name,
        parameters=with_coordinates(resolved.parameters, world.points),
        fence=world.fence,
        control_rate=(yield from _control(root, rate)),
        control_span=_span_of(root.get("control")),
        hover_limit=(yield from _quantity(root, "hover_limit", DURATION, HOVER_LIMIT)),
        time_limit=(yield from _quantity(root, "time_limit", DURATION, TIME_LIMIT)),
        vehicles=vehicles,
        expect=tuple(
            item.as_text for item in items_of(root.get("expect")) if isinstance(item, Scalar)
        ),
        airframes=(yield from airframes_of(root)),
        spans=_spans(root),
        points=world.points,
        point_spans=world.point_spans,
        obstacles=world.obstacles,
        moving=world.moving,
        tags=world.tags,
        groups=groups_of(root.get("groups")),
        group_spans={n: e.key.span for n, e in entries_of(root.get("groups")).items()},
        flows=(yield from flows_of(root.get("flows"))),
        inputs=(yield from inputs_of(root, name, uses)),
        callbacks=(yield from callbacks(root.get("on"), uses)),
        faults=(yield from faults_of(root.get("faults"), uses)),
    )


def _placed(root: Mapping, before: Mapping | None) -> Diagnosed[None]:
    yield from misplaced(root, before)


def _spans(root: Mapping) -> dict[str, Span]:
    """The span of each key of the top level, of the fence and of the world's tags."""
    world = entries_of(root.get("world"))
    spans = {key: entry.key.span for key, entry in root.entries.items()}
    return spans | {key: world[key].key.span for key in ("fence", "tags") if key in world}


def _text(root: Mapping, key: str) -> Text:
    node = root.get(key)
    return node.as_text if isinstance(node, Scalar) else Text("", root.span)


def _span_of(node: Node | None) -> Any:
    return None if node is None else node.span


def _quantity(root: Mapping, key: str, dimension: Dimension, default: float) -> Diagnosed[float]:
    node, field = root.get(key), quantity_field(key, dimension, above=0.0)
    value: float | None = None if node is None else (yield from decode(node, field))
    return default if value is None else value


def _control(root: Mapping, needed: int) -> Diagnosed[int]:
    node = root.get("control")
    rate = yield from _quantity(root, "control", FREQUENCY, float(needed))
    if node is not None and not rate.is_integer():
        message = f"`control` must be a whole number of Hz, but this is {rate:g} Hz"
        yield Diagnostic("KYB152", message, node.span)
    elif node is not None and not LEAST_CONTROL <= rate <= MOST_CONTROL:
        message = f"`control` can't be {rate:g} Hz"
        hint = f"fly with {LEAST_CONTROL} to {MOST_CONTROL} Hz: below, no tracker holds a vehicle"
        yield Diagnostic("KYB152", message, node.span, help=hint)
    return int(rate)


def airframes_of(root: Mapping) -> Diagnosed[tuple[AirframeEntry, ...]]:
    """The airframes that the file itself describes. An incomplete one is no mistake: others may
    start from it."""
    airframes: list[AirframeEntry] = []
    for entry in entries_of(root.get("airframes")).values():
        assert isinstance(entry.value, Mapping)
        own = without_cameras(entry.value)
        airframe, found = collect(params_of(Airframe, own, "airframe", entry.key.span))
        found += collect(cameras_of(entry.value)).diagnostics
        yield from (finding for finding in found if finding.code not in _LACKING)
        if airframe is not None:
            spans = {key: value.value.span for key, value in own.entries.items()}
            airframes.append(AirframeEntry(entry.key.as_text, airframe, spans))
    return tuple(airframes)


def _vehicles(
    root: Mapping, drivers: dict[str, PartUse], uses: PartDecoder
) -> Diagnosed[dict[str, VehicleEntry]]:
    decoded: dict[str, VehicleEntry] = {}
    for name, entry in entries_of(root.get("vehicles")).items():
        vehicle = yield from vehicle_of(entry, drivers.get(name), uses)
        if vehicle is not None:
            decoded[name] = vehicle
    return decoded
