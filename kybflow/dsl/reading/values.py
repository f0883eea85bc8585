"""Decode a node to one typed value in SI, as declared by the `Field` of its parameter. A file is
read once, and the part that uses it checks its contents."""

from __future__ import annotations

import functools
import hashlib
import operator
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from kybflow.core.errors import FileError, UnitError
from kybflow.core.files import File, FilePath, NotRegular, read_regular
from kybflow.core.names import NAME
from kybflow.core.params import (
    BOOLEAN,
    FILE,
    FILE_PATH,
    INTEGER,
    TEXT,
    Choice,
    Field,
    ListOf,
    Numbers,
    ValueType,
    numbers,
)
from kybflow.core.text import did_you_mean
from kybflow.core.units import (
    DIMENSIONS,
    DURATION,
    NUMBER,
    Dimension,
    article,
    format_quantity,
    is_quantity,
    parse_quantity,
)
from kybflow.dsl.diagnostics import PREFIX, Collector
from kybflow.dsl.reading.nodes import (
    Mapping,
    Node,
    Scalar,
    Sequence,
    describe,
    items_of,
    shown_node,
    to_json,
)

CODES = {
    "KYB104": "A value has the wrong type or dimension, or lacks its unit.",
    "KYB105": "A value is outside its bounds.",
    "KYB109": "A value is none of the allowed choices.",
    "KYB370": "A file that a parameter names is missing, unreadable, too large, or outside the"
    " mission's folder.",
    "KYB371": "A part can't use a file; the report shows the line.",
}
N = TypeVar("N", int, float)
MAX_FILE_BYTES = 4_000_000
_MAX_SCALAR = 100
_SHOWN_LETTERS = 60
_POINT = re.compile(rf"(?:world\.)?points?\.({NAME})\Z")
_BARE = re.compile(r"[-+.\deE]+\Z", re.ASCII)
_INTEGER = re.compile(r"[+-]?\d+\Z", re.ASCII)
_TRUTHS = {"true": True, "True": True, "false": False, "False": False}
_SHAPES = {
    "vector": "three numbers in a list, `[x, y, z]`",
    "path": "a list of points, `[[x, y, z], ...]`",
    "integer": "a whole number",
    "integers": "a list of whole numbers, `[1, 2]`",
    "names": "a list of names, `[a, b]`",
    "boolean": "`true` or `false`",
    "file": "the name of a file",
    "file path": "the name of a file",
}
_ROWS = {"matrix": "{} rows of {} numbers, `[[...], ...]`", "row": "{} rows of {} numbers"}


QUANTITIES: dict[str, Dimension] = {d.name.replace(" ", "_"): d for d in DIMENSIONS.values()}
TYPES = (*QUANTITIES, "position", "path", "integer", "text", "boolean")
"""The types of a mission's parameters."""


@functools.lru_cache(maxsize=256)
def quantity_field(name: str, dimension: Dimension, shape: str = "scalar", **bounds: Any) -> Field:
    """Return a required field for a value that no record declares, such as a mission's parameter.
    shape: that of the numbers, or `integer`, `text` or `boolean`."""
    kind = _PLAIN.get(shape) or numbers(dimension, shape)
    return Field(name=name, type=kind, required=True, key=name, **bounds)


_PLAIN = {kind.shape: kind for kind in (INTEGER, TEXT, BOOLEAN)}


def decode_value(node: Node, field: Field, found: Collector) -> Any:
    """Return the value of `node` for `field`, or None if it has errors, which are reported."""
    value = _value(node, field, field.type, found)
    flaw = field.flaw(value)
    if flaw is None:
        return value
    hint = f"write it like `{example_of(field.type)}`" if isinstance(field.type, Numbers) else ""
    found.report("KYB105", f"`{field.key}` {flaw}", node.span, help=hint)
    return None


def _value(node: Node, field: Field, kind: ValueType, found: Collector) -> Any:
    if isinstance(kind, Numbers):
        return _numbers(node, field, kind.dimension, kind.size, found)
    if isinstance(kind, ListOf) and isinstance(node, Sequence):
        items = [_value(item, field, kind.item, found) for item in node.items]
        return None if None in items else tuple(items)
    if not isinstance(node, Scalar) or isinstance(kind, ListOf):
        _wrong(node, field, found)
        return None
    reader = _READERS.get(kind, _word)
    return reader(node, field, found)


