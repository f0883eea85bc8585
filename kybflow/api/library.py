"""What installed packages ship for missions: libraries and missions, and what a file imports."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import NamedTuple

from kybflow.dsl.diagnostics.diagnostic import Findings
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, entries_of
from kybflow.dsl.reading.reader import ParsedFile, read
from kybflow.dsl.resolving.exports import SECTIONS
from kybflow.dsl.resolving.library_files import GROUP, LibraryPath, find, installed

OWN = "kybflow"
"""The package whose missions need no package before their name."""


@dataclass(frozen=True, slots=True)
class Shipped:
    """A YAML file that missions import or start from, and the name by which they call it."""

    name: str
    source: ParsedFile
    path: Path

    @property
    def summary(self) -> str:
        return text_of(self.root.get("summary")) if self.root else ""

    @property
    def root(self) -> Mapping | None:
        """Its top level; None where it can't be read."""
        root = self.source.root
        return root if isinstance(root, Mapping) else None

    def entries(self) -> Iterator[tuple[str, str, MappingEntry]]:
        """(section, name, entry) of everything that it offers."""
        for section in SECTIONS if self.root else ():
            for name, entry in entries_of(self.root.get(section)).items() if self.root else ():
                yield section, name, entry


def libraries() -> list[Shipped]:
    """The libraries of every package."""
    return [read_file(name, path) for name, path in _library_files()]


def _library_files() -> Iterator[tuple[str, Path]]:
    for package, folder in _homes():
        for path in sorted(folder.glob("*.yaml")):
            yield f"{package}/{path.stem}", path


def missions() -> list[Shipped]:
    """The missions of every package; those of others than kybflow with its name before theirs."""
    return [
        read_file(path.stem if package == OWN else f"{package}/{path.stem}", path)
        for package, folder in _homes()
        for path in sorted(folder.parent.glob("*.yaml"))
    ]


def hollow() -> list[str]:
    """The packages that promise missions, and of which no file is installed."""
    shipped = {one.name.partition("/")[0] for one in (*libraries(), *missions())}
    return sorted({entry.name for entry in entry_points(group=GROUP)} - shipped - {OWN})


def _homes() -> Iterator[tuple[str, Path]]:
    names = dict.fromkeys([OWN, *sorted(entry.name for entry in entry_points(group=GROUP))])
    for name in names:
        home = installed(name)
        if home is not None:
            yield name, home


def read_file(name: str, path: Path) -> Shipped:
    """The file at `path`, called `name`."""
    return Shipped(name, read(path, str(path)), path)


class Import(NamedTuple):
    """An import of a file: its name there, the text that names the library, and that library, None
    where there is none."""

    name: str
    written: str
    library: Shipped | None


def imports_of(one: Shipped) -> Iterator[Import]:
    """The imports of a file."""
    root = one.path.parent
    for name, entry in entries_of(one.root.get("import") if one.root else None).items():
        text = _from(entry.value)
        if text is not None:
            place = find(text, LibraryPath(one.path, str(one.path)), root, Findings())
            yield Import(name, text.text, _library(text.text, place) if place else None)


def _library(written: str, place: LibraryPath) -> Shipped:
    """The library at `place`, called as every mission may import it."""
    shipped = (name for name, path in _library_files() if path.samefile(place.path))
    return read_file(next(shipped, written), place.path)


def _from(node: Node) -> Scalar | None:
    """What an import names."""
    inner = node.get("from") if isinstance(node, Mapping) else node
    return inner if isinstance(inner, Scalar) else None


def text_of(node: Node | None) -> str:
    """The text of a scalar, empty for anything else."""
    return node.text if isinstance(node, Scalar) else ""
