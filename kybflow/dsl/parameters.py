"""Typed parameters: `parameters:` declares them, `--set` or an import's `with` sets them, `$name`
stands for them."""

from __future__ import annotations

import re
from collections.abc import Mapping as MappingOf
from decimal import Decimal
from typing import Any, NamedTuple

from kybflow.dsl.diagnostics import Diagnostic, Severity, did_you_mean
from kybflow.dsl.document import Parameter
from kybflow.dsl.nodes import Entry, Mapping, Node, Scalar, Sequence
from kybflow.dsl.source import Span
from kybflow.dsl.values import decode, quantity_field
from kybflow.params import Field
from kybflow.units import DIMENSIONS, LENGTH, NUMBER, RATIO, Dimension

CODES = {
    "KYB130": "`$name` where no parameter has that name.",
    "KYB131": "A value for a parameter that the mission doesn't have.",
    "KYB132": "A parameter without a value: no default, and nothing set it.",
    "KYB133": "A parameter that nothing uses (a warning).",
    "KYB134": "A parameter of an unknown type.",
}
QUANTITIES: dict[str, Dimension] = {d.name.replace(" ", "_"): d for d in DIMENSIONS.values()}
TYPES = (*QUANTITIES, "position", "integer", "text", "boolean")
_WHOLE = re.compile(r"\$([A-Za-z_]\w*)\Z", re.ASCII)
_INSIDE = re.compile(r"\$([A-Za-z_]\w*)", re.ASCII)
_EXPRESSIONS = frozenset({"when", "healthy", "expect"})
_BOUNDS = ("above", "at_least", "below", "at_most")


class Declared(NamedTuple):
    """A parameter with its value, as typed and as the node that takes the place of `$name`."""

    parameter: Parameter
    node: Node
    span: Span


class Setting(NamedTuple):
    """A value from outside of the file, and where its name stands."""

    node: Node
    name: Span


def declare(
    section: Node | None, settings: MappingOf[str, Setting], found: list[Diagnostic]
) -> dict[str, Declared]:
    """The parameters of `section` after `settings` (values by name)."""
    entries = section.entries if isinstance(section, Mapping) else {}
    declared: dict[str, Declared] = {}
    for name, entry in entries.items():
        given = settings.get(name)
        one = _declare(name, entry, given.node if given else None, found)
        if one is not None:
            declared[name] = one
    for name, setting in settings.items():
        if name not in entries:
            found.append(
                Diagnostic(
                    "KYB131",
                    f"there is no parameter `{name}`",
                    setting.name,
                    help=did_you_mean(name, entries) if entries else "it declares none",
                )
            )
    return declared


def _declare(
    name: str, entry: Entry, setting: Node | None, found: list[Diagnostic]
) -> Declared | None:
    body = entry.value
    assert isinstance(body, Mapping)
    kind = body.get("type")
    assert isinstance(kind, Scalar)
    if kind.text not in TYPES:
        message = f"`{kind.text}` is no type of a parameter"
        found.append(Diagnostic("KYB134", message, kind.span, help=did_you_mean(kind.text, TYPES)))
        return None
    field = _field(name, kind.text, body, found)
    default = body.get("default")
    default_value = None if default is None else decode(default, field, found)
    node = setting or default
    if node is None:
        found.append(
            Diagnostic(
                "KYB132",
                f"`{name}` has no value",
                entry.key.span,
                help=f"set it with `--set {name}=...`, or give it a `default`",
            )
        )
        return None
    value = default_value if setting is None else decode(node, field, found)
    if value is None:
        return None
    shown = _typed(node, field)
    return Declared(Parameter(name, kind.text, value), shown, entry.key.span)


