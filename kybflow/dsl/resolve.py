"""Imports, parameters and `like` away: what is left is one tree with every value in its place, and
every node still knows where it was written."""

from __future__ import annotations

from collections.abc import Mapping as MappingOf
from pathlib import Path
from typing import NamedTuple

from kybflow.dsl.diagnostics import Diagnostic, did_you_mean, has_errors
from kybflow.dsl.document import Parameter
from kybflow.dsl.imports import Place, find, installed, read_library, shown_path
from kybflow.dsl.judge import judge_file
from kybflow.dsl.like import merge
from kybflow.dsl.nodes import Entry, Mapping, Node, Scalar, count
from kybflow.dsl.parameters import Declared, Substitution, declare
from kybflow.dsl.reader import Source
from kybflow.dsl.source import Span

MAX_AFTER_LIKE = 100_000
_CHAIN = 20
_EMPTY = Mapping({}, Span("", 1, 1, 1, 1))
_KEPT = frozenset({"import", "parameters"})


class Resolved(NamedTuple):
    """A mission after imports, parameters and `like`: its top level, whose `vehicles` are whole."""

    root: Mapping
    parameters: dict[str, Parameter]


class Files:
    """The files of one compilation: the mission, and what it imports, as they are read."""

    def __init__(self, mission: Source, path: Path) -> None:
        self.root = path.parent
        self.sources: dict[str, Source] = {mission.file: mission}
        self.via: dict[str, tuple[Span, ...]] = {mission.file: ()}
        self.open: dict[Path, Span] = {path.resolve(): Span(mission.file, 1, 1, 1, 1)}
        self.mission = Place(path, mission.file)

    def add(self, source: Source, importer: str, at: Span) -> None:
        self.sources.setdefault(source.file, source)
        self.via.setdefault(source.file, (*self.via[importer], at))


class Offers:
    """The airframes and vehicles of one file, whole; each is resolved when it is first asked for."""

    def __init__(
        self, root: Mapping, imports: dict[str, Offers], base: Mapping, found: list[Diagnostic]
    ) -> None:
        self._root = root
        self._imports = imports
        self._base = base
        self._found = found
        self._done: dict[tuple[str, str], Mapping | None] = {}
        self._open: list[tuple[str, str]] = []

    def names(self, section: str) -> list[str]:
        node = self._root.get(section)
        own = list(node.entries) if isinstance(node, Mapping) else []
        return own + [f"{i}.{n}" for i, o in self._imports.items() for n in o.names(section)]

    def get(self, section: str, name: str) -> Mapping | None:
        """The whole entry; None when it has errors or doesn't exist."""
        key = (section, name)
        if key not in self._done:
            self._open.append(key)
            self._done[key] = self._whole(section, name)
            self._open.pop()
        return self._done[key]

    def _whole(self, section: str, name: str) -> Mapping | None:
        node = self._root.get(section)
        own = node.get(name) if isinstance(node, Mapping) else None
        if not isinstance(own, Mapping):
            own = _EMPTY
        like = own.get("like")
        base = self._base if section == "vehicles" else _EMPTY
        if isinstance(like, Scalar):
            found = self.named(section, like)
            if found is None:
                return None
            base = found
        plain = Mapping({k: e for k, e in own.entries.items() if k != "like"}, own.span)
        whole = merge(base, plain)
        airframe = plain.entries.get("airframe")
        if section == "vehicles" and airframe and isinstance(airframe.value, Scalar):
            body = None if airframe.value.is_null else self.named("airframes", airframe.value)
            if body is None:
                return None
            whole.entries["airframe"] = Entry(airframe.key, body)
        return whole

    def named(self, section: str, name: Scalar) -> Mapping | None:
        """The entry that `name` (`x`, or `import.x`) means here."""
        key = (section, name.text)
        if key in self._open or len(self._open) > _CHAIN:
            chain = " is like ".join(f"`{n}`" for _, n in (*self._open, key))
            self._found.append(
                Diagnostic("KYB125", f"{chain[:200]}: this never ends", name.span)
            )
            return None
        library, _, inner = name.text.rpartition(".")
        if library in self._imports:
            if inner in self._imports[library].names(section):
                return self._imports[library].get(section, inner)
        elif not library and inner in self.names(section):
            return self.get(section, inner)
        what = "vehicle" if section == "vehicles" else "airframe"
        self._found.append(
            Diagnostic(
                "KYB124",
                f"no {what} is called `{name.text}`",
                name.span,
                help=did_you_mean(name.text, self.names(section)) or f"none is under `{section}`",
            )
        )
        return None


