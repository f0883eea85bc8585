"""The output of `kybflow library`: everything that packages ship, one file, or one name."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterator
from pathlib import Path

from kybflow.api.library import (
    OWN,
    Shipped,
    hollow,
    imports_of,
    libraries,
    missions,
    read_file,
    text_of,
)
from kybflow.cli.output import columns, grouped
from kybflow.core.errors import KybflowError
from kybflow.dsl.diagnostics import render
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, entries_of

_INSTALL = "setuptools installs none without `package-data`"
_MOST_FILES = 200
"""The most files of a folder that are searched."""


def list_shipped() -> str:
    """List every library with its entries, then every mission."""
    blocks = ["\n".join(_contents(one)) for one in libraries()]
    shipped = missions()
    rows = map(str.rstrip, columns([(one.name, one.summary) for one in shipped], indent="  "))
    heading = "missions, for `kybflow new NAME --from`"
    missing = [f"{name}: installed without its YAML files ({_INSTALL})" for name in hollow()]
    return "\n\n".join([*blocks, "\n".join((heading, *rows)), *missing])


def _contents(one: Shipped) -> Iterator[str]:
    """Yield a line with a file's name and summary, then a line per section with its entries."""
    yield f"{one.name}  {one.summary}".rstrip()
    entries = one.entries()
    by_section = grouped((s, f"{name}{_signature(entry.value)}") for s, name, entry in entries)
    if one.root and one.root.get("parameters") is not None:
        by_section["with"] = [_signature(one.root)[1:-1]]
    for section, names in by_section.items():
        yield f"  {section:<9}  {', '.join(names)}"


def _signature(node: Node) -> str:
    """Return the parameters of a chain or library in brackets with their defaults; empty if there
    are none."""
    parameters = entries_of(node.get("parameters")) if isinstance(node, Mapping) else {}
    shown = []
    for name, entry in parameters.items():
        body = entry.value if isinstance(entry.value, Mapping) else None
        default = text_of(body.get("default")) if body else ""
        shown.append(f"{name} = {default}" if default else name)
    return f"({', '.join(shown)})" if shown else ""


def show_shipped(name: str) -> str | None:
    """Return the text of the file called `name`, or of every entry with that name; None if there is
    none."""
    for one in (*libraries(), *missions()):
        if name in (one.name, one.name.removeprefix(f"{OWN}/")):
            return f"# {one.path}\n{one.source.text}".rstrip()
    found = [
        _entry_text(one, section, entry)
        for one in libraries()
        for section, own, entry in one.entries()
        if name in (own, f"{one.name}.{own}")
    ]
    return "\n\n".join(found) or None


def _entry_text(one: Shipped, section: str, entry: MappingEntry) -> str:
    """Return the lines of an entry. It ends where the YAML indentation does."""
    key = entry.key.span
    first, *rest = one.source.text.split("\n")[key.line - 1 : entry.value.span.end_line]
    inside = list(itertools.takewhile(lambda line: line[: key.column].isspace() or not line, rest))
    text = textwrap.dedent("\n".join([first, *inside])).rstrip()
    return f"# {section[:-1]} of {one.name}\n{text}"


def known_names() -> list[str]:
    known = [one.name for one in (*libraries(), *missions())]
    return known + [own for one in libraries() for _, own, _ in one.entries()]


def show_file(path: Path) -> str:
    """List the entries of the file at `path` and of its imports. Raises KybflowError."""
    one = read_file(str(path), path)
    if one.root is None:
        first = next(iter(one.source.found), None)
        texts = {one.source.file: one.source.text}
        raise KybflowError(render(first, texts) if first else f"`{path}` is no mission or library")
    blocks = ["\n".join(_contents(one))]
    for own in imports_of(one):
        heading = f"import {own.name}, {own.written}"
        if own.library is None:
            blocks.append(f"{heading}: no such library")
            continue
        _, *lines = _contents(own.library)
        blocks.append("\n".join([f"{heading}  {own.library.summary}".rstrip(), *lines]))
    return "\n\n".join(blocks)


def show_import(name: str) -> str | None:
    """Return a list of the library that is imported as `name`, or the text of its entry
    `name.ENTRY`. The import is searched in the missions of the current folder, then in the shipped
    ones; None if no mission has it."""
    alias, _, inner = name.partition(".")
    files = sorted(itertools.islice(Path().glob("*.yaml"), _MOST_FILES))
    here = (read_file(str(path), path) for path in files)
    for mission in itertools.chain(here, missions()):
        library = next((i.library for i in imports_of(mission) if i.name == alias), None)
        if library is None:
            continue
        if not inner:
            what = f"# `{alias}` in {mission.path.name}"
            return "\n".join([what, *_contents(library)])
        found = [_entry_text(library, s, e) for s, own, e in library.entries() if own == inner]
        if found:
            return "\n\n".join(found)
    return None
