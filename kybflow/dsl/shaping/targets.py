"""Where the mission flies: the chosen target, each vehicle's driver, tracker and sensors on it, and
the control rate that the drivers need."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from kybflow.core.errors import KybflowError
from kybflow.core.signals import MeasurementKind
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, Severity, collect, every
from kybflow.dsl.diagnostics.spans import Span, Text
from kybflow.dsl.document import PartUse, SensorEntry, VehicleEntry
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    entries_of,
    is_null,
    items_of,
)
from kybflow.dsl.shaping.inputs import other_inputs
from kybflow.dsl.shaping.parts import PartDecoder

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

CODES = {
    "KYB150": "A target that the mission doesn't have.",
    "KYB151": "A target that names a vehicle which doesn't exist, or leaves one without a driver.",
    "KYB390": "A sensor under a name that no estimator of the vehicle has.",
}
_NOT_HERE = frozenset({"KYB140", "KYB141", "KYB370"})
FILE = "--target"
"""The name of the file that the span of an unknown target points into."""


def target_of(root: Mapping, target: str | None, uses: PartDecoder) -> Diagnosed[Text]:
    """The target to fly on: `sim` unless another is asked for."""
    mission = root.entries["mission"].key.span
    entries = entries_of(root.get("targets"))
    name = target or "sim"
    if name in entries:
        return entries[name].key.as_text
    implied = {} if name == "sim" else implied_targets(uses.catalog)
    if name != "sim" and name not in implied:
        known = {*entries, *implied, "sim"}
        message = f"the mission has no target `{name}`"
        asked = Span(FILE, 1, 1, 1, len(name) + 1)
        yield Diagnostic("KYB150", message, asked, help=did_you_mean(name, known))
    return Text(name, mission, verbatim=False)


def implied_targets(catalog: Catalog) -> dict[str, tuple[str, dict[str, str]]]:
    """The targets that every mission has beside `sim`, each with its driver and that one's
    parameters as they would be written. Imports every driver."""
    found: dict[str, tuple[str, dict[str, str]]] = {}
    for name in catalog.names("drivers"):
        try:
            targets = catalog.get("drivers", name).cls.targets
        except (KybflowError, ImportError):  # told where it is used
            continue
        for target, values in targets.items():
            found.setdefault(target, (name, {key: _written(v) for key, v in values.items()}))
    return found


def _written(value: str | bool) -> str:
    return str(value).lower() if isinstance(value, bool) else value


def drivers_of(root: Mapping, target: Text, uses: PartDecoder) -> Diagnosed[dict[str, PartUse]]:
    """The driver of each vehicle on `target`: its own entry, else that of `all`, else the one that
    the target's name implies."""
    vehicles = entries_of(root.get("vehicles"))
    targets = entries_of(root.get("targets"))
    entries = entries_of(targets[target.text].value) if target.text in targets else {}
    decoded = yield from _decoded_drivers(entries, vehicles, uses)
    if "all" not in decoded and not vehicles.keys() <= decoded.keys():
        implied = yield from _implied(target, uses)
        if implied is not None:
            decoded["all"] = implied
    drivers: dict[str, PartUse] = {}
    for name in vehicles:
        driver = decoded.get(name, decoded.get("all"))
        if driver is not None:
            drivers[name] = driver
        elif target.text in targets and name not in decoded and "all" not in decoded:
            message = f"`{name}` has no driver on the target `{target.text}`"
            yield Diagnostic("KYB151", message, target.span)
    return drivers


def _implied(target: Text, uses: PartDecoder) -> Diagnosed[PartUse | None]:
    """The driver that stands behind the name of the target; None where none does."""
    span = target.span
    if target.text == "sim":
        return (yield from uses.one("drivers", Scalar("sim", span)))
    if target.text not in (implied := implied_targets(uses.catalog)):
        return None
    driver, values = implied[target.text]
    return (yield from uses.one("drivers", _node({"use": driver, **values}, span)))


def _node(values: dict[str, str], span: Span) -> Mapping:
    """The mapping as an author would write it there."""
    entries = {k: MappingEntry(Scalar(k, span), Scalar(value, span)) for k, value in values.items()}
    return Mapping(entries, span)


