"""Where the mission flies: the chosen target, and each vehicle's driver on it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from kybflow.dsl.diagnostics import Diagnostic, Severity, did_you_mean
from kybflow.dsl.document import PartUse
from kybflow.dsl.nodes import Entry, Mapping, Scalar, entries_of
from kybflow.dsl.sensors import sensors_of
from kybflow.dsl.source import Span, Text
from kybflow.dsl.uses import Uses

if TYPE_CHECKING:
    from kybflow.catalog import Catalog

CODES = {
    "KYB150": "A target that the mission doesn't have.",
    "KYB151": "A target that names a vehicle which doesn't exist, or leaves one without a driver.",
}


FILE = "--target"
"""The name of the file that the span of an unknown target points into."""


def target_of(root: Mapping, target: str | None, found: list[Diagnostic]) -> Text:
    """The target to fly on: `sim` unless another is asked for."""
    mission = root.entries["mission"].key.span
    entries = entries_of(root.get("targets"))
    name = target or "sim"
    if name in entries:
        return entries[name].key.as_text
    if name != "sim":
        known = {*entries, "sim"}
        message = f"the mission has no target `{name}`"
        asked = Span(FILE, 1, 1, 1, len(name) + 1)
        found.append(Diagnostic("KYB150", message, asked, help=did_you_mean(name, known)))
    return Text(name, mission, verbatim=False)


def drivers_of(root: Mapping, target: Text, uses: Uses) -> dict[str, PartUse]:
    """The driver of each vehicle on `target`: its own entry, else that of `all`, else `sim`."""
    vehicles = entries_of(root.get("vehicles"))
    targets = entries_of(root.get("targets"))
    entries = entries_of(targets[target.text].value) if target.text in targets else {}
    decoded = _decoded(entries, vehicles, uses)
    if target.text == "sim" and "all" not in decoded:
        decoded["all"] = uses.one("drivers", Scalar("sim", target.span))
    drivers: dict[str, PartUse] = {}
    for name in vehicles:
        driver = decoded.get(name, decoded.get("all"))
        if driver is not None:
            drivers[name] = driver
        elif target.text in targets and name not in decoded and "all" not in decoded:
            message = f"`{name}` has no driver on the target `{target.text}`"
            uses.found.append(Diagnostic("KYB151", message, target.span))
    return drivers


def _decoded(
    entries: dict[str, Entry], vehicles: dict[str, Entry], uses: Uses
) -> dict[str, PartUse | None]:
    decoded: dict[str, PartUse | None] = {}
    for name, entry in entries.items():
        driver = entry.value.get("driver") if isinstance(entry.value, Mapping) else None
        if name != "all" and name not in vehicles:
            known = [*vehicles, "all"]
            message = f"no vehicle is called `{name}`"
            uses.found.append(
                Diagnostic("KYB151", message, entry.key.span, help=did_you_mean(name, known))
            )
        elif driver is not None:
            decoded[name] = uses.one("drivers", driver)
    return decoded


def other_targets(root: Mapping, chosen: Text, catalog: Catalog) -> list[Diagnostic]:
    """What is wrong with the targets that are not flown on; what is not installed here, and a file
    that is not there, is only a warning then."""
    found: list[Diagnostic] = []
    for name, entry in entries_of(root.get("targets")).items():
        if name != chosen.text:
            entries, vehicles = entries_of(entry.value), entries_of(root.get("vehicles"))
            uses = Uses(catalog, found)
            _decoded(entries, vehicles, uses)
            sensors_of(entries, vehicles, uses)
    missing = ("KYB140", "KYB141", "KYB370")
    return [replace(d, severity=Severity.WARNING) if d.code in missing else d for d in found]
