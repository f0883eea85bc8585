"""Imports, and names that a mission gives, of which it makes no use."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from collections.abc import Mapping as MappingOf
from itertools import chain

from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity
from kybflow.dsl.diagnostics.spans import PREFIX
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    entries_of,
    is_null,
    items_of,
    texts_in,
)
from kybflow.dsl.resolving.loading import Files
from kybflow.dsl.resolving.parameters import Setting

CODES = {
    "KYB112": "A named point, a group, a stack or a chain of the mission that nothing uses (a "
    "warning). What a library offers may stay unused, and so may what stands in a comment.",
    "KYB128": "An import that nothing uses (a warning).",
}
_WORD = re.compile(r"\w+")
_POINT = re.compile(re.escape(PREFIX) + r"(\w+|\$)")
_WAYS = {
    "groups": "name it where a vehicle is asked for",
    "stacks": "use it as `- stack: {}`",
    "chains": "use it as `do: chain.{}`",
}
"""The sections whose entries are looked at, and how one is used."""
_NO_USE = frozenset({"mission", "summary"})


def unused_names(
    root: Mapping, files: Files, settings: MappingOf[str, Setting]
) -> Iterator[Diagnostic]:
    """KYB112 for each entry of the mission `root` whose name stands nowhere else: not in the file,
    not in `settings`, for a group and a point not in the text of an import."""
    given = [setting.node for setting in settings.values() if setting.node is not None]
    yield from _points(root, files, given)
    sections = {key: _named(root.get(key)) for key in _WAYS}
    if not any(sections.values()):
        return
    said = {*_words_of(root), *_words_in(texts_in(given))}
    if sections["groups"].keys() - said:
        imported = (s.text for file, s in files.sources.items() if file != files.mission.file)
        said_there = {*_words_in(imported)} | said
    else:
        said_there = said
    for key, entries in sections.items():
        used = said_there if key == "groups" else said
        for name, entry in entries.items():
            if name not in used:
                yield _warning(key.removesuffix("s"), entry, _WAYS[key].format(name))


def _points(root: Mapping, files: Files, settings: list[Node]) -> Iterator[Diagnostic]:
    points = _named(_part(root.get("world"), "points"))
    if not points:
        return
    texts = chain((source.text for source in files.sources.values()), texts_in(settings))
    used = {name for text in texts for name in _POINT.findall(text)}
    for name, entry in points.items() if "$" not in used else ():
        if name not in used:
            yield _warning("point", entry, f"use it as `{PREFIX}{name}`")


def _part(node: Node | None, key: str) -> Node | None:
    return node.get(key) if isinstance(node, Mapping) else None


def _named(node: Node | None) -> dict[str, MappingEntry]:
    return {name: e for name, e in entries_of(node).items() if not is_null(e.value)}


def _words_of(root: Mapping) -> Iterator[str]:
    """Every word that stands in the file, but for the names that its sections give."""
    waiting: list[Node] = []
    for key, entry in root.entries.items():
        if key in _WAYS:
            waiting += (inner.value for inner in entries_of(entry.value).values())
        elif key not in _NO_USE:
            waiting.append(entry.value)
    seen = set[int]()
    yield from _words_in(texts_in(waiting))
    while waiting:
        node = waiting.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        entries = entries_of(node)
        yield from _words_in(entries)
        waiting += (*(entry.value for entry in entries.values()), *items_of(node))


def _words_in(texts: Iterable[str]) -> Iterator[str]:
    for text in texts:
        yield from _WORD.findall(text)


def _warning(kind: str, entry: MappingEntry, way: str) -> Diagnostic:
    message = f"nothing uses the {kind} `{entry.key.text}`"
    hint, span = f"{way}, or remove it", entry.key.span
    return Diagnostic("KYB112", message, span, help=hint, severity=Severity.WARNING)


def unused_imports(root: Mapping, settings: MappingOf[str, Setting]) -> Iterator[Diagnostic]:
    """KYB128 for each import of the mission `root` of which nothing speaks, neither in the file nor
    in `settings`."""
    nodes = [entry.value for key, entry in root.entries.items() if key != "import"]
    given = [setting.node for setting in settings.values() if setting.node is not None]
    said = " ".join(texts_in([*nodes, *given]))
    for name, entry in entries_of(root.get("import")).items():
        if f"{name}." not in said:
            message = f"nothing uses the import `{name}`"
            hint = f"use it as `{name}.NAME`, or remove it"
            yield Diagnostic(
                "KYB128", message, entry.key.span, help=hint, severity=Severity.WARNING
            )