def with_trackers(
    root: Mapping, target: Text, uses: PartDecoder, vehicles: dict[str, VehicleEntry]
) -> Diagnosed[dict[str, VehicleEntry]]:
    """The vehicles with their trackers on `target`: that of the vehicle's own entry, else that of
    `all`, else the one that the driver asks for, else the mission's."""
    chosen = entries_of(root.get("targets")).get(target.text)
    entries = {} if chosen is None else entries_of(chosen.value)
    whole: dict[str, VehicleEntry] = {}
    for name, vehicle in vehicles.items():
        node = _tracker(entries.get(name)) or _tracker(entries.get("all"))
        driver = vehicle.driver
        asked = driver.spec.cls.tracker(driver.params) if node is None else None
        if asked is not None:
            node = _node(asked, driver.span)
        use = None if node is None else (yield from uses.one("trackers", node))
        whole[name] = (
            vehicle if use is None else replace(vehicle, tracker=use, own_tracker=vehicle.tracker)
        )
    return whole


def _tracker(entry: MappingEntry | None) -> Node | None:
    return entry.value.get("tracker") if entry and isinstance(entry.value, Mapping) else None


def _decoded_drivers(
    entries: dict[str, MappingEntry], vehicles: dict[str, MappingEntry], uses: PartDecoder
) -> Diagnosed[dict[str, PartUse | None]]:
    """The drivers that are written; trackers are looked at as well."""
    decoded: dict[str, PartUse | None] = {}
    for name, entry in entries.items():
        if name == "inputs":
            continue
        driver = entry.value.get("driver") if isinstance(entry.value, Mapping) else None
        tracker = _tracker(entry)
        if tracker is not None:
            yield from uses.one("trackers", tracker)
        if name != "all" and name not in vehicles:
            message, hint = f"no vehicle is called `{name}`", did_you_mean(name, [*vehicles, "all"])
            yield Diagnostic("KYB151", message, entry.key.span, help=hint)
        elif driver is not None:
            decoded[name] = yield from uses.one("drivers", driver)
    return decoded


def other_targets(root: Mapping, chosen: Text, catalog: Catalog) -> Iterator[Diagnostic]:
    """What is wrong with the targets that are not flown on; what is not installed here, and a file
    that is not there, is only a warning then."""
    vehicles = entries_of(root.get("vehicles"))
    for name, entry in entries_of(root.get("targets")).items():
        if name != chosen.text:
            entries, uses = entries_of(entry.value), PartDecoder(catalog)
            found = collect(_decoded_drivers(entries, vehicles, uses)).diagnostics
            found += collect(sensors_of(entries, vehicles, uses)).diagnostics
            found += other_inputs(entries, uses)
            for d in found:
                yield replace(d, severity=Severity.WARNING) if d.code in _NOT_HERE else d


def with_sensors(
    root: Mapping, target: Text, uses: PartDecoder, vehicles: dict[str, VehicleEntry]
) -> Diagnosed[dict[str, VehicleEntry]]:
    """The vehicles with their sensors on `target`: for each estimator the vehicle's own, else that
    of `all`; then those that the driver brings."""
    chosen = entries_of(root.get("targets")).get(target.text)
    entries = {} if chosen is None else entries_of(chosen.value)
    written = entries_of(root.get("vehicles"))
    decoded = yield from sensors_of(entries, written, uses)
    whole: dict[str, VehicleEntry] = {}
    for name, vehicle in vehicles.items():
        labels = set(_estimators(written[name].value))
        named = {k: v for k, v in decoded.get("all", {}).items() if k in labels}
        lists = {**named, **decoded.get(name, {})}.values()
        sensors = tuple(use for several in lists for use in several)
        equipped = replace(vehicle, sensors=sensors) if sensors else vehicle
        brought = yield from _brought(equipped, target, uses)
        whole[name] = replace(equipped, sensors=(*sensors, *brought)) if brought else equipped
    return whole


def provided(vehicle: VehicleEntry) -> frozenset[MeasurementKind]:
    """The kinds of measurement that the vehicle's driver and sensors provide."""
    sources = (vehicle.driver, *(use.part for use in vehicle.sensors))
    return frozenset(kind for part in sources for kind in part.spec.cls.provides)