def _word(node: Scalar, field: Field, found: Collector) -> Any:
    """Return a choice, a boolean or an integer, or None if the text is none of these."""
    text, kind = node.text, field.type
    kind = kind.item if isinstance(kind, ListOf) else kind
    if len(text) > _MAX_SCALAR:
        _too_long(node, found)
    elif isinstance(kind, Choice):
        if text in kind.words:
            return text
        message, hint = f"`{field.key}` can't be `{text}`", did_you_mean(text, kind.words)
        found.report("KYB109", message, node.span, notes=origin(node), help=hint)
    elif kind is BOOLEAN and text in _TRUTHS:
        return _TRUTHS[text]
    elif kind is INTEGER and _INTEGER.match(text):
        return _bounded(int(text), node, field, found)
    else:
        _wrong(node, field, found)
    return None


def _numbers(
    node: Node, field: Field, dimension: Dimension, size: tuple[int | None, ...], found: Collector
) -> Any:
    """Return a number, or nested tuples of numbers of the given size; None if the node has
    errors."""
    if not size:
        return _number(node, field, dimension, found)
    is_whole = isinstance(node, Sequence) and size[0] in (None, len(node.items)) and node.items
    if not is_whole:
        is_row = field.shape == "matrix" and len(size) == 1
        is_vector = size == (3,) and field.shape != "path"
        shape = "row" if is_row else "vector" if is_vector else field.shape
        _wrong(node, field, found, shape)
        if is_vector and _three_numbers(node):
            return None
    inside = [item for item in items_of(node) if is_whole or isinstance(item, Scalar)]
    items = [_numbers(item, field, dimension, size[1:], found) for item in inside]
    return tuple(items) if is_whole and None not in items else None


def _too_long(node: Scalar, found: Collector) -> None:
    found.report("KYB104", f"`{node.text[:20]}...` is too long to be a value", node.span)


def _number(node: Node, field: Field, dimension: Dimension, found: Collector) -> float | None:
    if not isinstance(node, Scalar) or len(node.text) > _MAX_SCALAR:
        if field.shape != "scalar":
            message = f"a number is needed, but this is {describe(node)}"
            found.report("KYB104", message, node.span)
        elif isinstance(node, Scalar):
            _too_long(node, found)
        else:
            _wrong(node, field, found)
        return None
    try:
        value = parse_quantity(node.text, dimension)
    except UnitError as error:
        found.report("KYB104", str(error), node.span, notes=origin(node), help=error.hint)
        return None
    return _bounded(value, node, field, found)


def _bounded(value: N, node: Scalar, field: Field, found: Collector) -> N | None:
    """Return `value` if it is within the bounds; otherwise report KYB105 and return None."""
    if field.is_within(value):
        return value
    message, hint = f"`{field.key}` must be {bounds_of(field)}", _way_inside(value, node, field)
    found.report("KYB105", message, node.span, f"`{node.text}`", origin(node), hint)
    return None


def _text(node: Scalar, field: Field, found: Collector) -> str | None:
    """Return a text. A parameter's value is accepted as text even if it looks like a number."""
    if node.parameter or isinstance(to_json(node), str):
        return node.text
    message = f"`{field.key}` must be text, but this is {shown_node(node)}"
    hint = f'write "{node.text[:60]}" in quotes if you mean the text'
    found.report("KYB103", message, node.span, help=hint)
    return None


def _way_inside(value: float, node: Scalar, field: Field) -> str:
    """Return the hint for a value outside its bounds: a smaller unit with which a bare number would
    be within them, or an example if the value is not positive."""
    dimension, bare = field.dimension, node.text.strip()
    if dimension is None or not dimension.units:
        return _nearest_bound(value, field)
    for unit, factor in sorted(dimension.units.items(), key=lambda item: -item[1]):
        if _BARE.match(bare) and factor < 1.0 and field.is_within(value * factor):
            return f"did you mean `{bare} {unit}`?"
    usual = field.default if isinstance(field.default, float) else None
    example = _TEN_SECONDS if dimension is DURATION else dimension.example
    if usual is not None and usual > 0.0:
        example = format_quantity(usual, dimension)
    fits = field.is_within(parse_quantity(example, dimension))
    return f"write it like `{example}`" if value <= 0.0 and fits else _nearest_bound(value, field)


