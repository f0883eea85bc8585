"""Values of the document as YAML that reads back as the same, exact to the last digit."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from kybflow.core.params import Field
from kybflow.core.units import ANGLE, ANGULAR_RATE, DEG, DURATION, RATIO, Dimension, parse_quantity
from kybflow.dsl.diagnostics.spans import Span, Text
from kybflow.dsl.document import PartUse, TransitionEntry

YamlLine = tuple[str, str]
"""A line of YAML, and where it came from; empty for a default."""
_WRITTEN = {ANGLE: (DEG, "deg"), ANGULAR_RATE: (DEG, "deg/s"), RATIO: (0.01, "%")}
_PLAIN_FIRST = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ")


def place(span: Span | None) -> str:
    """The place that a line came from, for a comment; empty for a default."""
    return "" if span is None else span.at + given("", span)


def origin(use: PartUse, *more: tuple[str, Span | None]) -> str:
    """The places that a part and its values came from; each of its values, and of `more`, that
    took the place of a `$name` is named."""
    values = (*use.spans.items(), *more)
    return use.span.at + "".join(given(name, span) for name, span in values if span is not None)


def given(name: str, span: Span) -> str:
    """The place of the value that a `$name` stands for, for a comment; empty without a `$name`."""
    if span.given is None:
        return ""
    return f", {name} from {span.given.at}" if name else f", from {span.given.at}"


def part(use: PartUse, word: str = "use", more: tuple[str, ...] = ()) -> str:
    """A part in its place, every parameter written; `more` are keys of the place."""
    pairs = [f"{word}: {use.spec.name}"]
    if word == "use" and use.label != use.spec.name:
        pairs.append(f"as: {use.label}")
    return "{" + ", ".join((*pairs, *parameters(use), *more)) + "}"


def parameters(use: PartUse) -> list[str]:
    """Every parameter of a part that has a value, as `name: value`."""
    return written_fields(use.params, use.spec.fields)


def written_fields(params: Any, fields: Iterable[Field]) -> list[str]:
    """Every field that has a value, as `name: value`. A path without points is left out: it is a
    default that nobody can write."""
    owned = ((field, getattr(params, field.name)) for field in fields)
    return [
        f"{field.name}: {value(own, field)}"
        for field, own in owned
        if own is not None and not (field.shape == "path" and own == ())
    ]


def goal(transition: TransitionEntry) -> str:
    """The target of a transition as an author writes it: a chain by its name."""
    return transition.enters or transition.target.text


def way(transition: TransitionEntry) -> str:
    """One item of `next`."""
    texts: tuple[tuple[str, Text | None], ...] = (
        ("when", transition.when),
        ("event", transition.event),
    )
    pairs = [f"{key}: {quoted(text.text)}" for key, text in texts if text is not None]
    if transition.after is not None:
        pairs.append(f"after: {quantity(transition.after, DURATION)}")
    if transition.hold:
        pairs.append(f"for: {quantity(transition.hold, DURATION)}")
    if transition.emit is not None:
        pairs.append(f"emit: {quoted(transition.emit.text)}")
    pairs.append(f"go: {goal(transition)}")
    return "{" + ", ".join(pairs) + "}"


def value(what: Any, field: Field) -> str:
    """The value of a parameter."""
    if field.shape == "path" and field.dimension is not None:
        return "[" + ", ".join(vector(point, field.dimension) for point in what) + "]"
    if field.shape == "vector" and field.dimension is not None:
        return vector(what, field.dimension)
    if field.shape == "scalar" and field.dimension is not None:
        return quantity(what, field.dimension)
    if isinstance(what, bool):
        return "true" if what else "false"
    if field.shape == "integers":
        return f"[{', '.join(map(str, what))}]"
    if field.shape == "names":
        return f"[{', '.join(quoted(name) for name in what)}]"
    return str(what) if field.shape == "integer" else quoted(str(what))


def vector(value: tuple[float, ...], dimension: Dimension) -> str:
    return "[" + ", ".join(quantity(number, dimension) for number in value) + "]"


def quantity(value: float, dimension: Dimension) -> str:
    """The exact value with its unit: in SI, or as an author writes it where that is as exact and
    SI would need more digits: `18 mm`."""
    factor, unit = _WRITTEN.get(dimension, (1.0, ""))
    text = f"{value / factor:g} {unit}"
    if unit and parse_quantity(text, dimension) == value:
        return text
    number = f"{value:g}"
    if float(number) == value:
        return f"{number} {dimension.si}".rstrip()
    scaled = (f"{value / factor:.15g} {unit}" for unit, factor in dimension.units.items())
    exact = [text for text in scaled if parse_quantity(text, dimension) == value]
    return min(exact, key=len, default=f"{value!r} {dimension.si}".rstrip())


def quoted(text: str) -> str:
    """Text that YAML reads as itself, everywhere."""
    if text[:1] in _PLAIN_FIRST and text.replace("_", "").isalnum() and text not in _RESERVED:
        return text
    return "'" + text.replace("'", "''").replace("\n", " ") + "'"


_RESERVED = frozenset({"true", "false", "null", "True", "False", "Null", "yes", "no", "on", "off"})