def sensors_of(
    target: dict[str, MappingEntry], vehicles: dict[str, MappingEntry], uses: PartDecoder
) -> Diagnosed[dict[str, dict[str, list[SensorEntry]]]]:
    """The sensors of each entry of a target, by estimator."""
    decoded: dict[str, dict[str, list[SensorEntry]]] = {}
    for name, entry in target.items():
        if name == "all":
            known = [label for other in vehicles.values() for label in _estimators(other.value)]
        elif name in vehicles:
            known = list(_estimators(vehicles[name].value))
        else:
            continue
        decoded[name] = yield from _decoded_sensors(name, entry.value, known, uses)
    return decoded


def _decoded_sensors(
    name: str, target: Node, known: list[str], uses: PartDecoder
) -> Diagnosed[dict[str, list[SensorEntry]]]:
    decoded: dict[str, list[SensorEntry]] = {}
    sensors = target.get("sensors") if isinstance(target, Mapping) else None
    for label, entry in entries_of(sensors).items():
        if is_null(entry.value):
            continue
        if label not in known:
            whose = "no vehicle has" if name == "all" else f"`{name}` has no"
            message = f"{whose} {'an ' if name == 'all' else ''}estimator `{label}`"
            hint = did_you_mean(label, known) or "name one under `estimators` of the vehicle"
            yield Diagnostic("KYB390", message, entry.key.span, help=hint)
        nodes = items_of(entry.value) or (entry.value,)
        parts = yield from every(uses.one("sensors", node) for node in nodes)
        if label in known:
            whole = [(p, i) for i, p in enumerate(parts) if p is not None]
            decoded[label] = [SensorEntry(entry.key.as_text, part, i) for part, i in whole]
    return decoded


def _estimators(vehicle: Node) -> Iterator[str]:
    """The names of a vehicle's estimators, whether or not they can be decoded."""
    for item in items_of(vehicle.get("estimators") if isinstance(vehicle, Mapping) else None):
        name: Node | None = item
        if isinstance(item, Mapping):
            name = item.get("as") or item.get("use")
        if isinstance(name, Scalar):
            yield name.text


def _brought(
    vehicle: VehicleEntry, target: Text, uses: PartDecoder
) -> Diagnosed[list[SensorEntry]]:
    """The sensors that the driver brings for what nothing else gives an estimator; they stand where
    the first of those does."""
    given = provided(vehicle)
    driver = vehicle.driver
    shows = driver.spec.cls.shows(driver.params)
    parts = [use.part for use in vehicle.estimators]
    lacking = [(p, kinds) for p in parts if (kinds := p.spec.cls.uses(p.params) - given)]
    brought: list[SensorEntry] = []
    for name in driver.spec.cls.brings if lacking else ():
        part = yield from uses.one("sensors", Scalar(name, lacking[0][0].span))
        if part is None or part.spec.cls.simulated > shows:
            continue
        if part.spec.cls.provides & {k for _, kinds in lacking for k in kinds}:
            lacking = [(p, kinds - part.spec.cls.provides) for p, kinds in lacking]
            brought.append(SensorEntry(Text("", target.span, verbatim=False), part))
    return brought


CONTROL_RATE = 250
"""Hz."""


def needed_rate(drivers: Iterable[PartUse]) -> int:
    """The lowest (Hz) that all drivers are content with; where it does not fall on the steps of
    each of them, the usual one that does. Where that doesn't either, KYB303 tells so."""
    used = [(use.spec.cls, use.params) for use in drivers]
    needed = max((driver.control_rate(params) for driver, params in used), default=CONTROL_RATE)
    steps = [rate for driver, params in used if (rate := driver.step_rate(params)) is not None]
    fitting = (r for r in (needed, CONTROL_RATE) if all(divides(r, step) for step in steps))
    return next(fitting, needed)


def divides(control: int, steps: float) -> bool:
    """Whether every tick at `control` falls on a step, of `steps` a second."""
    each = round(steps / control)
    return each >= 1 and abs(steps / control - each) < 1e-9