def _nearest_bound(value: float, field: Field) -> str:
    """Return the hint that names the bound beyond which a value is."""
    for bound, words in _BOUND_WORDS.items():
        limit = getattr(field, bound)
        if limit is not None and not _HOLDS[bound](value, limit):
            return words.format(_shown(limit, field.dimension))
    return ""


_BOUND_WORDS = {
    "above": "write more than `{}`",
    "at_least": "write `{}` or more",
    "below": "write less than `{}`",
    "at_most": "write `{}` or less",
}
_HOLDS: dict[str, Callable[[float, float], bool]] = {
    "above": operator.gt, "at_least": operator.ge, "below": operator.lt, "at_most": operator.le,
}  # fmt: skip


_TEN_SECONDS = "10 s"
"""The example of a duration that has no usual value."""


def bounds_of(field: Field) -> str:
    """Return the bounds in words, with units: `above 0 m and at most 3 m`; empty if there are
    none."""
    words = ("above", "at_least", "below", "at_most")
    bounds = {word.replace("_", " "): getattr(field, word) for word in words}
    known = {word: bound for word, bound in bounds.items() if bound is not None}
    return " and ".join(f"{word} {_shown(b, field.dimension)}" for word, b in known.items())


def _shown(value: float, dimension: Dimension | None) -> str:
    return f"{value:g}" if dimension is None else format_quantity(value, dimension)


def origin(node: Scalar) -> tuple[str, ...]:
    """Return a note with the value of the parameter that `node` stands for. Empty if there is no
    parameter, or if the finding is reported at that value."""
    shown = node.parameter and node.span.value is None
    return (f"`{node.parameter}` is `{node.text}`",) if shown else ()


def _wrong(node: Node, field: Field, found: Collector, shape: str = "") -> None:
    dimension, shape = field.dimension, shape or field.shape
    needed = _SHAPES.get(shape) or (article(dimension.name) if dimension else "one value")
    if isinstance(field.type, Numbers) and shape in _ROWS:
        needed = _ROWS[shape].format(*field.type.size)
    this = shown_node(node, _MAX_SCALAR)
    if shape == "row":
        this = this.replace("a list", "a row", 1)
    message = f"`{field.key}` must be {needed}, but this is {this}"
    hint, kind = "", field.type
    if isinstance(kind, Numbers) and not isinstance(node, Mapping):
        text = node.text if isinstance(node, Scalar) and field.shape == "matrix" else ""
        one = text if is_quantity(text, kind.dimension) else ""
        hint = f"write it like `{example_of(kind, one)}`"
    if field.type is INTEGER:
        hint = f"write it like `{NUMBER.example}`"
    if not hint and isinstance(node, Sequence) and node.items:
        first = node.items[0]
        hint = f"write one: `{field.key}: {first.text}`" if isinstance(first, Scalar) else ""
    if shape == "vector":
        hint = _three_numbers(node) or hint
    if field.names == "group" and isinstance(node, Sequence):
        hint = "give them a name, `groups: {NAME: [...]}`, and write that here"
    point = _POINT.match(node.text) if isinstance(node, Scalar) else None
    if point is not None and shape == "vector":
        hint = f"did you mean `{PREFIX}{point[1]}`?"
    found.report("KYB104", message, node.span, help=hint)


_PIECE = re.compile(r"[-+]?\d+\Z", re.ASCII)


def _three_numbers(node: Node) -> str:
    """Return the hint for three numbers that were not written as a list of three: without commas,
    or with decimal commas. Empty for anything else."""
    alone = node.items[0] if isinstance(node, Sequence) and len(node.items) == 1 else node
    if isinstance(alone, Scalar):
        numbers = alone.text.strip("()[] ").replace(",", " ").split()
        is_row = len(numbers) == 3 and all(_BARE.match(number) for number in numbers)
        return f"write `[{', '.join(numbers)}]`" if is_row else ""
    texts: list[str] = []
    before: Node | None = None
    for item in items_of(node):
        if not isinstance(item, Scalar):
            return ""
        joins = before is not None and item.span[1:3] == (
            before.span.end_line,
            before.span.end_column + 1,
        )
        if joins and _PIECE.match(texts[-1]) and item.text[:1].isdigit():
            texts[-1] += f".{item.text}"
        else:
            texts.append(item.text)
        before = item
    if len(texts) != 3 or len(items_of(node)) == 3:
        return ""
    return f"write `[{', '.join(texts)}]`, with a decimal point"


