"""Read comma-separated tables with units in the header.

The header names the columns in any order, each with its unit in brackets: `x [cm]`. A column
without a unit is in SI, but angles and angular rates must name one. A column without a dimension
holds words. Empty lines and lines that begin with `#` are skipped. Errors are raised as FileError
with the line number.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from math import isfinite
from typing import NamedTuple

from kybflow.core.errors import FileError
from kybflow.core.units import Dimension

_HEADER = re.compile(r"([A-Za-z]\w*)\s*(?:\[([^\]]*)\])?\Z")


class Table(NamedTuple):
    """A parsed table. columns: the names in the order of the header. rows: yields the line number
    in the file, the numbers in SI by column, and the words by column."""

    columns: tuple[str, ...]
    rows: Iterator[tuple[int, dict[str, float], dict[str, str]]]


def read_table(text: str, columns: Mapping[str, Dimension | None], what: str, like: str) -> Table:
    """Parse the header of `text` and return a table whose rows are parsed lazily.

    columns: the dimension of each known column, None for words. what: what the table holds, for
    messages. like: an example of a header, for messages. Raises FileError for a bad header;
    iterating over `rows` raises FileError for a bad row.
    """
    lines = _lines(text)
    first = next(lines, None)
    if first is None:
        raise FileError("it has no header", hint=f"begin with a line like `{like}`")
    number, line = first
    factors: dict[str, float | None] = {}
    for cell in line.split(","):
        name, factor = _column(number, cell.strip(), columns, what)
        if name in factors:
            raise FileError(f"the column `{name}` is there twice", number)
        factors[name] = factor
    return Table(tuple(factors), (_row(*line, factors) for line in lines))


def need(table: Table, names: tuple[str, ...], line: int) -> None:
    """Raise FileError with the line number `line` if one of `names` is not a column."""
    for name in names:
        if name not in table.columns:
            raise FileError(f"the column `{name}` is missing", line)


def header_line(text: str) -> int:
    """Return the line number of the header, 1 if there is none."""
    return next(_lines(text), (1, ""))[0]


def _lines(text: str) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, line


def _column(
    number: int, cell: str, columns: Mapping[str, Dimension | None], what: str
) -> tuple[str, float | None]:
    """Return a header cell's name and its factor to SI, None for words. Raises FileError."""
    match = _HEADER.match(cell)
    if match is None or match[1] not in columns:
        known = ", ".join(f"`{name}`" for name in columns)
        raise FileError(f"`{cell[:40]}` is no column of {what}", number, f"the columns are {known}")
    (name, unit), dimension = match.groups(), columns[match[1]]
    if dimension is None:
        return name, None
    if unit is None and dimension.bare_allowed:
        return name, 1.0
    units = " or ".join(f"`{name} [{known}]`" for known in dimension.units)
    if unit is None:
        raise FileError(f"`{name}` needs a unit", number, f"write {units}")
    if unit.strip() not in dimension.units:
        raise FileError(f"`{unit}` is no unit of {dimension.name}", number, f"write {units}")
    return name, dimension.units[unit.strip()]


def _row(
    number: int, line: str, factors: Mapping[str, float | None]
) -> tuple[int, dict[str, float], dict[str, str]]:
    cells = [cell.strip() for cell in line.split(",")]
    if len(cells) != len(factors):
        message = f"{len(cells)} values in a table of {len(factors)} columns"
        raise FileError(message, number)
    pairs = list(zip(factors.items(), cells, strict=True))
    numbers = {n: f * _number(number, cell) for (n, f), cell in pairs if f is not None}
    return number, numbers, {n: cell for (n, f), cell in pairs if f is None}


def _number(line: int, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        raise FileError(f"`{cell[:20]}` is no number", line) from None
    if not isfinite(value):
        raise FileError(f"`{cell}` is not finite", line)
    return value
