"""Lists the libraries and missions that installed packages ship and the imports of a file, and
copies a shipped mission for `kybflow new`."""

from __future__ import annotations

import os
import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import NamedTuple

from kybflow.core.errors import KybflowError
from kybflow.core.files import read_all
from kybflow.core.names import CHARACTER, LETTER, name_flaw
from kybflow.core.text import did_you_mean
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.diagnostics import Collector, Span
from kybflow.dsl.language.published import schema_text
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, entries_of
from kybflow.dsl.reading.reader import ParsedFile, read
from kybflow.dsl.resolving.exports import SECTIONS
from kybflow.dsl.resolving.library_files import GROUP, LibraryPath, find, installed
from kybflow.parts.catalog import load_catalog

OWN = "kybflow"
"""The package whose missions are named without a package."""


@dataclass(frozen=True, slots=True)
class Shipped:
    """A YAML file that missions can import or copy. name: the name by which missions refer to the
    file."""

    name: str
    source: ParsedFile
    path: Path

    @property
    def summary(self) -> str:
        return text_of(self.root.get("summary")) if self.root else ""

    @property
    def root(self) -> Mapping | None:
        """The top-level mapping; None if the file can't be read."""
        root = self.source.root
        return root if isinstance(root, Mapping) else None

    def entries(self) -> Iterator[tuple[str, str, MappingEntry]]:
        """Yield (section, name, entry) for everything that a mission can import from the file."""
        for section in SECTIONS if self.root else ():
            for name, entry in entries_of(self.root.get(section)).items() if self.root else ():
                yield section, name, entry


def libraries() -> list[Shipped]:
    """Return the libraries of every installed package."""
    return [read_file(name, path) for name, path in _library_files()]


def _library_files() -> Iterator[tuple[str, Path]]:
    for package, folder in _homes():
        for path in sorted(folder.glob("*.yaml")):
            yield f"{package}/{path.stem}", path


def missions() -> list[Shipped]:
    """Return the missions of every installed package, named PACKAGE/NAME, or NAME for kybflow's
    own."""
    return [
        read_file(path.stem if package == OWN else f"{package}/{path.stem}", path)
        for package, folder in _homes()
        for path in sorted(folder.parent.glob("*.yaml"))
    ]


def hollow() -> list[str]:
    """Return the packages that declare libraries but install no library or mission."""
    shipped = {one.name.partition("/")[0] for one in (*libraries(), *missions())}
    return sorted({entry.name for entry in entry_points(group=GROUP)} - shipped - {OWN})


def _homes() -> Iterator[tuple[str, Path]]:
    names = dict.fromkeys([OWN, *sorted(entry.name for entry in entry_points(group=GROUP))])
    for name in names:
        home = installed(name)
        if home is not None:
            yield name, home


def read_file(name: str, path: Path) -> Shipped:
    return Shipped(name, read(path, str(path)), path)


class Import(NamedTuple):
    """One import of a file. name: the name of the import in the file. written: the library as the
    file names it. library: the imported library, None if it doesn't exist."""

    name: str
    written: str
    library: Shipped | None


def imports_of(one: Shipped) -> Iterator[Import]:
    root = one.path.parent
    for name, entry in entries_of(one.root.get("import") if one.root else None).items():
        text = entry.value.get("from") if isinstance(entry.value, Mapping) else entry.value
        if isinstance(text, Scalar):
            place = find(text, LibraryPath(one.path, str(one.path)), root, Collector())
            library = None
            if place is not None:  # named as any mission can import it, or else as written here
                names = (name for name, path in _library_files() if path.samefile(place.path))
                library = read_file(next(names, text.text), place.path)
            yield Import(name, text.text, library)


def text_of(node: Node | None) -> str:
    """Return the text of a scalar node, or an empty string for any other node."""
    return node.text if isinstance(node, Scalar) else ""


SCHEMA = "mission.schema.json"
"""The JSON schema for editors, in the same folder as the missions."""
_NAME = re.compile(rf"{LETTER}{CHARACTER}{{0,59}}\Z")
_LINE = f"# yaml-language-server: $schema={SCHEMA}\n"


def scaffold(name: str, origin: str, folder: Path) -> tuple[Path, ...]:
    """Copy the shipped mission `origin` into `folder` under the name `name`, with the files that it
    uses, and the JSON schema for editors if `folder` has none. Return the written files: attached
    files, mission, schema. Never overwrites a file. Raises KybflowError."""
    name = unicodedata.normalize("NFC", name)
    if not _NAME.match(name) or name_flaw(name):
        raise KybflowError(f"`{name}` can't be the name of a mission: letters, digits and `_`")
    path, schema, known = folder / f"{name}.yaml", folder / SCHEMA, {m.name: m for m in missions()}
    one = known.get(origin.removeprefix(f"{OWN}/").removesuffix(".yaml"))
    if one is None or one.root is None:
        hint = did_you_mean(origin, known)
        raise KybflowError(f"no package ships a mission `{origin}`; {hint}")
    plan = compile_mission(one.path, catalog=load_catalog()).plan
    used = [Path(source.path) for source in plan.sources] if plan is not None else []
    wanted = {
        folder / os.path.relpath(file, one.path.parent): file.read_text(encoding="utf-8")
        for file in used
        if file.suffix not in (".yaml", ".yml")
    }
    for file, text in list(wanted.items()):
        if file.is_file() and read_all(file) == text.encode():
            del wanted[file]
    wanted[path] = _rewritten(one, name)
    if not schema.exists():
        wanted[schema] = schema_text(load_catalog())
    taken = next((file for file in wanted if file.exists()), None)
    if taken is not None:
        raise KybflowError(f"`{taken}` already exists; nothing was written")
    for file, text in wanted.items():
        _write(file, text)
    return tuple(wanted)


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as stream:
            stream.write(text)
    except FileExistsError:
        raise KybflowError(f"`{path}` already exists; nothing was written") from None
    except OSError as error:
        raise KybflowError(f"`{path}` can't be written: {error.strerror}") from None


def _rewritten(one: Shipped, name: str) -> str:
    """Return the mission's text with its new name, with libraries imported by package, and with the
    line that names the schema."""
    root = one.root
    assert isinstance(root, Mapping)
    changes: list[tuple[Span, str]] = []
    mission = root.get("mission")
    if isinstance(mission, Scalar):
        changes.append((mission.span, name))
    known = {os.path.realpath(library.path): library.name for library in libraries()}
    for entry in entries_of(root.get("import")).values():
        written = entry.value
        file = written.get("from") if isinstance(written, Mapping) else written
        target = os.path.realpath(one.path.parent / file.text) if isinstance(file, Scalar) else ""
        if isinstance(file, Scalar) and target in known:
            changes.append((file.span, known[target]))
    lines = one.source.text.splitlines(keepends=True)
    for span, text in sorted(changes, key=lambda change: change[0].column, reverse=True):
        line = lines[span.line - 1]
        lines[span.line - 1] = line[: span.column - 1] + text + line[span.end_column - 1 :]
    kept = [line for line in lines if not line.startswith("# yaml-language-server:")]
    return _LINE + "".join(kept)
