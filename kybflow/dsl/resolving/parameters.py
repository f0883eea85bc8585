"""Typed parameters. `parameters:` declares them; `--set name=value`, an import's `with` or the use
of a chain sets them; `Substitution` replaces `$name` by their values."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator
from collections.abc import Mapping as MappingOf
from dataclasses import replace
from decimal import Decimal
from math import inf
from typing import Any, NamedTuple

from kybflow.core import names
from kybflow.core.params import TEXT, Field, Numbers, numbers
from kybflow.core.text import did_you_mean
from kybflow.core.units import LENGTH, NUMBER, RATIO, Dimension, article
from kybflow.dsl.diagnostics import PREFIX, SET, Collector, Inset, Span
from kybflow.dsl.plan import Parameter
from kybflow.dsl.reading.nodes import (
    NAME,
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    entries_of,
)
from kybflow.dsl.reading.reader import compose
from kybflow.dsl.reading.values import (
    QUANTITIES,
    TYPES,
    bounds_of,
    decode_value,
    quantity_field,
    shown_value,
)
from kybflow.dsl.resolving import arithmetic

CODES = {
    "KYB131": "A value is given for a parameter that the mission, the library or the chain "
    "doesn't have.",
    "KYB132": "A parameter has no value: no default, and nothing sets it.",
    "KYB134": "A parameter has an unknown type.",
    "KYB135": "A `--set` is not written `name=value`.",
    "KYB136": "The bounds of a parameter allow no value.",
    "KYB460": "Two `--set` give a parameter different values.",
    "KYB130": "`$name` names an unknown parameter.",
    "KYB137": "Arithmetic with parameters can't be worked out: its units don't fit together, it "
    "divides by zero, or it is not written as such.",
    "KYB133": "A parameter is unused (a warning).",
}
_BOUNDS = ("above", "at_least", "below", "at_most")
_WHOLE = re.compile(rf"\$({names.NAME})\Z")
_INSIDE = re.compile(rf"\$({names.NAME})")
_EXPRESSIONS = frozenset({"when", "healthy", "expect"})
_TEXTS = frozenset({"log", "stop", "summary", "help"})
"""The keys of texts for people, in which nothing is computed."""


class BoundParameter(NamedTuple):
    """A parameter with its value. parameter: the typed value. node: the node that replaces `$name`.
    span: the location of the declaration. is_set: whether it is set, in contrast to the
    default or `--set`."""

    parameter: Parameter
    node: Node
    span: Span
    is_set: bool = False


class ParameterTable(NamedTuple):
    """The parameters of one file. names: the location of each declared name. declared: the
    parameters that have a value."""

    names: dict[str, Span]
    declared: dict[str, BoundParameter]


class Setting(NamedTuple):
    """A value that is set outside the file. node: the value, None if its error is already reported.
    name: the location of the parameter's name."""

    node: Node | None
    name: Span


def parse_settings(sets: Iterable[str], found: Collector) -> dict[str, Setting]:
    """Return the values of `--set name=value` by name, and report invalid settings."""
    settings: dict[str, Setting] = {}
    for line, given in enumerate(sets, start=1):
        text = unicodedata.normalize("NFC", given)
        before, equals, value = text.partition("=")
        name, span = before.strip(), Span(SET, line, 1, line, len(text) + 1)
        if not equals or not NAME.match(name) or not value.strip() or "\n" in text:
            is_lacking = NAME.match(name) is not None and not value.strip()
            hint = f"write `--set {name}=VALUE`" if is_lacking else "write `--set NAME=VALUE`"
            message = f"`--set {name}` has no value" if is_lacking else f"can't read `--set {text}`"
            found.report("KYB135", message, span, help=hint)
            continue
        own = Collector()
        node = compose(value, SET, own)
        if node is None or own.all or isinstance(node, Mapping):
            message = f"`{value}` can't be the value of a parameter"
            found.report("KYB135", message, span, help="write one value, or a list in `[...]`")
            continue
        place = span._replace(end_column=len(before) + 1)
        if name in settings:
            notes = (f"{settings[name].name.at} sets it already",)
            hint = "give each parameter one value"
            found.report("KYB460", f"`{name}` is set twice", place, notes=notes, help=hint)
            continue
        settings[name] = Setting(_moved(node, line, len(before) + 1), place)
    return settings


def _moved(node: Node, line: int, shift: int) -> Node:
    """Return a value that was parsed alone, with its spans moved to its position in the
    settings."""
    s = node.span
    span = Span(SET, line, s.column + shift, line, s.end_column + shift)
    if isinstance(node, Sequence):
        return Sequence(tuple(_moved(item, line, shift) for item in node.items), span)
    return node._replace(span=span) if isinstance(node, Scalar) else node


