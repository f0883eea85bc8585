"""Replace `$name` by the value of the parameter."""

from __future__ import annotations

import re
from collections.abc import Iterator

from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics import Findings, Inset, Span
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, Sequence
from kybflow.dsl.resolving.parameters import BoundParameter, ParameterTable

CODES = {
    "KYB130": "`$name` where no parameter has that name.",
    "KYB133": "A parameter that nothing uses (a warning).",
}
_WHOLE = re.compile(r"\$([A-Za-z_]\w*)\Z", re.ASCII)
_INSIDE = re.compile(r"\$([A-Za-z_]\w*)", re.ASCII)
_EXPRESSIONS = frozenset({"when", "healthy", "expect"})


class Substitution:
    """Replaces `$name` by values and records which names are used. A node without `$name` is
    returned unchanged, and an aliased node is replaced once."""

    def __init__(self, parameters: ParameterTable, found: Findings) -> None:
        self.parameters = parameters
        self._found = found
        self._done: dict[tuple[int, bool], tuple[Node, Node]] = {}
        self._used: set[str] = set()

    def apply(self, node: Node, expression: bool = False) -> Node:
        """Return `node` with every `$name` replaced; in conditions (`expression`), also within a
        longer text."""
        key = (id(node), expression)
        if key not in self._done:
            self._done[key] = (node, self._replaced(node, expression))
        return self._done[key][1]

    def _replaced(self, node: Node, expression: bool) -> Node:
        if isinstance(node, Scalar):
            if "$" not in node.text:
                return node
            return self._between(node) if expression else self._scalar(node)
        if isinstance(node, Sequence):
            items = tuple([self.apply(item, expression) for item in node.items])
            if all(a is b for a, b in zip(items, node.items, strict=True)):
                return node
            given = next((s.given for i in items if (s := i.span).given is not None), None)
            return Sequence(items, node.span._replace(given=given))
        changed: dict[str, MappingEntry] = {}
        for key, entry in node.entries.items():
            if isinstance(entry.value, Scalar) and "$" not in entry.value.text:
                continue
            value = self.apply(entry.value, key in _EXPRESSIONS)
            if value is not entry.value:
                changed[key] = entry._replace(value=value)
        return Mapping({**node.entries, **changed}, node.span) if changed else node

    def _scalar(self, node: Scalar) -> Node:
        whole = _WHOLE.match(node.text)
        declared = self._lookup(whole[1], node) if whole else None
        if declared is None:
            return node
        written = declared.node.span
        is_set = written.is_set if written.given else declared.is_set
        span = node.span._replace(given=written.given or written, is_set=is_set)
        return _placed(declared.node, span, node.text[1:])

    def _between(self, node: Scalar) -> Scalar:
        """Return a condition with the value of every `$name`; it keeps its text as written."""
        text, behind = "", 0
        insets: list[Inset] = []
        for match in _INSIDE.finditer(node.text):
            declared = self._lookup(match[1], node, match.span())
            if declared is None:
                continue
            text += node.text[behind : match.start()]
            value = _literal(declared.node)
            given = declared.node.span.given or declared.node.span
            insets.append(Inset(len(text), len(text) + len(value), *match.span(), given))
            text += value
            behind = match.end()
        if not insets:
            return node
        text += node.text[behind:]
        return node._replace(text=text, written=node.text, insets=tuple(insets))

    def _lookup(
        self, name: str, node: Scalar, place: tuple[int, int] | None = None
    ) -> BoundParameter | None:
        self._used.add(name)
        names = self.parameters.names
        if name not in names:
            span = node.as_text.part(*place) if place else node.span
            hint = did_you_mean(name, names) or "declare it under `parameters`"
            self._found.report("KYB130", f"no parameter is called `{name}`", span, help=hint)
        return self.parameters.declared.get(name)

    def note(self, node: Node) -> None:
        """Record every `$name` under `node` as used."""
        self._used.update(names_in(node))

    def judge(self) -> None:
        """Warn of each parameter that nothing uses."""
        for name, declared in self.parameters.declared.items():
            if name not in self._used:
                unused_parameter(name, declared.span, self._found)


def unused_parameter(name: str, span: Span, found: Findings) -> None:
    """Warn that nothing uses the parameter declared at `span` (KYB133)."""
    hint = f"use it as `${name}`, or remove it"
    found.warn("KYB133", f"nothing uses the parameter `{name}`", span, help=hint)


def known(node: Node) -> Node | None:
    """Return `node`, or None if it still contains a `$name`, whose error is already reported."""
    return None if any(names_in(node)) else node


def names_in(node: Node) -> Iterator[str]:
    """Yield the name of every `$name` under `node`."""
    if isinstance(node, Scalar):
        yield from _INSIDE.findall(node.text)
    elif isinstance(node, Sequence):
        for item in node.items:
            yield from names_in(item)
    else:
        for entry in node.entries.values():
            yield from names_in(entry.value)


def _placed(value: Node, span: Span, name: str) -> Node:
    if isinstance(value, Scalar):
        return value._replace(span=span, parameter=name)
    if isinstance(value, Sequence):
        return Sequence(tuple(_placed(item, span, name) for item in value.items), span)
    return value


def _literal(value: Node) -> str:
    if isinstance(value, Sequence):
        return "[" + " ".join(_literal(item) for item in value.items) + "]"
    return value.text if isinstance(value, Scalar) else ""
