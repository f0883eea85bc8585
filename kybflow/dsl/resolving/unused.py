"""Find imports and names that a mission declares and doesn't use."""

from __future__ import annotations

import re
from collections.abc import Iterator
from collections.abc import Mapping as MappingOf

from kybflow.core.names import CHARACTER
from kybflow.dsl.diagnostics import PREFIX, Diagnostic, Severity
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    entries_of,
    is_null,
    items_of,
    scalars_in,
)
from kybflow.dsl.resolving.imports import Files
from kybflow.dsl.resolving.parameters import Setting

CODES = {
    "KYB112": "A named point, a group, a stack or a chain of the mission is unused (a warning). "
    "Entries of a library may be unused, and so may those that a comment names.",
    "KYB128": "An import is unused (a warning).",
}
_WORD = re.compile(rf"{CHARACTER}+")
_POINT = re.compile(re.escape(PREFIX) + rf"({CHARACTER}+|\$)")
_WAYS = {
    "groups": "name it where a vehicle is expected",
    "stacks": "use it as `- stack: {}`",
    "chains": "use it as `do: chain.{}`",
}
"""The sections whose entries are checked, and how to use an entry."""
_NO_USE = frozenset({"mission", "summary"})


def unused_names(
    root: Mapping, files: Files, settings: MappingOf[str, Setting]
) -> Iterator[Diagnostic]:
    """Yield KYB112 for each entry of the mission `root` whose name occurs neither elsewhere in the
    file nor in `settings`. The names of groups and points may also occur in an imported file."""
    given = [scalar.text for scalar in scalars_in(*_nodes(settings))]
    texts = {file: source.text for file, source in files.sources.items()}
    world = root.get("world")
    points = _named(world.get("points") if isinstance(world, Mapping) else None)
    used = set(_POINT.findall("\n".join((*texts.values(), *given)))) if points else set()
    for name, entry in points.items() if "$" not in used else ():
        if name not in used:
            yield _warning("KYB112", "point", entry, f"use it as `{PREFIX}{name}`")
    sections = {key: _named(root.get(key)) for key in _WAYS}
    if not any(sections.values()):
        return
    words = set(_WORD.findall("\n".join((*_texts_of(root), *given))))
    del texts[files.mission.file]
    for key, entries in sections.items():
        if key == "groups" and entries.keys() - words:
            used = words.union(_WORD.findall("\n".join(texts.values())))
        else:
            used = words
        for name, entry in entries.items():
            if name not in used:
                yield _warning("KYB112", key.removesuffix("s"), entry, _WAYS[key].format(name))


def _nodes(settings: MappingOf[str, Setting]) -> list[Node]:
    return [setting.node for setting in settings.values() if setting.node is not None]


def _named(node: Node | None) -> dict[str, MappingEntry]:
    return {name: e for name, e in entries_of(node).items() if not is_null(e.value)}


def _texts_of(root: Mapping) -> Iterator[str]:
    """Yield every text and key in the file, except the names that its sections declare."""
    waiting: list[Node] = []
    for key, entry in root.entries.items():
        if key in _WAYS:
            waiting += (inner.value for inner in entries_of(entry.value).values())
        elif key not in _NO_USE:
            waiting.append(entry.value)
    seen = set[int]()
    while waiting:
        node = waiting.pop()
        if isinstance(node, Scalar):
            yield node.text
        elif id(node) not in seen:
            seen.add(id(node))
            entries = entries_of(node)
            yield from entries
            waiting += (*(entry.value for entry in entries.values()), *items_of(node))


def _warning(code: str, kind: str, entry: MappingEntry, way: str) -> Diagnostic:
    message = f"nothing uses the {kind} `{entry.key.text}`"
    hint, span = f"{way}, or remove it", entry.key.span
    return Diagnostic(code, message, span, help=hint, severity=Severity.WARNING)


def unused_imports(root: Mapping, settings: MappingOf[str, Setting]) -> Iterator[Diagnostic]:
    """Yield KYB128 for each import of the mission `root` that is mentioned neither in the file nor
    in `settings`."""
    nodes = [entry.value for key, entry in root.entries.items() if key != "import"]
    words = " ".join(s.text for s in scalars_in(*nodes, *_nodes(settings)))
    for name, entry in entries_of(root.get("import")).items():
        if f"{name}." not in words:
            yield _warning("KYB128", "import", entry, f"use it as `{name}.NAME`")
