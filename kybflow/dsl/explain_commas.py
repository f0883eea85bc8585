"""What YAML makes of a comma in a condition inside of {...}: the text ends, and a key begins."""

from __future__ import annotations

import re

from kybflow.dsl.diagnostics import Diagnostic
from kybflow.dsl.nodes import NAME, NO_COMMAS, Mapping, Scalar, is_cut, is_null

_COMPARED = re.compile(r"[<>=]|\w in \w")


def cut_by_yaml(node: Mapping, key: str) -> Diagnostic | None:
    """What YAML made of `when: distance(a, b) < 1 m` inside of {...}: two keys."""
    keys = list(node.entries)
    before = keys.index(key) - 1
    if NAME.match(key):
        return None
    first = node.entries[keys[before]] if before >= 0 else None
    if first is None or not isinstance(first.value, Scalar) or not is_cut(first.value):
        return _joined_by_a_comma(node, key)
    return Diagnostic(
        "KYB101",
        f"YAML ends `{first.key.text}` at the comma and reads `{key}` as a key",
        node.entries[key].key.span,
        notes=(f"`{first.key.text}` is `{first.value.text}`",),
        help=NO_COMMAS,
    )


def _joined_by_a_comma(node: Mapping, key: str) -> Diagnostic | None:
    """What YAML made of `when: a in look, elapsed > 2 s` inside of {...}."""
    entry = node.entries[key]
    if not is_null(entry.value) or not _COMPARED.search(key):
        return None
    return Diagnostic(
        "KYB101",
        f"YAML ends `when` at the comma and reads `{key}` as a key",
        entry.key.span,
        help="the language has no commas: write `and` where both must hold",
    )