def declare(
    section: Node | None,
    settings: MappingOf[str, Setting],
    found: Collector,
    use: Scalar | None = None,
    set_by: str = "--set {}=...",
) -> ParameterTable:
    """Return the parameters declared in `section`, with the values in `settings`, and report
    errors. use: the `do` that uses a chain; None for the parameters of a file. set_by: how to set a
    parameter of a file, for hints."""
    entries = entries_of(section)
    declared: dict[str, BoundParameter] = {}
    for name, entry in entries.items():
        given = settings.get(name)
        if given is not None and given.node is None:
            continue
        one = _declare(name, entry, given.node if given else None, use, set_by, found)
        if one is not None:
            declared[name] = one
    for name, setting in settings.items():
        if name not in entries:
            whose = "there is no" if use is None else f"`{use.text}` has no"
            hint = did_you_mean(name, entries) if entries else "it declares none"
            found.report("KYB131", f"{whose} parameter `{name}`", setting.name, help=hint)
    return ParameterTable({name: entry.key.span for name, entry in entries.items()}, declared)


def _declare(
    name: str,
    entry: MappingEntry,
    setting: Node | None,
    use: Scalar | None,
    set_by: str,
    found: Collector,
) -> BoundParameter | None:
    body, span = entry.value, entry.key.span
    if not isinstance(body, Mapping):
        found.report("KYB106", f"the parameter `{name}` is empty", span)
        return None
    kind = body.get("type")
    assert isinstance(kind, Scalar)
    if kind.text not in TYPES:
        hint = did_you_mean(kind.text, TYPES)
        found.report(
            "KYB134", f"a parameter can't have the type `{kind.text}`", kind.span, help=hint
        )
        return None
    field = _field(name, kind.text, body, found)
    low = max((b for b in (field.above, field.at_least) if b is not None), default=-inf)
    high = min((b for b in (field.below, field.at_most) if b is not None), default=inf)
    is_open = low in (field.above, field.below) or high in (field.above, field.below)
    if low > high or (low == high and is_open):
        message = f"no value of `{name}` can be {bounds_of(field)}"
        found.report("KYB136", message, span, help="correct its bounds")
        return None
    default = body.get("default")
    value = None if default is None else _value(default, field, found)
    node = setting or default
    if node is None:
        if use is None:
            hint = f"set it with `{set_by.format(name)}`, or give it a `default`"
            found.report("KYB132", f"`{name}` has no value", span, help=hint)
        else:
            notes, hint = (f"declared at {span.at}",), f"write `{name}: ...` beside `do`"
            message = f"`{use.text}` needs `{name}`"
            found.report("KYB132", message, use.span, notes=notes, help=hint)
        return None
    if setting is not None:
        value = _value(setting, field, found)
    if value is None:
        return None
    shown = _typed(node, field)
    return BoundParameter(Parameter(name, kind.text, value), shown, span, setting is not None)


def _value(node: Node, field: Field, found: Collector) -> Any:
    """Return the value of `node`; the name of a point is kept until the world is known."""
    if field.shape == "path" and isinstance(node, Sequence) and node.items:
        assert field.dimension is not None
        point = replace(field, type=numbers(field.dimension, "vector"))
        points = [_value(item, point, found) for item in node.items]
        return None if None in points else tuple(points)
    is_point = field.shape == "vector" and isinstance(node, Scalar) and node.text.startswith(PREFIX)
    if isinstance(node, Scalar) and (is_point or field.type is TEXT):
        return node.text
    return decode_value(node, field, found)


def _field(name: str, kind: str, body: Mapping, found: Collector) -> Field:
    shape = _SHAPES.get(kind, "scalar" if kind in QUANTITIES else kind)
    dimension = _dimension(kind)
    bounds: dict[str, Any] = {}
    for bound in _BOUNDS:
        node = body.get(bound)
        if node is not None:
            bounds[bound] = decode_value(node, quantity_field(bound, dimension), found)
    return quantity_field(name, dimension, shape, **bounds)


def _typed(node: Node, field: Field) -> Node:
    """Return the value with its unit written out, so that it can't be read in another dimension."""
    if isinstance(node, Sequence):
        return Sequence(tuple(_typed(item, field) for item in node.items), node.span)
    if not isinstance(node, Scalar) or not isinstance(field.type, Numbers):
        return node
    text, dimension = node.text.strip(), field.dimension
    if dimension is None or not re.fullmatch(r"[-+.\deE]+", text):
        return node
    if dimension is RATIO:
        return node._replace(text=f"{(Decimal(text) * 100).normalize():f} %")
    return node._replace(text=f"{text} {dimension.si}".strip())


def shown_parameter(parameter: Parameter) -> str:
    """Return the value of a parameter as an author would write it."""
    return shown_value(parameter.value, quantity_field("", _dimension(parameter.type)))


_SHAPES = {"position": "vector", "path": "path"}


def _dimension(kind: str) -> Dimension:
    return LENGTH if kind in _SHAPES else QUANTITIES.get(kind, NUMBER)


