"""The tree after `resolve` to the typed document: SI values, parts with their parameters, a span on
everything."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kybflow.dsl.diagnostics import Diagnostic, did_you_mean
from kybflow.dsl.document import Document, PartUse, Vehicle
from kybflow.dsl.nodes import Entry, Mapping, Node, Scalar, Sequence
from kybflow.dsl.resolve import Resolved
from kybflow.dsl.source import Text
from kybflow.dsl.uses import Uses
from kybflow.dsl.values import decode, quantity_field
from kybflow.dsl.vehicles import Vehicles
from kybflow.site import Box
from kybflow.units import DURATION, FREQUENCY, LENGTH, Dimension

if TYPE_CHECKING:
    from kybflow.catalog import Catalog

CODES = {
    "KYB150": "A target that the mission doesn't have.",
    "KYB151": "A target that names a vehicle which doesn't exist, or leaves one without a driver.",
    "KYB152": "A control rate that is no whole number of Hz.",
    "KYB153": "A fence whose corners are in the wrong order.",
}
CONTROL_RATE = 250
HOVER_LIMIT = 30.0
TIME_LIMIT = 600.0


def shape(
    resolved: Resolved, catalog: Catalog, target: str | None, found: list[Diagnostic]
) -> Document | None:
    """The document; None when a vehicle, a part or a value has errors."""
    root = resolved.root
    before = len(found)
    uses = Uses(catalog, found)
    name = _target(root, target, found)
    drivers = _drivers(root, name, uses)
    vehicles = _vehicles(root, drivers, Vehicles(uses))
    rate = _control(root, found)
    fence = _fence(root, found)
    limits = [_duration(root, key, default, found) for key, default in _LIMITS.items()]
    if len(found) > before:
        return None
    return Document(
        mission=_text(root, "mission"),
        summary=_text(root, "summary").text,
        target=name,
        parameters=resolved.parameters,
        fence=fence,
        fence_span=_span_of(root.get("world")),
        control_rate=rate,
        control_span=_span_of(root.get("control")),
        hover_limit=limits[0],
        time_limit=limits[1],
        vehicles=vehicles,
        expect=tuple(
            item.as_text for item in _items(root.get("expect")) if isinstance(item, Scalar)
        ),
    )


_LIMITS = {"hover_limit": HOVER_LIMIT, "time_limit": TIME_LIMIT}


def _text(root: Mapping, key: str) -> Text:
    node = root.get(key)
    return node.as_text if isinstance(node, Scalar) else Text("", root.span)


def _items(node: Node | None) -> tuple[Node, ...]:
    return node.items if isinstance(node, Sequence) else ()


def _entries(node: Node | None) -> dict[str, Entry]:
    return node.entries if isinstance(node, Mapping) else {}


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


def _control(root: Mapping, found: list[Diagnostic]) -> int:
    node = root.get("control")
    rate: float = _quantity(node, "control", FREQUENCY, float(CONTROL_RATE), found)
    if node is not None and not rate.is_integer():
        message = f"`control` must be a whole number of Hz, but this is {rate:g} Hz"
        found.append(Diagnostic("KYB152", message, node.span))
    return int(rate)


def _fence(root: Mapping, found: list[Diagnostic]) -> Box | None:
    fence = _entries(root.get("world")).get("fence")
    if fence is None or not isinstance(fence.value, Mapping):
        return None
    field = quantity_field("fence", LENGTH, "vector")
    first, second = fence.value.get("from"), fence.value.get("to")
    low = None if first is None else decode(first, field, found)
    high = None if second is None else decode(second, field, found)
    if low is None or high is None:
        return None
    if not all(a < b for a, b in zip(low, high, strict=True)):
        found.append(
            Diagnostic(
                "KYB153",
                "the fence has no inside",
                fence.key.span,
                help="each number of `from` must be below that of `to`",
            )
        )
    return Box(low, high)


def _target(root: Mapping, target: str | None, found: list[Diagnostic]) -> Text:
    """The target to fly on: `sim` unless another is asked for."""
    mission = root.entries["mission"].key.span
    entries = _entries(root.get("targets"))
    name = target or "sim"
    if name in entries:
        return entries[name].key.as_text
    if name != "sim":
        known = {*entries, "sim"}
        message = f"the mission has no target `{name}`"
        found.append(Diagnostic("KYB150", message, mission, help=did_you_mean(name, known)))
    return Text(name, mission, verbatim=False)


def _drivers(root: Mapping, target: Text, uses: Uses) -> dict[str, PartUse]:
    """The driver of each vehicle on `target`: its own entry, else that of `all`, else `sim`."""
    vehicles = _entries(root.get("vehicles"))
    targets = root.get("targets")
    entries = _entries(targets.get(target.text) if isinstance(targets, Mapping) else None)
    for name, entry in entries.items():
        if name != "all" and name not in vehicles:
            uses.found.append(
                Diagnostic(
                    "KYB151",
                    f"no vehicle is called `{name}`",
                    entry.key.span,
                    help=did_you_mean(name, [*vehicles, "all"]),
                )
            )
    decoded: dict[str, PartUse | None] = {
        name: uses.one("drivers", node)
        for name, entry in entries.items()
        if isinstance(entry.value, Mapping) and (node := entry.value.get("driver")) is not None
    }
    if target.text == "sim" and "all" not in decoded:
        decoded["all"] = uses.one("drivers", Scalar("sim", target.span))
    drivers: dict[str, PartUse] = {}
    for name in vehicles:
        driver = decoded.get(name, decoded.get("all"))
        if driver is not None:
            drivers[name] = driver
        elif name not in decoded and "all" not in decoded:
            message = f"`{name}` has no driver on the target `{target.text}`"
            uses.found.append(Diagnostic("KYB151", message, target.span))
    return drivers


def _vehicles(root: Mapping, drivers: dict[str, PartUse], vehicles: Vehicles) -> dict[str, Vehicle]:
    decoded: dict[str, Vehicle] = {}
    for name, entry in _entries(root.get("vehicles")).items():
        vehicle = vehicles.one(entry, drivers.get(name))
        if vehicle is not None:
            decoded[name] = vehicle
    return decoded
