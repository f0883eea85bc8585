"""`--set name=value`: values for a mission's parameters from outside of its file."""

from __future__ import annotations

from collections.abc import Iterable

from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.reading.composer import compose
from kybflow.dsl.reading.nodes import NAME, Mapping, Node, Scalar, Sequence
from kybflow.dsl.reading.source import SET, Span
from kybflow.dsl.resolving.parameters import Setting

CODES = {
    "KYB135": "A `--set` that is not `name=value`.",
}


def parse_settings(sets: Iterable[str], found: list[Diagnostic]) -> dict[str, Setting]:
    """The values by name; the last one counts."""
    settings: dict[str, Setting] = {}
    for line, text in enumerate(sets, start=1):
        name, equals, value = text.partition("=")
        span = Span(SET, line, 1, line, len(text) + 1)
        if not equals or not NAME.match(name.strip()) or not value.strip() or "\n" in text:
            found.append(
                Diagnostic(
                    "KYB135", f"`{text}` is no setting", span, help="write `--set name=value`"
                )
            )
            continue
        node, findings = compose(value, SET)
        if node is None or findings or isinstance(node, Mapping):
            message = f"`{value}` is no value of a parameter"
            found.append(Diagnostic("KYB135", message, span))
            continue
        place = Span(SET, line, 1, line, len(name) + 1)
        settings[name.strip()] = Setting(_placed(node, line, len(name) + 1), place)
    return settings


def _placed(node: Node, line: int, shift: int) -> Node:
    s = node.span
    span = Span(SET, line, s.column + shift, line, s.end_column + shift)
    if isinstance(node, Sequence):
        return Sequence(tuple(_placed(item, line, shift) for item in node.items), span)
    return node._replace(span=span) if isinstance(node, Scalar) else node
