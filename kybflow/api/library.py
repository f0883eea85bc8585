"""Lists the libraries and missions that installed packages ship, and the imports of a file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import NamedTuple

from kybflow.dsl.diagnostics import Findings
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, entries_of
from kybflow.dsl.reading.reader import ParsedFile, read
from kybflow.dsl.resolving.exports import SECTIONS
from kybflow.dsl.resolving.library_files import GROUP, LibraryPath, find, installed

OWN = "kybflow"
"""The package whose missions are named without a package."""


@dataclass(frozen=True, slots=True)
class Shipped:
    """A YAML file that missions can import or copy. name: the name by which they refer to it."""

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
    """One import of a file. name: its name in the file. written: the library as the file names it.
    library: that library, None if it doesn't exist."""

    name: str
    written: str
    library: Shipped | None


def imports_of(one: Shipped) -> Iterator[Import]:
    root = one.path.parent
    for name, entry in entries_of(one.root.get("import") if one.root else None).items():
        text = entry.value.get("from") if isinstance(entry.value, Mapping) else entry.value
        if isinstance(text, Scalar):
            place = find(text, LibraryPath(one.path, str(one.path)), root, Findings())
            yield Import(name, text.text, _library(text.text, place) if place else None)


def _library(written: str, place: LibraryPath) -> Shipped:
    """Return the library at `place`. Its name is the one by which any mission can import it, or
    else `written`."""
    shipped = (name for name, path in _library_files() if path.samefile(place.path))
    return read_file(next(shipped, written), place.path)


def text_of(node: Node | None) -> str:
    """Return the text of a scalar node, or an empty string for any other node."""
    return node.text if isinstance(node, Scalar) else ""
