"""Imports of which a mission makes no use."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity
from kybflow.dsl.reading.nodes import Mapping, Node, entries_of, texts_in

CODES = {
    "KYB128": "An import that nothing uses (a warning).",
}


def unused(root: Mapping, settings: Iterable[Node]) -> Iterator[Diagnostic]:
    """KYB128 for each import of the mission `root` of which nothing speaks, neither in the file nor
    in `settings`."""
    nodes = [entry.value for key, entry in root.entries.items() if key != "import"]
    said = " ".join(texts_in([*nodes, *settings]))
    for name, entry in entries_of(root.get("import")).items():
        if f"{name}." not in said:
            message = f"nothing uses the import `{name}`"
            hint = f"use it as `{name}.NAME`, or remove it"
            yield Diagnostic(
                "KYB128", message, entry.key.span, help=hint, severity=Severity.WARNING
            )
