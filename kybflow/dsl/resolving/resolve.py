"""Imports, parameters and `like` away: what is left is one tree with every value in its place, and
every node still knows where it was written."""

from __future__ import annotations

import re
from collections.abc import Mapping as MappingOf
from typing import NamedTuple

from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, collect, passed
from kybflow.dsl.diagnostics.spans import PREFIX, Span
from kybflow.dsl.document import Parameter
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, count, entries_of
from kybflow.dsl.reading.reader import ParsedFile
from kybflow.dsl.resolving.chains import Chains
from kybflow.dsl.resolving.exports import EMPTY, Exports
from kybflow.dsl.resolving.imports import judged
from kybflow.dsl.resolving.like import UseMarker
from kybflow.dsl.resolving.loading import Files, library_root, load
from kybflow.dsl.resolving.parameters import ParameterTable, Setting, declare
from kybflow.dsl.resolving.unused import unused_imports

MAX_AFTER_LIKE = 200_000
_POSITION = re.compile(r"type\W+position")
"""What declares a parameter whose value is a point."""


class Resolved(NamedTuple):
    """A mission after imports, parameters and `like`: its top level, whose `airframes`, `vehicles`
    and `flows` are whole. `names_points`: a point's name stands somewhere; `has_positions`: a
    parameter of the type `position` is declared; `chains` are the names of those at hand."""

    root: Mapping
    parameters: dict[str, Parameter]
    names_points: bool
    has_positions: bool
    chains: tuple[str, ...] = ()


def resolve(root: Mapping, files: Files, settings: MappingOf[str, Setting]) -> Diagnosed[Resolved]:
    """The mission `root` after imports, parameters and `like`. Raises Stopped when it has errors
    there."""
    declared = yield from declare(root.get("parameters"), settings)
    exports, entries = yield from passed(_resolved(root, files, settings, declared))
    parameters = {name: d.parameter for name, d in declared.declared.items()}
    texts = [source.text for source in files.sources.values()]
    names_points = any(PREFIX in text for text in texts) or any(
        isinstance(p.value, str) and p.value.startswith(PREFIX) for p in parameters.values()
    )
    whole, at_hand = Mapping(entries, root.span), tuple(exports.names("chains"))
    has_positions = any(map(_POSITION.search, texts))
    return Resolved(whole, parameters, names_points, has_positions, at_hand)


def _resolved(
    root: Mapping, files: Files, settings: MappingOf[str, Setting], declared: ParameterTable
) -> Diagnosed[tuple[Exports, dict[str, MappingEntry]]]:
    """What the mission exports, and the entries of its top level, each section whole."""
    exports, plain, substitution = yield from load(files, root, declared)
    yield from substitution.unused()
    yield from unused_imports(root, settings)
    vehicles, room = yield from _vehicles(plain, exports)
    airframes = yield from _whole("airframes", plain, exports)
    flows = yield from _flows(plain, exports, room)
    entries = {**plain.entries, **(yield from _world(plain, exports))}
    for key, section in {"airframes": airframes, "vehicles": vehicles, "flows": flows}.items():
        if section is not None:
            entries[key] = MappingEntry(entries[key].key, section)
    return exports, entries


def _vehicles(plain: Mapping, exports: Exports) -> Diagnosed[tuple[Mapping, int]]:
    """(the vehicles, whole and without chains; how many values there is room for after them)."""
    vehicles = plain.get("vehicles")
    assert isinstance(vehicles, Mapping)
    chains, whole, room = Chains(exports), dict[str, MappingEntry](), MAX_AFTER_LIKE
    for name, entry in vehicles.entries.items():
        vehicle = yield from exports.get("vehicles", name)
        if vehicle is not None:
            vehicle = yield from chains.expanded(vehicle)
            whole[name] = MappingEntry(entry.key, vehicle)
            room = yield from _left(room, vehicle, entry)
        if room <= 0:
            break
    yield from chains.judge()
    return Mapping(whole, vehicles.span), room


def _world(plain: Mapping, exports: Exports) -> Diagnosed[dict[str, MappingEntry]]:
    """The entry `world`, whole; none where there is none."""
    written = plain.entries.get("world")
    if written is None or plain.get("world") is None:
        return {}
    whole = yield from exports.started("worlds", written.value, written.value)
    return {} if whole is None else {"world": written._replace(value=whole)}


def _left(room: int, whole: Mapping, entry: MappingEntry) -> Diagnosed[int]:
    """The `room` that is left after `entry`, which resolved to `whole`; a finding where nothing is
    left."""
    left = room - count(whole, room)
    if left <= 0:
        message = f"more than {MAX_AFTER_LIKE} values after `like`"
        hint = "share what is long as a file: `do: follow_trajectory` flies a table"
        yield Diagnostic("KYB126", message, entry.key.span, help=hint)
    return left


def _flows(plain: Mapping, exports: Exports, room: int) -> Diagnosed[Mapping | None]:
    """The flows of the file itself, each whole, as long as there is `room`; None where there are
    none. What is said in them gets its meaning where they are used, so they remember that."""
    written = plain.entries.get("flows")
    if written is None:
        return None
    whole: dict[str, MappingEntry] = {}
    for name, entry in exports.written("flows").items():
        flow = (yield from exports.get("flows", name)) if room > 0 else None
        if flow is not None:
            whole[name] = MappingEntry(entry.key, flow)
            room = yield from _left(room, flow, entry)
    if room > 0:
        used = UseMarker()
        whole = {name: e._replace(value=used.marked(e.value)) for name, e in whole.items()}
    return Mapping(whole, written.key.span)


def _whole(section: str, plain: Mapping, exports: Exports) -> Diagnosed[Mapping | None]:
    """A section of the file itself, each of its entries whole; None where there is none."""
    written = plain.entries.get(section)
    if written is None:
        return None
    whole: dict[str, MappingEntry] = {}
    for name, entry in exports.written(section).items():
        body = yield from exports.get(section, name)
        if body is not None:
            whole[name] = MappingEntry(entry.key, body)
    return Mapping(whole, written.key.span)


def resolve_library(source: ParsedFile, files: Files) -> Diagnosed[Mapping]:
    """The top level of a library file on its own, each of its sections whole. A parameter without a
    value is no finding: an import gives one."""
    root = yield from library_root(judged(source), Span(source.file, 1, 1, 1, 1))
    if root is None:
        return EMPTY
    declared, found = collect(declare(root.get("parameters"), {}))
    yield from (finding for finding in found if finding.code != "KYB132")
    exports, plain, substitution = yield from load(files, root, declared)
    yield from substitution.unused()
    entries = dict(plain.entries)
    for key in ("airframes", "vehicles", "stacks", "worlds"):
        whole = yield from _whole(key, plain, exports)
        if whole is not None:
            entries[key] = MappingEntry(entries[key].key, whole)
    flows = yield from _flows(plain, exports, MAX_AFTER_LIKE)
    if flows is not None:
        entries["flows"] = MappingEntry(entries["flows"].key, flows)
    chains, vehicles = Chains(exports), entries.get("vehicles")
    for entry in entries_of(vehicles.value if vehicles else None).values():
        if isinstance(entry.value, Mapping):
            yield from chains.expanded(entry.value)
    yield from chains.judge()
    return Mapping(entries, root.span)
