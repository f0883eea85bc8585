"""Imports away: what each imported file exports, with its own parameters in place."""

from __future__ import annotations

import os
from pathlib import Path

from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, has_errors
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, entries_of
from kybflow.dsl.reading.reader import ParsedFile
from kybflow.dsl.resolving.exports import EMPTY, Exports
from kybflow.dsl.resolving.imports import (
    Library,
    LibraryPath,
    find,
    installed,
    read_library,
    shown_path,
)
from kybflow.dsl.resolving.parameters import ParameterTable, Setting, declare
from kybflow.dsl.resolving.substitution import Substitution

MAX_IMPORTS = 200
_CHAIN = 20
_WITH = "with: {{{}: ...}}"
"""How an import gives a parameter its value."""
_KEPT = frozenset({"import", "parameters"})


class Files:
    """The files of one compilation: the mission, and what it imports, as they are read."""

    def __init__(self, mission: ParsedFile, path: Path) -> None:
        self.root = path.parent
        self.sources: dict[str, ParsedFile] = {mission.file: mission}
        self.via: dict[str, tuple[Span, ...]] = {mission.file: ()}
        readable = mission.root is not None
        first = Span(mission.file, 1, 1, 1, 1)
        self.open: dict[str, Span] = {os.path.realpath(path): first} if readable else {}
        self.mission = LibraryPath(path, mission.file)
        self.imports = 0

    def add(self, source: ParsedFile, importer: str, at: Span) -> None:
        self.sources.setdefault(source.file, source)
        self.via.setdefault(source.file, (*self.via[importer], at))


def load(
    files: Files, root: Mapping, declared: ParameterTable
) -> Diagnosed[tuple[Exports, Mapping, Substitution]]:
    """Load every import of the file under compilation, whose top level is `root`. Returns what the
    file exports, the file with its parameters in place, and the record of which were used."""
    base = yield from _default_vehicle(files)
    return (yield from _Loader(files, base).exports(root, declared, files.mission))


def _default_vehicle(files: Files) -> Diagnosed[Mapping]:
    """The vehicle that every other one starts from."""
    home = installed("kybflow")
    if home is None:
        return EMPTY
    path = home / "defaults.yaml"
    place = LibraryPath(path, shown_path(path))
    library = read_library(place)
    files.sources.setdefault(place.file, library.source)
    files.via.setdefault(place.file, ())
    root = yield from library_root(library, Span(place.file, 1, 1, 1, 1))
    if root is None:
        return EMPTY
    exports, _, _ = yield from _Loader(files, EMPTY).exports(root, ParameterTable({}, {}), place)
    return (yield from exports.get("vehicles", "default")) or EMPTY


class _Loader:
    """Reads what the files of one compilation import. `base` is the vehicle that every other one
    starts from."""

    def __init__(self, files: Files, base: Mapping) -> None:
        self._files, self._base = files, base

    def exports(
        self, root: Mapping, declared: ParameterTable, place: LibraryPath
    ) -> Diagnosed[tuple[Exports, Mapping, Substitution]]:
        """What the file `root` exports, the file with its parameters in place, and the record of
        which were used."""
        substitution = Substitution(declared)
        entries = {key: entry for key, entry in root.entries.items() if key not in _KEPT}
        if "$" in self._files.sources[place.file].text:
            for key, entry in entries.items():
                if key == "chains":
                    substitution.note(entry.value)
                    continue
                value = yield from substitution.apply(entry.value, key == "expect")
                entries[key] = entry._replace(value=value)
        plain = Mapping(entries, root.span)
        imports = yield from self._imports(root.get("import"), substitution, place)
        return Exports(plain, imports, self._base, declared), plain, substitution

    def _imports(
        self, section: Node | None, substitution: Substitution, place: LibraryPath
    ) -> Diagnosed[dict[str, Exports | None]]:
        exports: dict[str, Exports | None] = {}
        for name, entry in entries_of(section).items():
            text, settings = yield from _import_of(entry.value, substitution)
            root, exports[name] = self._files.root, None
            target = None if text is None else (yield from find(text, place, root))
            if text is not None and target is not None:
                exports[name] = yield from self._library(target, text.span, settings, place)
        return exports

    def _library(
        self, target: LibraryPath, at: Span, settings: dict[str, Setting], importer: LibraryPath
    ) -> Diagnosed[Exports | None]:
        files, real = self._files, os.path.realpath(target.path)
        if not (yield from self._may_open(target, real, at)):
            return None
        library = read_library(target)
        files.add(library.source, importer.file, at)
        root = yield from library_root(library, at)
        if root is None:
            return None
        files.open[real] = at
        declared = yield from declare(root.get("parameters"), settings, set_by=_WITH)
        exports, _, _ = yield from self.exports(root, declared, target)
        del files.open[real]
        return exports

    def _may_open(self, target: LibraryPath, real: str, at: Span) -> Diagnosed[bool]:
        files = self._files
        files.imports += 1
        if files.imports > MAX_IMPORTS:
            if files.imports == MAX_IMPORTS + 1:
                message = f"more than {MAX_IMPORTS} imports, counted along every way"
                yield Diagnostic("KYB127", message, at)
            return False
        if real not in files.open and len(files.open) <= _CHAIN:
            return True
        first = files.open.get(real, at)
        message = f"`{target.file}` is imported while it is being imported"
        yield Diagnostic("KYB122", message, at, notes=(f"first reached at {first.at}",))
        return False


def _import_of(
    node: Node, substitution: Substitution
) -> Diagnosed[tuple[Scalar | None, dict[str, Setting]]]:
    """(the file that an import names, the values that it gives to the parameters of that)."""
    if isinstance(node, Scalar):
        return node, {}
    assert isinstance(node, Mapping)
    file, settings = node.get("from"), {}
    for name, entry in entries_of(node.get("with")).items():
        value = yield from substitution.value(entry.value)
        settings[name] = Setting(value, entry.key.span)
    return (file if isinstance(file, Scalar) else None), settings


def library_root(library: Library, at: Span) -> Diagnosed[Mapping | None]:
    """The top level of a library file; None, and findings, when it is none."""
    yield from library.findings
    root = library.source.root
    if has_errors(library.findings) or root is None:
        return None
    if isinstance(root, Mapping) and "library" in root.entries:
        return root
    message = f"`{library.source.file}` is no library"
    yield Diagnostic("KYB123", message, at, help="a library begins with `library: NAME`")
    return None
