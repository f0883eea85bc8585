"""`sensors:` of the target: where the measurements come from that the driver has none of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from kybflow.core.signals import MeasurementKind
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, did_you_mean, every
from kybflow.dsl.document import SensorUse, Vehicle
from kybflow.dsl.reading.nodes import Entry, Mapping, Node, Scalar, entries_of, is_null, items_of
from kybflow.dsl.reading.source import Text
from kybflow.dsl.shaping.uses import Uses

CODES = {
    "KYB390": "A sensor under a name that no estimator of the vehicle has.",
}


def with_sensors(
    root: Mapping, target: Text, uses: Uses, vehicles: dict[str, Vehicle]
) -> Diagnosed[dict[str, Vehicle]]:
    """The vehicles with their sensors on `target`: for each estimator the vehicle's own, else that
    of `all`; then those that the driver brings."""
    chosen = entries_of(root.get("targets")).get(target.text)
    entries = {} if chosen is None else entries_of(chosen.value)
    written = entries_of(root.get("vehicles"))
    decoded = yield from sensors_of(entries, written, uses)
    whole: dict[str, Vehicle] = {}
    for name, vehicle in vehicles.items():
        labels = set(_estimators(written[name].value))
        named = {k: v for k, v in decoded.get("all", {}).items() if k in labels}
        lists = {**named, **decoded.get(name, {})}.values()
        sensors = tuple(use for several in lists for use in several)
        brought = yield from _brought(replace(vehicle, sensors=sensors), target, uses)
        whole[name] = replace(vehicle, sensors=(*sensors, *brought))
    return whole


def provided(vehicle: Vehicle) -> frozenset[MeasurementKind]:
    """What the vehicle's driver and sensors measure."""
    sources = (vehicle.driver, *(use.part for use in vehicle.sensors))
    return frozenset(kind for part in sources for kind in part.spec.cls.provides)


def sensors_of(
    target: dict[str, Entry], vehicles: dict[str, Entry], uses: Uses
) -> Diagnosed[dict[str, dict[str, list[SensorUse]]]]:
    """The sensors of each entry of a target, by estimator."""
    decoded: dict[str, dict[str, list[SensorUse]]] = {}
    for name, entry in target.items():
        if name == "all":
            known = [label for other in vehicles.values() for label in _estimators(other.value)]
        elif name in vehicles:
            known = list(_estimators(vehicles[name].value))
        else:
            continue
        decoded[name] = yield from _decoded(name, entry.value, known, uses)
    return decoded


def _decoded(
    name: str, target: Node, known: list[str], uses: Uses
) -> Diagnosed[dict[str, list[SensorUse]]]:
    decoded: dict[str, list[SensorUse]] = {}
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
            decoded[label] = [SensorUse(entry.key.as_text, part, i) for part, i in whole]
    return decoded


def _estimators(vehicle: Node) -> Iterator[str]:
    """What the estimators of a vehicle are called, whether they can be decoded or not."""
    for item in items_of(vehicle.get("estimators") if isinstance(vehicle, Mapping) else None):
        name: Node | None = item
        if isinstance(item, Mapping):
            name = item.get("as") or item.get("use")
        if isinstance(name, Scalar):
            yield name.text


def _brought(vehicle: Vehicle, target: Text, uses: Uses) -> Diagnosed[list[SensorUse]]:
    """The sensors that the driver brings for what nothing else gives an estimator; they stand where
    the first of those does."""
    given = provided(vehicle)
    driver = vehicle.driver
    shows = driver.spec.cls.shows(driver.params)
    parts = [use.part for use in vehicle.estimators]
    lacking = [(p, kinds) for p in parts if (kinds := p.spec.cls.uses(p.params) - given)]
    brought: list[SensorUse] = []
    for name in driver.spec.cls.brings if lacking else ():
        part = yield from uses.one("sensors", Scalar(name, lacking[0][0].span))
        if part is None or part.spec.cls.simulated > shows:
            continue
        if part.spec.cls.provides & {k for _, kinds in lacking for k in kinds}:
            lacking = [(p, kinds - part.spec.cls.provides) for p, kinds in lacking]
            brought.append(SensorUse(Text("", target.span, verbatim=False), part))
    return brought
