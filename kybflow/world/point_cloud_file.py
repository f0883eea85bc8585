"""Reads the points of a scan from a PLY file (ASCII or binary) or from text: three numbers per
line, or a table (`kybflow.core.files`) with the columns x, y and z.

From a PLY file it reads x, y and z of the element `vertex` and skips the rest. Some programs write
NaN where the scanner saw nothing; such points are refused, because an obstacle may be there. Every
error is a FileError, with the line if there is one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import islice
from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

from kybflow.core.errors import FileError
from kybflow.core.files import File, header_line, need, read_table
from kybflow.core.units import LENGTH, Dimension

if TYPE_CHECKING:
    from numpy.typing import NDArray

_AXES = ("x", "y", "z")
_BESIDE = ("intensity", "r", "g", "b", "a", "red", "green", "blue", "alpha", "nx", "ny", "nz")
_COLUMNS: dict[str, Dimension | None] = {
    **dict.fromkeys(_AXES, LENGTH),
    **dict.fromkeys(_BESIDE, None),
}
_WORD = re.compile(r"[A-Za-z_]")
_NUMBERS = re.compile(r"[\s,;]+")
_NAN = re.compile(r"[-+]?(nan|inf|infinity)\b", re.IGNORECASE)
_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER, _LONGEST_COUNT = 10_000, 18


class _Header(NamedTuple):
    """The header of a PLY file. order: the byte order of the vertices, empty for text. many: the
    number of vertices. properties: the type of each of their properties. lines, size: the header's
    length in lines and in bytes."""

    order: str
    many: int
    properties: Mapping[str, str]
    lines: int
    size: int


def read_points(file: File) -> NDArray[Any]:
    """Return the points of a file, (n, 3), at least one; in metres unless the file has another
    unit."""
    import numpy as np

    if file.text.startswith("ply"):
        points = _ply(file)
    else:
        if not file.is_text:
            raise FileError("it is neither PLY nor text", hint="convert it to PLY")
        points = np.array([*_lines(file.text)], dtype=float).reshape(-1, 3)
    if not len(points):
        raise FileError("it has no points")
    wrong = ~np.isfinite(points).all(axis=1)
    if wrong.any():
        message = f"{int(wrong.sum())} of its {len(points)} points are not finite"
        hint = "leave out what the scanner did not see"
        raise FileError(message, hint=hint)
    return points


def _lines(text: str) -> Iterator[tuple[float, ...]]:
    first = text.splitlines()[header_line(text) - 1] if text.strip() else ""
    if _WORD.match(first.strip()) and not _NAN.match(first.strip()):
        table = read_table(text, _COLUMNS, "points", "x, y, z")
        need(table, _AXES, header_line(text))
        for _, numbers, _ in table.rows:
            yield tuple(numbers[axis] for axis in _AXES)
        return
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield _numbers(number, _NUMBERS.split(line.strip())[:3])


def _numbers(line: int, words: list[str]) -> tuple[float, ...]:
    try:
        numbers = tuple(map(float, words))
    except ValueError:
        numbers = ()
    if len(numbers) != 3:
        raise FileError("no point: three numbers are needed", line)
    if not all(map(isfinite, numbers)):
        raise FileError("the point is not finite", line, "leave out what the scanner did not see")
    return numbers


def _ply(file: File) -> NDArray[Any]:
    import numpy as np

    header = _header(file.text)
    names = list(header.properties)
    if not header.order:
        return np.array([*_rows(file.text, header, names)], dtype=float).reshape(-1, 3)
    row = np.dtype([(name, header.order + kind) for name, kind in header.properties.items()])
    data = file.data[header.size :]
    if len(data) < header.many * row.itemsize:
        whole = len(data) // row.itemsize
        raise FileError(f"it ends after {whole} of its {header.many} points")
    rows = np.frombuffer(data, row, header.many)
    return np.stack([rows[axis].astype(float) for axis in _AXES], axis=1)


def _rows(text: str, header: _Header, names: list[str]) -> Iterator[tuple[float, ...]]:
    places = [names.index(axis) for axis in _AXES]
    lines = text.splitlines()[header.lines :]
    if len(lines) < header.many:
        raise FileError(f"it ends after {len(lines)} of its {header.many} points")
    for number, line in enumerate(islice(lines, header.many), start=header.lines + 1):
        words = line.split()
        yield _numbers(number, [words[i] for i in places if i < len(words)])


def _header(text: str) -> _Header:
    head, ended, rest = text[:_LONGEST_HEADER].partition("end_header")
    if not ended:
        raise FileError("the PLY header has no end", hint="it ends with a line `end_header`")
    order = re.search(r"^format[ \t]+(\w+)", head, re.MULTILINE)
    if order is None or order[1] not in _ORDERS:
        raise FileError("the PLY header has no format that is known")
    many, properties = _vertices(head)
    size = len((head + ended).encode("utf-8", "surrogateescape"))
    newline = 2 if rest.startswith("\r\n") else 1
    return _Header(_ORDERS[order[1]], many, properties, head.count("\n") + 1, size + newline)


def _vertices(head: str) -> tuple[int, dict[str, str]]:
    """Return the number of points, and the type of each of their properties, by name."""
    many, element, properties = -1, "", dict[str, str]()
    for number, line in enumerate(head.splitlines(), start=1):
        match line.split():
            case ["element", str(element), str(count)] if count.isdecimal():
                if len(count) > _LONGEST_COUNT:
                    raise FileError("no file has so many elements", number)
                if element == "vertex":
                    many = int(count)
                elif many < 0 and int(count):
                    raise FileError(f"`{element[:20]}` comes before the points", number)
            case ["property", *words] if element == "vertex":
                kind, name = words if len(words) == 2 else ("list", "")
                if kind not in _TYPES or name in properties:
                    raise FileError("a point's properties must be numbers, each once", number)
                properties[name] = _TYPES[kind]
    if many < 0 or not {*_AXES} <= {*properties}:
        raise FileError("the PLY header has no element `vertex` with x, y and z")
    return many, properties