class Substitution:
    """Replaces `$name` by values and records which names are used. A node without `$name` is
    returned unchanged, and an aliased node is replaced once."""

    def __init__(self, parameters: ParameterTable, found: Collector) -> None:
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
            return self._scalar(node, expression) if "$" in node.text else node
        if isinstance(node, Sequence):
            items = tuple([self.apply(item, expression) for item in node.items])
            if all(a is b for a, b in zip(items, node.items, strict=True)):
                return node
            given = next((s.given for i in items if (s := i.span).given is not None), None)
            return Sequence(items, node.span._replace(given=given))
        changed: dict[str, MappingEntry] = {}
        for key, entry in node.entries.items():
            written = entry.value
            if isinstance(written, Scalar):
                text = written.text
                if "$" not in text or (key in _TEXTS and not _WHOLE.match(text)):
                    continue
            value = self.apply(written, key in _EXPRESSIONS)
            if value is not written:
                changed[key] = entry._replace(value=value)
        return Mapping({**node.entries, **changed}, node.span) if changed else node

    def _between(self, node: Scalar) -> Scalar:
        """Return a condition with the value of every `$name`; it keeps its text as written."""
        text, behind = "", 0
        insets: list[Inset] = []
        for match in arithmetic.INSIDE.finditer(node.text):
            if "$" not in match[0]:
                continue
            names = self._named(node, *match.span())
            if names is None:
                continue
            declared = next(iter(names.values()))
            value: str | None = _literal(declared.node)
            if not _WHOLE.match(match[0]):
                value = self._result(node, names, *match.span())
            if value is None:
                continue
            text += node.text[behind : match.start()]
            given = declared.node.span.given or declared.node.span
            insets.append(Inset(len(text), len(text) + len(value), *match.span(), given))
            text += value
            behind = match.end()
        if not insets:
            return node
        text += node.text[behind:]
        return node._replace(text=text, written=node.text, insets=tuple(insets))

    def _scalar(self, node: Scalar, expression: bool) -> Node:
        text = node.text
        if expression:
            return self._between(node)
        if whole := _WHOLE.match(text):
            declared = self._lookup(whole[1], node)
            return node if declared is None else _placed(declared.node, node, declared)
        is_short = len(text) <= arithmetic.MAX_LENGTH
        if not (is_short and _INSIDE.search(text) and arithmetic.BEGINNING.match(text)):
            return node
        names = self._named(node, 0, len(text))
        value = None if names is None else self._result(node, names, 0, len(text))
        if names is None or value is None:
            return node
        declared = max(names.values(), key=lambda one: one.is_set)
        return _placed(Scalar(value, node.span), node, declared)

    def _named(self, node: Scalar, start: int, end: int) -> dict[str, BoundParameter] | None:
        """Return the parameters named in a part of a text; None if one has no value, which is
        reported."""
        found = {
            match[1]: self._lookup(match[1], node, match.span())
            for match in _INSIDE.finditer(node.text, start, end)
        }
        known = {name: one for name, one in found.items() if one is not None}
        return known if len(known) == len(found) else None

    def _result(
        self, node: Scalar, names: MappingOf[str, BoundParameter], start: int, end: int
    ) -> str | None:
        """Return the result of arithmetic in a part of a text; None if it has errors, which are
        reported."""
        amounts, hint = {}, "compute with quantities, such as the coordinates of a position"
        for name, (parameter, value, _, _) in names.items():
            if parameter.type in QUANTITIES or parameter.type == "integer":
                assert isinstance(value, Scalar)
                amounts[name] = arithmetic.amount_of(value.text, _dimension(parameter.type))
                continue
            place = node.text.index(f"${name}", start)
            span = node.as_text.part(place, place + len(name) + 1)
            message = f"`${name}` is {article(parameter.type)}, with which nothing can be computed"
            self._found.report("KYB137", message, span, help=hint)
            return None
        try:
            return arithmetic.result_of(node.text[start:end], amounts)
        except arithmetic.Mistake as mistake:
            span = node.as_text.part(start + mistake.start, start + mistake.end)
            self._found.report("KYB137", str(mistake), span, help=mistake.hint)
            return None

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


def unused_parameter(name: str, span: Span, found: Collector) -> None:
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


def _placed(value: Node, place: Scalar, declared: BoundParameter) -> Node:
    """Return a value that takes the place of a scalar. declared: the parameter from which it
    comes."""
    written = declared.node.span
    is_set = written.is_set if written.given else declared.is_set
    span = place.span._replace(given=written.given or written, is_set=is_set)

    def placed(node: Node) -> Node:
        if isinstance(node, Scalar):
            return node._replace(span=span, parameter=place.text)
        if isinstance(node, Sequence):
            return Sequence(tuple(map(placed, node.items)), span)
        return node

    return placed(value)


def _literal(value: Node) -> str:
    if isinstance(value, Sequence):
        return "[" + " ".join(_literal(item) for item in value.items) + "]"
    return value.text if isinstance(value, Scalar) else ""
