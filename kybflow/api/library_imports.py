"""What `kybflow library` tells of a file, and of a name that a mission gives to an import."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from kybflow.api.library import Shipped, contents, entry_text, libraries, missions, read_file
from kybflow.core.errors import KybflowError
from kybflow.dsl.diagnostics.diagnostic import collect
from kybflow.dsl.diagnostics.render import render
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, entries_of
from kybflow.dsl.resolving.imports import Place, find

_MOST = 200
"""Files of a folder that are looked at."""


class Import(NamedTuple):
    """One import of a file: its name there, what is written for it, the library that it means, None
    where there is none."""

    name: str
    written: str
    library: Shipped | None


def is_file(name: str) -> bool:
    """Whether a name is that of a YAML file."""
    return Path(name).suffix in (".yaml", ".yml")


def show_file(path: Path) -> str:
    """What the file at `path` offers, and what each of its imports does. Raises KybflowError for
    one that can't be read."""
    one = read_file(str(path), path)
    if one.root is None:
        first = next(iter(one.source.found), None)
        texts = {one.source.file: one.source.text}
        raise KybflowError(render(first, texts) if first else f"`{path}` is no mission or library")
    blocks = ["\n".join(contents(one))]
    for own in imports_of(one):
        heading = f"import {own.name}, {own.written}"
        if own.library is None:
            blocks.append(f"{heading}: no such library")
            continue
        _, *lines = contents(own.library)
        blocks.append("\n".join([f"{heading}  {own.library.summary}".rstrip(), *lines]))
    return "\n\n".join(blocks)


def imports_of(one: Shipped) -> Iterator[Import]:
    """The imports of a file."""
    root = one.path.parent
    for name, entry in entries_of(one.root.get("import") if one.root else None).items():
        text = _from(entry.value)
        if text is not None:
            place = collect(find(text, Place(one.path, str(one.path)), root)).value
            yield Import(name, text.text, _library(text.text, place) if place else None)


def _library(written: str, place: Place) -> Shipped:
    """The library at `place`, called as every mission may import it."""
    shipped = (one for one in libraries() if one.path.samefile(place.path))
    return next(shipped, None) or read_file(written, place.path)


def _from(node: Node) -> Scalar | None:
    """What an import names."""
    inner = node.get("from") if isinstance(node, Mapping) else node
    return inner if isinstance(inner, Scalar) else None


def show_import(name: str) -> str | None:
    """What the library has that a mission here, or else one that is shipped, imports as `name`; or
    one entry of it, `name.ENTRY`. None where no mission imports anything by that name."""
    alias, _, inner = name.partition(".")
    for mission in (*_here(), *missions()):
        library = next((i.library for i in imports_of(mission) if i.name == alias), None)
        if library is None:
            continue
        if not inner:
            what = f"# `{alias}` in {mission.path.name}"
            return "\n".join([what, *contents(library)])
        found = [entry_text(library, s, e) for s, own, e in library.entries() if own == inner]
        if found:
            return "\n\n".join(found)
    return None


def _here() -> Iterator[Shipped]:
    """The YAML files of the folder where the command was given."""
    for path in sorted(itertools.islice(Path().glob("*.yaml"), _MOST)):
        yield read_file(str(path), path)
