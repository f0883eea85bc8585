"""Imports, parameters and `like` away: what is left is one tree with every value in its place, and
every node still knows where it was written."""

from __future__ import annotations

from collections.abc import Mapping as MappingOf
from pathlib import Path
from typing import NamedTuple

from kybflow.dsl.chains import Chains
from kybflow.dsl.diagnostics import Diagnostic, has_errors
from kybflow.dsl.document import Parameter
from kybflow.dsl.imports import (
    Library,
    Place,
    find,
    installed,
    judged,
    read_library,
    shown_path,
)
from kybflow.dsl.nodes import Entry, Mapping, Node, Scalar, count, entries_of
from kybflow.dsl.offers import EMPTY, Offers
from kybflow.dsl.parameters import Parameters, Setting, declare
from kybflow.dsl.reader import Source
from kybflow.dsl.source import PREFIX, Span
from kybflow.dsl.substitution import Substitution
from kybflow.dsl.world import world_of

MAX_AFTER_LIKE = 200_000
MAX_IMPORTS = 200
_CHAIN = 20
_KEPT = frozenset({"import", "parameters"})


class Resolved(NamedTuple):
    """A mission after imports, parameters and `like`: its top level, whose `airframes` and
    `vehicles` are whole. `names_points`: a point's name stands somewhere."""

    root: Mapping
    parameters: dict[str, Parameter]
    names_points: bool


class Files:
    """The files of one compilation: the mission, and what it imports, as they are read."""

    def __init__(self, mission: Source, path: Path) -> None:
        self.root = path.parent
        self.sources: dict[str, Source] = {mission.file: mission}
        self.via: dict[str, tuple[Span, ...]] = {mission.file: ()}
        readable = mission.root is not None
        first = Span(mission.file, 1, 1, 1, 1)
        self.open: dict[Path, Span] = {path.resolve(): first} if readable else {}
        self.mission = Place(path, mission.file)
        self.imports = 0

    def add(self, source: Source, importer: str, at: Span) -> None:
        self.sources.setdefault(source.file, source)
        self.via.setdefault(source.file, (*self.via[importer], at))


def resolve(
    root: Mapping, files: Files, settings: MappingOf[str, Setting], found: list[Diagnostic]
) -> Resolved | None:
    """The mission `root` after imports, parameters and `like`; None when it has errors there."""
    base = _defaults(files, found)
    declared = declare(root.get("parameters"), settings, found)
    offers, plain, substitution = _offers(root, declared, files.mission, files, base, found)
    found += substitution.unused()
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
            room -= count(vehicle, room)
        if room <= 0:
            message = f"more than {MAX_AFTER_LIKE} values after `like`"
            found.append(Diagnostic("KYB126", message, entry.key.span))
            break
    chains.judge()
    airframes = _airframes(plain, offers)
    world = _world(plain, offers)
    if has_errors(found):
        return None
    entries = {**plain.entries, **airframes, **world}
    entries["vehicles"] = Entry(entries["vehicles"].key, Mapping(whole, vehicles.span))
    parameters = {name: d.parameter for name, d in declared.declared.items()}
    texts = (source.text for source in files.sources.values())
    names_points = any(PREFIX in text for text in texts) or any(
        isinstance(p.value, str) and p.value.startswith(PREFIX) for p in parameters.values()
    )
    return Resolved(Mapping(entries, root.span), parameters, names_points)


def _world(plain: Mapping, offers: Offers) -> dict[str, Entry]:
    """The entry `world`, whole; none where there is none."""
    written = plain.entries.get("world")
    if written is None or plain.get("world") is None:
        return {}
    whole = offers.started("worlds", written.value, written.value)
    return {} if whole is None else {"world": written._replace(value=whole)}


def _airframes(plain: Mapping, offers: Offers) -> dict[str, Entry]:
    """The entry `airframes`, each of them whole; none where there is none."""
    section = plain.entries.get("airframes")
    if section is None:
        return {}
    whole = {
        name: Entry(entry.key, body)
        for name, entry in entries_of(section.value).items()
        if (body := offers.get("airframes", name)) is not None
    }
    return {"airframes": Entry(section.key, Mapping(whole, section.key.span))}


