"""Resolve imports, parameters and `like` into one tree that contains all values. Its nodes keep the
locations where they were written."""

from __future__ import annotations

from collections.abc import Mapping as MappingOf
from typing import NamedTuple

from kybflow.dsl.diagnostics import PREFIX, Collector, Span
from kybflow.dsl.language.records import EMPTY
from kybflow.dsl.plan import Parameter
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, count, entries_of
from kybflow.dsl.reading.reader import ParsedFile
from kybflow.dsl.resolving.chains import Chains
from kybflow.dsl.resolving.exports import Exports, UseMarker
from kybflow.dsl.resolving.imports import Files, library_root, load
from kybflow.dsl.resolving.library_files import judged
from kybflow.dsl.resolving.parameters import Setting, declare
from kybflow.dsl.resolving.unused import unused_imports

CODES = {
    "KYB126": "The mission has too many values, counted with those inherited through `like`.",
}
MAX_AFTER_LIKE = 200_000


class Resolved(NamedTuple):
    """A mission after imports, parameters and `like` are resolved. root: its top level, whose
    airframes, vehicles and flows are complete. parameters: the values of its parameters.
    names_points: whether the mission may name points. chains: the names of the chains that the
    mission may use."""

    root: Mapping
    parameters: dict[str, Parameter]
    names_points: bool
    chains: tuple[str, ...] = ()


def resolve(
    root: Mapping, files: Files, settings: MappingOf[str, Setting], found: Collector
) -> Resolved:
    """Resolve the imports, parameters and `like` of the mission `root`."""
    declared = declare(root.get("parameters"), settings, found)
    exports = load(files, root, declared, found)
    found.add(unused_imports(root, settings))
    written = exports.root.get("vehicles")
    assert isinstance(written, Mapping)
    chains, vehicles, room = Chains(exports, found), dict[str, MappingEntry](), MAX_AFTER_LIKE
    for name, entry in written.entries.items():
        vehicle = exports.get("vehicles", name)
        if vehicle is not None:
            vehicle = chains.expanded(vehicle)
            vehicles[name] = MappingEntry(entry.key, vehicle)
            room = _left(room, vehicle, entry, found)
        if room <= 0:
            break
    chains.judge()
    whole: dict[str, Node | None] = {
        "vehicles": Mapping(vehicles, written.span),
        "airframes": exports.section("airframes"),
        "flows": _flows(exports, room, found),
    }
    world = exports.root.get("world")
    if world is not None:
        whole["world"] = exports.started("worlds", world, world)
    parameters = {name: d.parameter for name, d in declared.declared.items()}
    texts = [source.text for source in files.sources.values()]
    texts += [str(parameter.value) for parameter in parameters.values()]
    names_points = any(PREFIX in text for text in texts)
    at_hand = tuple(exports.names("chains"))
    return Resolved(_with(exports.root, whole), parameters, names_points, at_hand)


def resolve_library(source: ParsedFile, files: Files, found: Collector) -> Mapping:
    """Return the top level of a library file on its own, with complete sections. A parameter
    without a value is not reported, because an import can set it."""
    root = library_root(judged(source), Span(source.file, 1, 1, 1, 1), found)
    if root is None:
        return EMPTY
    unset = Collector()
    declared = declare(root.get("parameters"), {}, unset)
    found.add(finding for finding in unset.all if finding.code != "KYB132")
    exports = load(files, root, declared, found)
    whole = {key: exports.section(key) for key in ("airframes", "vehicles", "stacks", "worlds")}
    whole["flows"] = _flows(exports, MAX_AFTER_LIKE, found)
    chains = Chains(exports, found)
    for entry in entries_of(whole["vehicles"]).values():
        if isinstance(entry.value, Mapping):
            chains.expanded(entry.value)
    chains.judge()
    return _with(exports.root, whole)


def _with(root: Mapping, whole: MappingOf[str, Node | None]) -> Mapping:
    """Return `root` with its sections replaced by those in `whole` that are not None."""
    sections = {
        key: root.entries[key]._replace(value=value)
        for key, value in whole.items()
        if value is not None
    }
    return Mapping({**root.entries, **sections}, root.span)


def _flows(exports: Exports, room: int, found: Collector) -> Mapping | None:
    """Return the file's own flows, complete, as long as `room` is positive; None if the file has
    none. Names in a flow are looked up where the flow is used, so its spans record that
    location."""
    written = exports.root.entries.get("flows")
    if written is None:
        return None
    whole: dict[str, MappingEntry] = {}
    for name, entry in exports.written("flows").items():
        flow = exports.get("flows", name) if room > 0 else None
        if flow is not None:
            whole[name] = MappingEntry(entry.key, flow)
            room = _left(room, flow, entry, found)
    if room > 0:
        used = UseMarker()
        whole = {name: e._replace(value=used.marked(e.value)) for name, e in whole.items()}
    return Mapping(whole, written.key.span)


def _left(room: int, whole: Mapping, entry: MappingEntry, found: Collector) -> int:
    """Return the rest of `room`, a number of values, after the entry that was resolved to `whole`;
    report KYB126 if nothing is left."""
    left = room - count(whole, room)
    if left <= 0:
        message = (
            f"the mission has more than {MAX_AFTER_LIKE} values, with everything that `like` copies"
        )
        hint = (
            "don't copy long lists with `like`: put a long path into a file and fly it with "
            "`do: follow_trajectory`"
        )
        found.report("KYB126", message, entry.key.span, help=hint)
    return left
