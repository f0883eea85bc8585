"""Imports, parameters and `like` away: what is left is one tree with every value in its place, and
every node still knows where it was written."""

from __future__ import annotations

from collections.abc import Mapping as MappingOf
from typing import NamedTuple

from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, collect, passed
from kybflow.dsl.diagnostics.spans import PREFIX, Span
from kybflow.dsl.document import Parameter
from kybflow.dsl.reading.nodes import Entry, Mapping, count, entries_of
from kybflow.dsl.reading.reader import Source
from kybflow.dsl.resolving.chains import Chains
from kybflow.dsl.resolving.imports import judged
from kybflow.dsl.resolving.like import UsedAt
from kybflow.dsl.resolving.loading import Files, library_root, load
from kybflow.dsl.resolving.offers import EMPTY, Offers
from kybflow.dsl.resolving.parameters import Parameters, Setting, declare
from kybflow.dsl.resolving.unused import unused_imports

MAX_AFTER_LIKE = 200_000


class Resolved(NamedTuple):
    """A mission after imports, parameters and `like`: its top level, whose `airframes`, `vehicles`
    and `flows` are whole. `names_points`: a point's name stands somewhere; `chains` are the names
    of those at hand."""

    root: Mapping
    parameters: dict[str, Parameter]
    names_points: bool
    chains: tuple[str, ...] = ()


def resolve(root: Mapping, files: Files, settings: MappingOf[str, Setting]) -> Diagnosed[Resolved]:
    """The mission `root` after imports, parameters and `like`. Raises Stopped when it has errors
    there."""
    declared = yield from declare(root.get("parameters"), settings)
    offers, entries = yield from passed(_resolved(root, files, settings, declared))
    parameters = {name: d.parameter for name, d in declared.declared.items()}
    texts = (source.text for source in files.sources.values())
    names_points = any(PREFIX in text for text in texts) or any(
        isinstance(p.value, str) and p.value.startswith(PREFIX) for p in parameters.values()
    )
    whole, at_hand = Mapping(entries, root.span), tuple(offers.names("chains"))
    return Resolved(whole, parameters, names_points, at_hand)


def _resolved(
    root: Mapping, files: Files, settings: MappingOf[str, Setting], declared: Parameters
) -> Diagnosed[tuple[Offers, dict[str, Entry]]]:
    """What the mission offers, and its top level, each section of which is whole."""
    offers, plain, substitution = yield from load(files, root, declared)
    yield from substitution.unused()
    yield from unused_imports(root, settings)
    vehicles, room = yield from _vehicles(plain, offers)
    airframes = yield from _whole("airframes", plain, offers)
    flows = yield from _flows(plain, offers, room)
    entries = {**plain.entries, **(yield from _world(plain, offers))}
    for key, section in {"airframes": airframes, "vehicles": vehicles, "flows": flows}.items():
        if section is not None:
            entries[key] = Entry(entries[key].key, section)
    return offers, entries


def _vehicles(plain: Mapping, offers: Offers) -> Diagnosed[tuple[Mapping, int]]:
    """(the vehicles, whole and without chains; how many values there is room for after them)."""
    vehicles = plain.get("vehicles")
    assert isinstance(vehicles, Mapping)
    chains, whole, room = Chains(offers), dict[str, Entry](), MAX_AFTER_LIKE
    for name, entry in vehicles.entries.items():
        vehicle = yield from offers.get("vehicles", name)
        if vehicle is not None:
            vehicle = yield from chains.expanded(vehicle)
            whole[name] = Entry(entry.key, vehicle)
            room = yield from _left(room, vehicle, entry)
        if room <= 0:
            break
    yield from chains.judge()
    return Mapping(whole, vehicles.span), room


def _world(plain: Mapping, offers: Offers) -> Diagnosed[dict[str, Entry]]:
    """The entry `world`, whole; none where there is none."""
    written = plain.entries.get("world")
    if written is None or plain.get("world") is None:
        return {}
    whole = yield from offers.started("worlds", written.value, written.value)
    return {} if whole is None else {"world": written._replace(value=whole)}


def _left(room: int, whole: Mapping, entry: Entry) -> Diagnosed[int]:
    """How much of `room` is left after `entry`, which is `whole` then; a finding where nothing
    is."""
    left = room - count(whole, room)
    if left <= 0:
        message = f"more than {MAX_AFTER_LIKE} values after `like`"
        hint = "share what is long as a file: `do: follow_trajectory` flies a table"
        yield Diagnostic("KYB126", message, entry.key.span, help=hint)
    return left


def _flows(plain: Mapping, offers: Offers, room: int) -> Diagnosed[Mapping | None]:
    """The flows of the file itself, each whole, as long as there is `room`; None where there are
    none. What is said in them gets its meaning where they are used, so they remember that."""
    written = plain.entries.get("flows")
    if written is None:
        return None
    whole: dict[str, Entry] = {}
    for name, entry in offers.written("flows").items():
        flow = (yield from offers.get("flows", name)) if room > 0 else None
        if flow is not None:
            whole[name] = Entry(entry.key, flow)
            room = yield from _left(room, flow, entry)
    if room > 0:
        used = UsedAt()
        whole = {name: e._replace(value=used.marked(e.value)) for name, e in whole.items()}
    return Mapping(whole, written.key.span)


def _whole(section: str, plain: Mapping, offers: Offers) -> Diagnosed[Mapping | None]:
    """A section of the file itself, each of its entries whole; None where there is none."""
    written = plain.entries.get(section)
    if written is None:
        return None
    whole: dict[str, Entry] = {}
    for name, entry in offers.written(section).items():
        body = yield from offers.get(section, name)
        if body is not None:
            whole[name] = Entry(entry.key, body)
    return Mapping(whole, written.key.span)


def resolve_library(source: Source, files: Files) -> Diagnosed[Mapping]:
    """The top level of a library file on its own, each of its sections whole. A parameter without a
    value is no finding: an import gives one."""
    root = yield from library_root(judged(source), Span(source.file, 1, 1, 1, 1))
    if root is None:
        return EMPTY
    declared, found = collect(declare(root.get("parameters"), {}))
    yield from (finding for finding in found if finding.code != "KYB132")
    offers, plain, substitution = yield from load(files, root, declared)
    yield from substitution.unused()
    entries = dict(plain.entries)
    for key in ("airframes", "vehicles", "stacks", "worlds"):
        whole = yield from _whole(key, plain, offers)
        if whole is not None:
            entries[key] = Entry(entries[key].key, whole)
    flows = yield from _flows(plain, offers, MAX_AFTER_LIKE)
    if flows is not None:
        entries["flows"] = Entry(entries["flows"].key, flows)
    chains, vehicles = Chains(offers), entries.get("vehicles")
    for entry in entries_of(vehicles.value if vehicles else None).values():
        if isinstance(entry.value, Mapping):
            yield from chains.expanded(entry.value)
    yield from chains.judge()
    return Mapping(entries, root.span)