def _offers(
    root: Mapping,
    declared: Parameters,
    place: Place,
    files: Files,
    base: Mapping,
    found: list[Diagnostic],
) -> tuple[Offers, Mapping, Substitution]:
    substitution = Substitution(declared, found)
    entries = {key: entry for key, entry in root.entries.items() if key not in _KEPT}
    if "$" in files.sources[place.file].text:
        for key, entry in entries.items():
            if key == "chains":
                substitution.note(entry.value)
                continue
            value = substitution.apply(entry.value, key == "expect")
            entries[key] = entry._replace(value=value)
    plain = Mapping(entries, root.span)
    imports = _imports(root.get("import"), substitution, place, files, base, found)
    return Offers(plain, imports, base, found, declared), plain, substitution


def _imports(
    section: Node | None,
    substitution: Substitution,
    place: Place,
    files: Files,
    base: Mapping,
    found: list[Diagnostic],
) -> dict[str, Offers | None]:
    entries = section.entries if isinstance(section, Mapping) else {}
    offers: dict[str, Offers | None] = {}
    for name, entry in entries.items():
        text, settings = _import_of(entry.value, substitution)
        target = None if text is None else find(text, place, files.root, found)
        if text is not None and target is not None:
            offers[name] = _library(target, text.span, settings, place, files, base, found)
        else:
            offers[name] = None
    return offers


def _import_of(node: Node, substitution: Substitution) -> tuple[Scalar | None, dict[str, Setting]]:
    if isinstance(node, Scalar):
        return node, {}
    assert isinstance(node, Mapping)
    file, given = node.get("from"), node.get("with")
    values = given.entries if isinstance(given, Mapping) else {}
    settings = {
        name: Setting(substitution.value(entry.value), entry.key.span)
        for name, entry in values.items()
    }
    return (file if isinstance(file, Scalar) else None), settings


def _library(
    target: Place,
    at: Span,
    settings: dict[str, Setting],
    importer: Place,
    files: Files,
    base: Mapping,
    found: list[Diagnostic],
) -> Offers | None:
    real = target.path.resolve()
    files.imports += 1
    if files.imports > MAX_IMPORTS:
        if files.imports == MAX_IMPORTS + 1:
            message = f"more than {MAX_IMPORTS} imports, counted along every way"
            found.append(Diagnostic("KYB127", message, at))
        return None
    if real in files.open or len(files.open) > _CHAIN:
        first = files.open.get(real, at)
        message = f"`{target.file}` is imported while it is being imported"
        found.append(Diagnostic("KYB122", message, at, notes=(f"first reached at {first.at}",)))
        return None
    library = read_library(target)
    files.add(library.source, importer.file, at)
    root = _library_root(library, at, found)
    if root is None:
        return None
    files.open[real] = at
    declared = declare(root.get("parameters"), settings, found)
    offers, _, _ = _offers(root, declared, target, files, base, found)
    del files.open[real]
    return offers


def _library_root(library: Library, at: Span, found: list[Diagnostic]) -> Mapping | None:
    found += library.findings
    root = library.source.root
    if library.findings or root is None:
        return None
    if isinstance(root, Mapping) and "library" in root.entries:
        return root
    message = f"`{library.source.file}` is no library"
    found.append(Diagnostic("KYB123", message, at, help="a library begins with `library: NAME`"))
    return None


def resolve_library(source: Source, files: Files, found: list[Diagnostic]) -> Mapping:
    """Find what is wrong with a library file on its own; its airframes, whole."""
    root = _library_root(judged(source), Span(source.file, 1, 1, 1, 1), found)
    if root is None:
        return EMPTY
    base = _defaults(files, found)
    declared = declare(root.get("parameters"), {}, found)
    offers, plain, substitution = _offers(root, declared, files.mission, files, base, found)
    found += substitution.unused()
    chains = Chains(offers, found)
    for name in offers.own("vehicles"):
        vehicle = offers.get("vehicles", name)
        if vehicle is not None:
            chains.expanded(vehicle)
    chains.judge()
    for name in offers.own("stacks"):
        offers.get("stacks", name)
    for name in offers.own("worlds"):
        world_of(offers.get("worlds", name), found)
    return Mapping(_airframes(plain, offers), root.span)


def _defaults(files: Files, found: list[Diagnostic]) -> Mapping:
    """The vehicle that every other one starts from."""
    home = installed("kybflow")
    if home is None:
        return EMPTY
    path = home / "defaults.yaml"
    place = Place(path, shown_path(path))
    library = read_library(place)
    files.sources.setdefault(place.file, library.source)
    files.via.setdefault(place.file, ())
    root = _library_root(library, Span(place.file, 1, 1, 1, 1), found)
    if root is None:
        return EMPTY
    offers, _, _ = _offers(root, Parameters({}, {}), place, files, EMPTY, found)
    return offers.get("vehicles", "default") or EMPTY