def resolve(
    root: Mapping, files: Files, settings: MappingOf[str, Node], found: list[Diagnostic]
) -> Resolved | None:
    """The mission `root` after imports, parameters and `like`; None when it has errors there."""
    base = _defaults(files, found)
    declared = declare(root.get("parameters"), settings, found)
    offers, plain, substitution = _offers(root, declared, files.mission, files, base, found)
    found += substitution.unused()
    vehicles = plain.get("vehicles")
    assert isinstance(vehicles, Mapping)
    whole: dict[str, Entry] = {}
    room = MAX_AFTER_LIKE
    for name, entry in vehicles.entries.items():
        vehicle = offers.get("vehicles", name)
        if vehicle is not None:
            whole[name] = Entry(entry.key, vehicle)
            room -= count(vehicle, room)
        if room <= 0:
            message = f"more than {MAX_AFTER_LIKE} values after `like`"
            found.append(Diagnostic("KYB126", message, entry.key.span))
            break
    if has_errors(found):
        return None
    entries = {**plain.entries}
    entries["vehicles"] = Entry(entries["vehicles"].key, Mapping(whole, vehicles.span))
    parameters = {name: d.parameter for name, d in declared.items()}
    return Resolved(Mapping(entries, root.span), parameters)


def _offers(
    root: Mapping,
    declared: dict[str, Declared],
    place: Place,
    files: Files,
    base: Mapping,
    found: list[Diagnostic],
) -> tuple[Offers, Mapping, Substitution]:
    substitution = Substitution(declared, found)
    entries = {
        key: entry._replace(value=substitution.apply(entry.value, key == "expect"))
        for key, entry in root.entries.items()
        if key not in _KEPT
    }
    plain = Mapping(entries, root.span)
    imports = _imports(root.get("import"), substitution, place, files, base, found)
    return Offers(plain, imports, base, found), plain, substitution


def _imports(
    section: Node | None,
    substitution: Substitution,
    place: Place,
    files: Files,
    base: Mapping,
    found: list[Diagnostic],
) -> dict[str, Offers]:
    entries = section.entries if isinstance(section, Mapping) else {}
    offers: dict[str, Offers] = {}
    for name, entry in entries.items():
        text, settings = _import_of(entry.value, substitution)
        target = None if text is None else find(text, place, files.root, found)
        if text is not None and target is not None:
            one = _library(target, text.span, settings, place, files, base, found)
            if one is not None:
                offers[name] = one
    return offers


def _import_of(
    node: Node, substitution: Substitution
) -> tuple[Scalar | None, dict[str, Node]]:
    if isinstance(node, Scalar):
        return node, {}
    assert isinstance(node, Mapping)
    file, given = node.get("from"), node.get("with")
    values = given.entries if isinstance(given, Mapping) else {}
    settings = {name: substitution.apply(entry.value) for name, entry in values.items()}
    return (file if isinstance(file, Scalar) else None), settings


def _library(
    target: Place,
    at: Span,
    settings: dict[str, Node],
    importer: Place,
    files: Files,
    base: Mapping,
    found: list[Diagnostic],
) -> Offers | None:
    real = target.path.resolve()
    if real in files.open or len(files.open) > _CHAIN:
        first = files.open.get(real, at)
        message = f"`{target.file}` is imported while it is being imported"
        found.append(Diagnostic("KYB122", message, at, notes=(f"first reached at {first.at}",)))
        return None
    source = read_library(target)
    files.add(source, importer.file, at)
    root = _library_root(source, at, found)
    if root is None:
        return None
    files.open[real] = at
    declared = declare(root.get("parameters"), settings, found)
    offers, _, _ = _offers(root, declared, target, files, base, found)
    del files.open[real]
    return offers


def _library_root(source: Source, at: Span, found: list[Diagnostic]) -> Mapping | None:
    found += source.found
    root = source.root
    if source.found or root is None:
        return None
    if not isinstance(root, Mapping) or "library" not in root.entries:
        found.append(
            Diagnostic(
                "KYB123",
                f"`{source.file}` is no library",
                at,
                help="a library begins with `library: NAME`",
            )
        )
        return None
    findings = judge_file(root, "library")
    found += findings
    return None if findings else root


def _defaults(files: Files, found: list[Diagnostic]) -> Mapping:
    """The vehicle that every other one starts from."""
    home = installed("kybflow")
    if home is None:
        return _EMPTY
    path = home / "defaults.yaml"
    place = Place(path, shown_path(path))
    source = read_library(place)
    files.sources.setdefault(source.file, source)
    files.via.setdefault(source.file, ())
    root = _library_root(source, Span(source.file, 1, 1, 1, 1), found)
    if root is None:
        return _EMPTY
    offers, _, _ = _offers(root, {}, place, files, _EMPTY, found)
    return offers.get("vehicles", "default") or _EMPTY