def _field(name: str, kind: str, body: Mapping, found: list[Diagnostic]) -> Field:
    if kind == "position":
        dimension, shape = LENGTH, "vector"
    else:
        dimension = QUANTITIES.get(kind, NUMBER)
        shape = "scalar" if kind in QUANTITIES else kind
    bounds: dict[str, Any] = {}
    for bound in _BOUNDS:
        node = body.get(bound)
        if node is not None:
            bounds[bound] = decode(node, quantity_field(bound, dimension), found)
    return quantity_field(name, dimension, shape, **bounds)


def _typed(node: Node, field: Field) -> Node:
    """The value with its unit written out, so that it can't be read in another dimension."""
    if isinstance(node, Sequence):
        return Sequence(tuple(_typed(item, field) for item in node.items), node.span)
    if not isinstance(node, Scalar) or field.shape not in ("scalar", "vector"):
        return node
    text, dimension = node.text.strip(), field.dimension
    if dimension is None or not re.fullmatch(r"[-+.\deE]+", text):
        return node
    if dimension is RATIO:
        return node._replace(text=f"{(Decimal(text) * 100).normalize():f} %")
    return node._replace(text=f"{text} {dimension.si}".strip())


class Substitution:
    """Puts values in the place of `$name`; remembers which were used. A node without any stays the
    same object, and an aliased one is replaced once."""

    def __init__(
        self, section: Node | None, declared: dict[str, Declared], found: list[Diagnostic]
    ) -> None:
        self._names = tuple(section.entries) if isinstance(section, Mapping) else ()
        self._declared = declared
        self._found = found
        self._done: dict[int, tuple[Node, Node]] = {}
        self._used: set[str] = set()

    def apply(self, node: Node, expression: bool = False) -> Node:
        """`node` with every `$name` replaced; inside of conditions also between other words."""
        done = self._done.get(id(node))
        if done is not None:
            return done[1]
        new = self._replaced(node, expression)
        self._done[id(node)] = (node, new)
        return new

    def _replaced(self, node: Node, expression: bool) -> Node:
        if isinstance(node, Scalar):
            return self._scalar(node, expression) if "$" in node.text else node
        if isinstance(node, Sequence):
            items = tuple(self.apply(item, expression) for item in node.items)
            same = all(a is b for a, b in zip(items, node.items, strict=True))
            return node if same else Sequence(items, node.span)
        entries = {
            key: entry._replace(value=self.apply(entry.value, key in _EXPRESSIONS))
            for key, entry in node.entries.items()
        }
        same = all(entries[key].value is entry.value for key, entry in node.entries.items())
        return node if same else Mapping(entries, node.span)

    def _scalar(self, node: Scalar, expression: bool) -> Node:
        whole = _WHOLE.match(node.text)
        if whole and not expression:
            declared = self._lookup(whole[1], node)
            return node if declared is None else _placed(declared.node, node.span, whole[1])
        if not expression:
            return node
        names: list[str] = []

        def literal(match: re.Match[str]) -> str:
            declared = self._lookup(match[1], node, match.span())
            if declared is None:
                return match[0]
            names.append(match[1])
            return _literal(declared.node)

        text = _INSIDE.sub(literal, node.text)
        return node._replace(text=text, parameter=", $".join(names)) if names else node

    def _lookup(
        self, name: str, node: Scalar, place: tuple[int, int] | None = None
    ) -> Declared | None:
        self._used.add(name)
        if name in self._names:
            return self._declared.get(name)
        span = node.as_text.part(*place) if place else node.span
        self._found.append(
            Diagnostic(
                "KYB130",
                f"no parameter is called `{name}`",
                span,
                help=did_you_mean(name, self._names) or "declare it under `parameters`",
            )
        )
        return None

    def unused(self) -> list[Diagnostic]:
        """A warning for each parameter that was never asked for."""
        return [
            Diagnostic(
                "KYB133",
                f"nothing uses the parameter `{name}`",
                declared.span,
                help=f"use it as `${name}`, or remove it",
                severity=Severity.WARNING,
            )
            for name, declared in self._declared.items()
            if name not in self._used
        ]


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
