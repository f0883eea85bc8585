"""Load imports: the exports of each imported file, with the values of its own parameters."""

from __future__ import annotations

import os
from pathlib import Path

from kybflow.dsl.diagnostics import Collector, Span, has_errors
from kybflow.dsl.language.records import EMPTY
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, entries_of
from kybflow.dsl.reading.reader import ParsedFile
from kybflow.dsl.resolving.exports import Exports
from kybflow.dsl.resolving.library_files import (
    LibraryFile,
    LibraryPath,
    find,
    installed,
    read_library,
    shown_path,
)
from kybflow.dsl.resolving.parameters import ParameterTable, Setting, Substitution, declare, known

CODES = {
    "KYB122": "Files import each other in a cycle.",
    "KYB123": "An imported file is not a library.",
    "KYB127": "The mission has too many imports, counted along every path to a library.",
}
MAX_IMPORTS = 200
_MAX_CHAIN = 20
_WITH = "with: {{{}: ...}}"
"""How an import sets a parameter."""
_KEPT = frozenset({"import", "parameters"})


class Files:
    """The files of one compilation: the mission and what it imports, as read.

    sources: the files by name. via: the spans of the imports through which each file was reached.
    open: the files that are being loaded, by real path, with the span that imports each.
    """

    def __init__(self, mission: ParsedFile, path: Path) -> None:
        self.root = path.parent
        self.sources: dict[str, ParsedFile] = {mission.file: mission}
        self.via: dict[str, tuple[Span, ...]] = {mission.file: ()}
        readable = mission.root is not None
        first = Span(mission.file, 1, 1, 1, 1)
        self.open: dict[str, Span] = {os.path.realpath(path): first} if readable else {}
        self.mission = LibraryPath(path, mission.file)
        self._imports = 0

    def add(self, source: ParsedFile, via: tuple[Span, ...]) -> None:
        self.sources.setdefault(source.file, source)
        self.via.setdefault(source.file, via)

    def may_open(self, target: LibraryPath, real: str, at: Span, found: Collector) -> bool:
        """Return whether the import of `target` at `at` may be followed; otherwise report why. A
        mission may have `MAX_IMPORTS` imports, and none of them may lead back to itself."""
        self._imports += 1
        if self._imports > MAX_IMPORTS:
            if self._imports == MAX_IMPORTS + 1:
                message = f"more than {MAX_IMPORTS} imports, counting those of imported files"
                found.report("KYB127", message, at, help="import fewer files that import others")
            return False
        if real not in self.open and len(self.open) <= _MAX_CHAIN:
            return True
        message = f"circular import: `{target.file}` leads back to itself"
        hint = "remove one of these imports, or move what both files need to a third one"
        if real not in self.open:
            message, hint = f"more than {_MAX_CHAIN} files import each other", "import it directly"
        notes = (f"first imported at {self.open.get(real, at).at}",)
        found.report("KYB122", message, at, notes=notes, help=hint)
        return False


def load(files: Files, root: Mapping, declared: ParameterTable, found: Collector) -> Exports:
    """Load all imports of the file under compilation, and return what the file exports. root: the
    file's top level. declared: its parameters."""
    substitution = Substitution(declared, found)
    loader = _Loader(files, _default_vehicle(files, found), found)
    exports = loader.exports(root, substitution, files.mission)
    substitution.judge()
    return exports


def _default_vehicle(files: Files, found: Collector) -> Mapping:
    """Return the vehicle that every other vehicle starts from."""
    home = installed("kybflow")
    if home is None:
        return EMPTY
    path = home / "defaults.yaml"
    place = LibraryPath(path, shown_path(path))
    library = read_library(place)
    files.add(library.source, ())
    root = library_root(library, Span(place.file, 1, 1, 1, 1), found)
    if root is None:
        return EMPTY
    unset = Substitution(ParameterTable({}, {}), found)
    exports = _Loader(files, EMPTY, found).exports(root, unset, place)
    return exports.get("vehicles", "default") or EMPTY


class _Loader:
    """Reads the imports of the files of one compilation. base: the vehicle that every other one
    starts from."""

    def __init__(self, files: Files, base: Mapping, found: Collector) -> None:
        self._files, self._base, self._found = files, base, found

    def exports(self, root: Mapping, substitution: Substitution, place: LibraryPath) -> Exports:
        """Return what the file `root` exports, with the values of its parameters."""
        entries = {key: entry for key, entry in root.entries.items() if key not in _KEPT}
        if "$" in self._files.sources[place.file].text:
            for key, entry in entries.items():
                if key == "chains":
                    substitution.note(entry.value)
                    continue
                value = substitution.apply(entry.value, key == "expect")
                entries[key] = entry._replace(value=value)
        imports = {
            name: self._imported(entry.value, substitution, place)
            for name, entry in entries_of(root.get("import")).items()
        }
        plain = Mapping(entries, root.span)
        return Exports(plain, imports, self._base, substitution.parameters, self._found)

    def _imported(
        self, node: Node, substitution: Substitution, importer: LibraryPath
    ) -> Exports | None:
        """Return what an imported file exports; None if there is no such file or it is not a
        library."""
        files, settings = self._files, dict[str, Setting]()
        text: Node | None = node
        if isinstance(node, Mapping):
            text = node.get("from")
            for name, entry in entries_of(node.get("with")).items():
                value = known(substitution.apply(entry.value))
                settings[name] = Setting(value, entry.key.span)
        if not isinstance(text, Scalar):
            return None
        target = find(text, importer, files.root, self._found)
        if target is None:
            return None
        at, real = text.span, os.path.realpath(target.path)
        if not files.may_open(target, real, at, self._found):
            return None
        library = read_library(target)
        files.add(library.source, (*files.via[importer.file], at))
        root = library_root(library, at, self._found)
        if root is None:
            return None
        files.open[real] = at
        declared = declare(root.get("parameters"), settings, self._found, set_by=_WITH)
        exports = self.exports(root, Substitution(declared, self._found), target)
        del files.open[real]
        return exports


def library_root(library: LibraryFile, at: Span, found: Collector) -> Mapping | None:
    """Return the top level of a library file. If it is not a valid library, report why and return
    None."""
    found.add(library.findings)
    root = library.source.root
    if has_errors(library.findings) or root is None:
        return None
    if isinstance(root, Mapping) and "library" in root.entries:
        return root
    message = f"`{library.source.file}` is not a library"
    found.report("KYB123", message, at, help="a library begins with `library: NAME`")
    return None
