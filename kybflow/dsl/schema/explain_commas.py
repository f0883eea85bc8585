"""What YAML makes of a comma in a condition inside of {...}: the text ends, and a key begins."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches

from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.reading.nodes import NAME, Entry, Mapping, Scalar, is_cut, is_null, no_commas

_COMPARED = re.compile(r"[<>=]|\w in \w")
_CONDITIONS = frozenset({"when", "healthy"})
_JOIN = "the language has no commas: write `and` where both must hold"
_TEXTS = frozenset({"log", "stop", "summary", "help"})
_QUOTE = "put the text in quotes"


def cut_by_yaml(node: Mapping, key: str, known: Iterable[str]) -> Diagnostic | None:
    """What YAML made of `when: distance(a, b) < 1 m`, `when: a in look, elapsed > 2 s` and
    `log: up, up and away` inside of {...}: two keys, the second of them without a value. None for a
    key that can be one of those `known`, misspelt."""
    keys, entry = list(node.entries), node.entries[key]
    before = node.entries[keys[keys.index(key) - 1]] if key != keys[0] else None
    name, is_name = before.key.text if before else "", NAME.match(key) is not None
    if before and not is_name and isinstance(before.value, Scalar) and is_cut(before.value):
        hint = no_commas(f"{before.value.text}, {key}")
        return _cut(name, entry, (f"`{name}` is `{before.value.text}`",), hint)
    if not is_null(entry.value) or get_close_matches(key.split(" ", maxsplit=1)[0], known):
        return None
    if name in _CONDITIONS or (not is_name and _COMPARED.search(key)):
        return _cut(name if name in _CONDITIONS else "when", entry, (), _JOIN)
    return _cut(name, entry, (), _QUOTE) if name in _TEXTS else None


def _cut(name: str, entry: Entry, notes: tuple[str, ...], hint: str) -> Diagnostic:
    key = entry.key
    message = f"YAML ends `{name}` at the comma and reads `{key.text}` as a key"
    return Diagnostic("KYB101", message, key.span, notes=notes, help=hint)
