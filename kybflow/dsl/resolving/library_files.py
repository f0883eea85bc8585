"""Find the file that an import names: beside the importing file, or else in an installed library,
and never outside both."""

from __future__ import annotations

import functools
import importlib.util
import itertools
import os
from importlib.metadata import entry_points
from pathlib import Path
from typing import NamedTuple

import kybflow
from kybflow.core.text import nearest
from kybflow.dsl.diagnostics import Collector, Diagnostic, has_errors
from kybflow.dsl.language.judge import judge_file
from kybflow.dsl.plan import Library
from kybflow.dsl.reading.nodes import Mapping, Scalar
from kybflow.dsl.reading.reader import MOST_FILES, ParsedFile, read

CODES = {
    "KYB120": "An import names a missing file.",
    "KYB121": "An import is outside the mission's folder and the installed libraries.",
}
GROUP = "kybflow.missions"
_STANDARD = "the standard library is `kybflow/airframes`"


class LibraryPath(NamedTuple):
    """A file to import. path: where it is. file: its name in reports."""

    path: Path
    file: str


def find(text: Scalar, importer: LibraryPath, root: Path, found: Collector) -> LibraryPath | None:
    """Return the file that `text` names in the file `importer`, or report why there is none and
    return None. root: the folder of the mission."""
    try:
        place = _search(Path(text.text), importer, root)
    except PermissionError:
        message = f"`{text.text}` is outside of the mission's folder"
        hint = "import files beside or below the mission, or from an installed library"
        found.report("KYB121", message, text.span, help=hint)
        return None
    except (OSError, ValueError):  # not a possible file name
        place = None
    if place is None:
        notes = ("looked beside the importing file and in the installed libraries",)
        near = nearest(text.text, _at_hand(importer, text.text))
        hint = f"did you mean `{near}`?" if near else _STANDARD
        message = f"there is no file `{text.text}`"
        found.report("KYB120", message, text.span, notes=notes, help=hint)
    return place


def _search(relative: Path, importer: LibraryPath, root: Path) -> LibraryPath | None:
    """Return the file beside the importer, or else in an installed library; None if there is none.
    Files of the standard library may import each other. Raises PermissionError for a file outside
    these folders."""
    beside, standard = importer.path.parent / relative, installed("kybflow")
    is_standard = standard is not None and importer.path.is_relative_to(standard)
    own = standard if standard and is_standard else importer.path.parent
    if relative.is_absolute() or not _within(beside, (root, own)):
        raise PermissionError
    if os.path.isfile(beside):
        folder = os.path.dirname(importer.file)
        return LibraryPath(beside, os.path.normpath(os.path.join(folder, relative)))
    home = installed(relative.parts[0]) if len(relative.parts) > 1 else None
    if home is None:
        return None
    path = home.joinpath(*relative.parts[1:])
    path = path if path.suffix else path.with_suffix(".yaml")
    if not _within(path, (home,)):
        raise PermissionError
    return LibraryPath(path, shown_path(path)) if os.path.isfile(path) else None


def _at_hand(importer: LibraryPath, name: str) -> list[str]:
    """Return the names that an import could have been meant for: files in the folder of `name`, and
    installed libraries."""
    folder = os.path.dirname(name)
    beside = importer.path.parent / folder
    shown: list[str] = []
    if "\0" not in folder and _within(beside, (importer.path.parent,)) and os.path.isdir(beside):
        files = itertools.islice(beside.glob("*.yaml"), MOST_FILES)
        shown += sorted(os.path.join(folder, f.name) for f in files if f != importer.path)
    packages = {"kybflow", *(entry.name for entry in entry_points(group=GROUP))}
    for package in sorted(packages):
        home = installed(package)
        shown += [f"{package}/{f.stem}" for f in sorted(home.glob("*.yaml"))] if home else []
    return shown


def _within(path: Path, roots: tuple[Path, ...]) -> bool:
    real, homes = os.path.realpath(path), map(os.path.realpath, roots)
    return any(os.path.commonpath((real, home)) == home for home in homes)


def shown_path(path: Path) -> str:
    """Return `path` as reports show it: relative to the working directory if it is below it."""
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)


@functools.cache
def installed(name: str) -> Path | None:
    """Return the folder of the mission libraries in the package `name`, or None if the package has
    none.

    The folder of kybflow itself is `kybflow/missions/library` in a wheel and `missions/library` in
    a checkout. Other packages are found through the entry-point group `kybflow.missions`.
    """
    if name == "kybflow":
        package = Path(kybflow.__file__).parent
        folders = (package / "missions", package.parent / "missions")
        return next((f / "library" for f in folders if f.is_dir()), None)
    for entry in entry_points(group=GROUP, name=name):
        try:
            spec = importlib.util.find_spec(entry.value)
        except ModuleNotFoundError:
            continue
        for folder in (spec.submodule_search_locations or ()) if spec else ():
            return Path(folder) / "library"
    return None


def without_homes(text: str) -> str:
    """Return `text` with the paths of installed libraries beginning with the package's name instead
    of its folder: `kybflow/missions/library/airframes.yaml`."""
    for home, name in _homes().items():
        text = text.replace(home, name)
    return text


@functools.cache
def _homes() -> dict[str, str]:
    """Return the folder of each installed library, with its name in reports."""
    packages = ("kybflow", *(entry.name for entry in entry_points(group=GROUP)))
    folders = {name: installed(name) for name in dict.fromkeys(packages)}
    return {f"{f}/": f"{name}/missions/library/" for name, f in folders.items() if f is not None}


class LibraryFile(NamedTuple):
    """A library file as read, and the findings about its shape."""

    source: ParsedFile
    findings: tuple[Diagnostic, ...]


def judged(source: ParsedFile) -> LibraryFile:
    """Return the library with the findings about its shape."""
    root = source.root
    if has_errors(source.found) or not isinstance(root, Mapping) or "library" not in root.entries:
        return LibraryFile(source, source.found)
    return LibraryFile(source, (*source.found, *judge_file(root, Library)))


@functools.lru_cache(maxsize=64)
def _read(place: LibraryPath, _modified: int, _size: int) -> LibraryFile:
    return judged(read(place.path, place.file))


def read_library(place: LibraryPath) -> LibraryFile:
    """Return a library file. It is read and checked again only if it has changed."""
    try:
        status = place.path.stat()
    except OSError:
        return judged(read(place.path, place.file))
    return _read(place, status.st_mtime_ns, status.st_size)
