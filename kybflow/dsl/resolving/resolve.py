"""Imports, parameters and `like` away: what is left is one tree with every value in its place, and
every node still knows where it was written."""

from __future__ import annotations

from collections.abc import Mapping as MappingOf
from typing import NamedTuple

from kybflow.dsl.diagnostics.diagnostic import Diagnostic, has_errors
from kybflow.dsl.document import Parameter
from kybflow.dsl.reading.nodes import Entry, Mapping, count, entries_of
from kybflow.dsl.reading.reader import Source
from kybflow.dsl.reading.source import PREFIX, Span
from kybflow.dsl.resolving.chains import Chains
from kybflow.dsl.resolving.imports import judged
from kybflow.dsl.resolving.like import UsedAt
from kybflow.dsl.resolving.loading import Files, Loader, library_root
from kybflow.dsl.resolving.offers import EMPTY, Offers
from kybflow.dsl.resolving.parameters import Setting, declare
from kybflow.dsl.resolving.unused_imports import unused
from kybflow.dsl.shaping.world.world import world_of

MAX_AFTER_LIKE = 200_000


class Resolved(NamedTuple):
    """A mission after imports, parameters and `like`: its top level, whose `airframes`, `vehicles`
    and `flows` are whole. `names_points`: a point's name stands somewhere; `chains` are the names
    of those at hand."""

    root: Mapping
    parameters: dict[str, Parameter]
    names_points: bool
    chains: tuple[str, ...] = ()


def resolve(
    root: Mapping, files: Files, settings: MappingOf[str, Setting], found: list[Diagnostic]
) -> Resolved | None:
    """The mission `root` after imports, parameters and `like`; None when it has errors there."""
    loader = Loader(files, found)
    declared = declare(root.get("parameters"), settings, found)
    offers, plain, substitution = loader.offers(root, declared, files.mission)
    found += substitution.unused()
    found += unused(root, (s.node for s in settings.values() if s.node is not None))
    chains = Chains(offers, found)
    vehicles = plain.get("vehicles")
    assert isinstance(vehicles, Mapping)
    whole: dict[str, Entry] = {}
    room = MAX_AFTER_LIKE
    for name, entry in vehicles.entries.items():
        vehicle = offers.get("vehicles", name)
        if vehicle is not None:
            vehicle = chains.expanded(vehicle)
            whole[name] = Entry(entry.key, vehicle)
            room = _left(room, vehicle, entry, found)
        if room <= 0:
            break
    chains.judge()
    airframes = _whole("airframes", plain, offers)
    sections = {"airframes": airframes, "flows": _flows(plain, offers, room, found)}
    world = _world(plain, offers)
    if has_errors(found):
        return None
    entries = {**plain.entries, **world}
    for key, section in sections.items():
        if section is not None:
            entries[key] = Entry(entries[key].key, section)
    entries["vehicles"] = Entry(entries["vehicles"].key, Mapping(whole, vehicles.span))
    parameters = {name: d.parameter for name, d in declared.declared.items()}
    texts = (source.text for source in files.sources.values())
    names_points = any(PREFIX in text for text in texts) or any(
        isinstance(p.value, str) and p.value.startswith(PREFIX) for p in parameters.values()
    )
    whole_root, at_hand = Mapping(entries, root.span), tuple(offers.names("chains"))
    return Resolved(whole_root, parameters, names_points, at_hand)


def _world(plain: Mapping, offers: Offers) -> dict[str, Entry]:
    """The entry `world`, whole; none where there is none."""
    written = plain.entries.get("world")
    if written is None or plain.get("world") is None:
        return {}
    whole = offers.started("worlds", written.value, written.value)
    return {} if whole is None else {"world": written._replace(value=whole)}


def _left(room: int, whole: Mapping, entry: Entry, found: list[Diagnostic]) -> int:
    """How much of `room` is left after `entry`, which is `whole` then; a finding where nothing
    is."""
    left = room - count(whole, room)
    if left <= 0:
        message = f"more than {MAX_AFTER_LIKE} values after `like`"
        hint = "share what is long as a file: `do: follow_trajectory` flies a table"
        found.append(Diagnostic("KYB126", message, entry.key.span, help=hint))
    return left


def _flows(plain: Mapping, offers: Offers, room: int, found: list[Diagnostic]) -> Mapping | None:
    """The flows of the file itself, each whole, as long as there is `room`; None where there are
    none. What is said in them gets its meaning where they are used, so they remember that."""
    written = plain.entries.get("flows")
    if written is None:
        return None
    whole: dict[str, Entry] = {}
    for name, entry in offers.written("flows").items():
        flow = offers.get("flows", name) if room > 0 else None
        if flow is not None:
            whole[name] = Entry(entry.key, flow)
            room = _left(room, flow, entry, found)
    if room > 0:
        used = UsedAt()
        whole = {name: e._replace(value=used.marked(e.value)) for name, e in whole.items()}
    return Mapping(whole, written.key.span)


def _whole(section: str, plain: Mapping, offers: Offers) -> Mapping | None:
    """A section of the file itself, each of its entries whole; None where there is none."""
    written = plain.entries.get(section)
    if written is None:
        return None
    whole = {
        name: Entry(entry.key, body)
        for name, entry in offers.written(section).items()
        if (body := offers.get(section, name)) is not None
    }
    return Mapping(whole, written.key.span)


def resolve_library(source: Source, files: Files, found: list[Diagnostic]) -> Mapping:
    """Find what is wrong with a library file on its own; itself, its airframes, vehicles, stacks
    and flows whole. A parameter without a value is none of it: an import gives one."""
    root = library_root(judged(source), Span(source.file, 1, 1, 1, 1), found)
    if root is None:
        return EMPTY
    loader = Loader(files, found)
    said: list[Diagnostic] = []
    declared = declare(root.get("parameters"), {}, said)
    found += (finding for finding in said if finding.code != "KYB132")
    offers, plain, substitution = loader.offers(root, declared, files.mission)
    found += substitution.unused()
    whole = {key: _whole(key, plain, offers) for key in ("airframes", "vehicles", "stacks")}
    whole["flows"] = _flows(plain, offers, MAX_AFTER_LIKE, found)
    chains = Chains(offers, found)
    for entry in entries_of(whole["vehicles"]).values():
        if isinstance(entry.value, Mapping):
            chains.expanded(entry.value)
    chains.judge()
    for name in offers.own("worlds"):
        world_of(offers.get("worlds", name), found)
    entries = {
        key: Entry(plain.entries[key].key, node) for key, node in whole.items() if node is not None
    }
    return Mapping({**plain.entries, **entries}, root.span)
