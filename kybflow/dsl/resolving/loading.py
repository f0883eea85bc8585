"""Imports away: what each imported file offers, with its own parameters in place."""

from __future__ import annotations

from pathlib import Path

from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, entries_of
from kybflow.dsl.reading.reader import Source
from kybflow.dsl.reading.source import Span
from kybflow.dsl.resolving.imports import Library, Place, find, installed, read_library, shown_path
from kybflow.dsl.resolving.offers import EMPTY, Offers
from kybflow.dsl.resolving.parameters import Parameters, Setting, declare
from kybflow.dsl.resolving.substitution import Substitution

MAX_IMPORTS = 200
_CHAIN = 20
_WITH = "with: {{{}: ...}}"
"""How an import gives a parameter its value."""
_KEPT = frozenset({"import", "parameters"})


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


class Loader:
    """Reads what the files of one compilation import. `base` is the vehicle that every other one
    starts from."""

    def __init__(self, files: Files, found: list[Diagnostic]) -> None:
        self._files, self._found = files, found
        self._base = EMPTY
        self._base = self._defaults()

    def offers(
        self, root: Mapping, declared: Parameters, place: Place
    ) -> tuple[Offers, Mapping, Substitution]:
        """What the file `root` offers; itself with its parameters in place; which were used."""
        substitution = Substitution(declared, self._found)
        entries = {key: entry for key, entry in root.entries.items() if key not in _KEPT}
        if "$" in self._files.sources[place.file].text:
            for key, entry in entries.items():
                if key == "chains":
                    substitution.note(entry.value)
                    continue
                value = substitution.apply(entry.value, key == "expect")
                entries[key] = entry._replace(value=value)
        plain = Mapping(entries, root.span)
        imports = self._imports(root.get("import"), substitution, place)
        return Offers(plain, imports, self._base, self._found, declared), plain, substitution

    def _imports(
        self, section: Node | None, substitution: Substitution, place: Place
    ) -> dict[str, Offers | None]:
        offers: dict[str, Offers | None] = {}
        for name, entry in entries_of(section).items():
            text, settings = _import_of(entry.value, substitution)
            root = self._files.root
            target = None if text is None else find(text, place, root, self._found)
            if text is not None and target is not None:
                offers[name] = self._library(target, text.span, settings, place)
            else:
                offers[name] = None
        return offers

    def _library(
        self, target: Place, at: Span, settings: dict[str, Setting], importer: Place
    ) -> Offers | None:
        files, real = self._files, target.path.resolve()
        if not self._may_open(target, real, at):
            return None
        library = read_library(target)
        files.add(library.source, importer.file, at)
        root = library_root(library, at, self._found)
        if root is None:
            return None
        files.open[real] = at
        declared = declare(root.get("parameters"), settings, self._found, set_by=_WITH)
        offers, _, _ = self.offers(root, declared, target)
        del files.open[real]
        return offers

    def _may_open(self, target: Place, real: Path, at: Span) -> bool:
        files = self._files
        files.imports += 1
        if files.imports > MAX_IMPORTS:
            if files.imports == MAX_IMPORTS + 1:
                message = f"more than {MAX_IMPORTS} imports, counted along every way"
                self._found.append(Diagnostic("KYB127", message, at))
            return False
        if real not in files.open and len(files.open) <= _CHAIN:
            return True
        first = files.open.get(real, at)
        message = f"`{target.file}` is imported while it is being imported"
        notes = (f"first reached at {first.at}",)
        self._found.append(Diagnostic("KYB122", message, at, notes=notes))
        return False

    def _defaults(self) -> Mapping:
        home, files = installed("kybflow"), self._files
        if home is None:
            return EMPTY
        path = home / "defaults.yaml"
        place = Place(path, shown_path(path))
        library = read_library(place)
        files.sources.setdefault(place.file, library.source)
        files.via.setdefault(place.file, ())
        root = library_root(library, Span(place.file, 1, 1, 1, 1), self._found)
        if root is None:
            return EMPTY
        offers, _, _ = self.offers(root, Parameters({}, {}), place)
        return offers.get("vehicles", "default") or EMPTY


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


def library_root(library: Library, at: Span, found: list[Diagnostic]) -> Mapping | None:
    """The top level of a library file; None, and findings, when it is none."""
    found += library.findings
    root = library.source.root
    if library.findings or root is None:
        return None
    if isinstance(root, Mapping) and "library" in root.entries:
        return root
    message = f"`{library.source.file}` is no library"
    found.append(Diagnostic("KYB123", message, at, help="a library begins with `library: NAME`"))
    return None