def example_of(kind: Numbers, one: str = "") -> str:
    """Return numbers as an author writes them: `[1.2 m, 1.2 m, 1.2 m]`. one: the text of each
    number, or of the diagonal of a matrix; by default the example of the dimension."""
    one = one or kind.dimension.example
    if kind.shape == "matrix":
        return diagonal(kind.size, one, format_quantity(0.0, kind.dimension))
    point = f"[{one}, {one}, {one}]"
    return (one, point, f"[{point}, ...]")[len(kind.size)]


def diagonal(size: tuple[int | None, ...], one: str, other: str) -> str:
    """Return the text of a matrix with `one` on its diagonal and `other` elsewhere."""
    rows, columns = (range(side or 1) for side in size)
    inner = (", ".join(one if i == j else other for j in columns) for i in rows)
    return f"[{', '.join(f'[{row}]' for row in inner)}]"


def shown_value(value: Any, field: Field) -> str:
    """Return a value (SI) as an author would write it; `none` for None."""
    if value is None:
        return "none"
    if isinstance(value, tuple):
        return f"[{', '.join(shown_value(item, field) for item in value)}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return _shown(value, field.dimension) if isinstance(value, float) else str(value)


def _attached(node: Scalar, field: Field, found: Collector) -> File | None:
    """Return the file that `node` names, in the folder of its YAML file or below. Return None and
    report why if it can't be read or used by the part."""
    try:
        file = _read(
            node.text, Path(node.span.file).parent, "surrogateescape" if field.binary else "strict"
        )
    except FileError as error:
        needed = () if error.hint else (f"`{field.key}`: {field.help}",)
        found.report("KYB370", str(error), node.span, notes=needed, help=error.hint)
        return None
    try:
        if field.reads is not None:
            field.reads(file)
    except FileError as error:
        notes: tuple[str, ...] = ()
        lines = file.text.splitlines() if file.is_text else []
        if 0 < error.line <= len(lines):  # a missing line has no text
            text = lines[error.line - 1].strip()
            shown = text if len(text) <= _SHOWN_LETTERS else text[:_SHOWN_LETTERS] + "..."
            notes = (f"{file.name}:{error.line}: {shown}",)
        label = f"line {error.line}" if error.line else ""
        message = f"`{file.name}`: {error}"
        found.report("KYB371", message, node.span, label, notes, error.hint)
        return None
    return file


def _path_of(node: Scalar, _: Field, found: Collector) -> FilePath | None:
    """Return the path that `node` names, relative to its YAML file. Return None and report KYB370
    if there is no such file."""
    path = os.path.abspath(os.path.join(os.path.dirname(node.span.file), node.text))
    if "\0" not in path and os.path.isfile(path):
        return FilePath(path)
    found.report("KYB370", f"there is no file `{node.text}`", node.span, help=_CREATE)
    return None


_CREATE = "create it, or correct its path, which begins in the folder of the file that names it"
_INSIDE = "move it into the folder of the file that names it, or below"


def _read(name: str, folder: Path, errors: str) -> File:
    """Read a file. errors: how to decode bytes that are not UTF-8, as in `bytes.decode`. Raises
    FileError."""
    try:
        path = Path(os.path.realpath(folder / name))
        if Path(name).is_absolute() or not path.is_relative_to(os.path.realpath(folder)):
            raise FileError(f"`{name}` is outside of the mission's folder", hint=_INSIDE)
        data = read_regular(path, MAX_FILE_BYTES)
    except NotRegular:
        raise FileError(f"`{name}` is not a file", hint=_CREATE) from None
    except FileNotFoundError:
        raise FileError(f"there is no file `{name}`", hint=_CREATE) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileError(f"`{name}` can't be read: {reason.lower()}") from None
    if len(data) > MAX_FILE_BYTES:
        raise FileError(f"`{name}` is larger than {MAX_FILE_BYTES // 1_000_000} MB")
    try:
        return File(name, hashlib.sha256(data).hexdigest(), data.decode("utf-8-sig", errors))
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise FileError(f"`{name}` is not UTF-8 text on line {line}") from None


_READERS: dict[ValueType, Callable[[Scalar, Field, Collector], Any]] = {
    FILE: _attached,
    FILE_PATH: _path_of,
    TEXT: _text,
}
