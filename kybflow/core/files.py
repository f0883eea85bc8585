"""The types of parameters that name a file, tables with units, the name of a run's control file,
reading of regular files, and atomic writing.

A table is a file of values that are separated by commas, semicolons or tabs, all by what separates
the header's. Its header names the columns in any order, each with its unit in brackets: `x [cm]`. A
column without a unit is in SI, but angles and angular rates must name one. A column without a
dimension holds words. Empty lines and lines that begin with `#` are skipped, and so is one
separator at a line's end. Numbers have a decimal point. Errors are raised as FileError with the
line number.
"""

from __future__ import annotations

import errno
import os
import re
import stat
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import BinaryIO, NamedTuple

from kybflow.core.errors import FileError, UnitError
from kybflow.core.units import Dimension, finite_number, parse_number

CONTROL = "control.json"
"""The file in a run's folder that holds the address at which the flying run accepts commands."""


@dataclass(frozen=True, slots=True)
class File:
    """A file as it was when the mission was compiled. It is never opened again, so the mission
    flies with the contents that were checked.

    name: the path as written, relative to the YAML file that names it. sha256: the digest of its
    bytes. text: its contents, decoded as UTF-8; bytes that are not UTF-8 become surrogate escapes
    where the parameter allows binary files.
    """

    name: str
    sha256: str
    text: str = field(repr=False, compare=False)

    def __str__(self) -> str:
        return self.name

    @property
    def is_text(self) -> bool:
        """Whether the whole file is valid UTF-8."""
        try:
            self.text.encode()
        except UnicodeEncodeError:
            return False
        return True

    @property
    def data(self) -> bytes:
        """The bytes of the file, without a byte order mark."""
        return self.text.encode("utf-8", "surrogateescape")


class FilePath(str):
    """The absolute path of a file that is too large to read at compile time. In the mission, the
    path is relative to the YAML file that names it; the compiler checks that the file exists."""

    __slots__ = ()


class NotRegular(OSError):
    """A path leads to a folder, a pipe, a socket or a device."""


def open_regular(path: Path) -> BinaryIO:
    """Open a file that a person named. A pipe or a device would block or never end, and is refused
    without being waited for. Raises NotRegular, and any other OSError or ValueError of `open`."""
    try:
        stream = open(path, "rb", opener=_without_waiting)  # noqa: SIM115 - it is returned
    except IsADirectoryError as error:
        raise NotRegular(error.errno, _NOT_REGULAR, str(path)) from None
    if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
        stream.close()
        raise NotRegular(errno.EINVAL, _NOT_REGULAR, str(path))
    return stream


def read_regular(path: Path, most: int) -> bytes:
    """Return the bytes of a file that a person named; of a larger file, one byte more than `most`.
    Raises what `open_regular` raises."""
    with open_regular(path) as stream:
        return stream.read(most + 1)


def read_all(path: Path) -> bytes:
    """Return the bytes of a file that a person named, or that a program wrote for kybflow. Raises
    OSError for a file that is not regular or above 256 MB."""
    data = read_regular(path, _MOST_BYTES)
    if len(data) > _MOST_BYTES:
        raise OSError(errno.EFBIG, f"larger than {_MOST_BYTES >> 20} MB", str(path))
    return data


_NOT_REGULAR = "not a regular file"
_MOST_BYTES = 256 << 20


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)


def write_whole(path: Path, data: bytes) -> None:
    """Write a file completely or not at all: the data goes to a file beside it, which then takes
    its place, so that no reader sees half of it. If writing fails, a previous file stays. A device
    or a pipe is written to directly. Raises OSError."""
    whole = path.resolve()
    if whole.exists() and not whole.is_file():
        path.write_bytes(data)
        return
    aside = whole.with_name(f".{whole.name}.{os.getpid()}")  # another process may write it too
    try:
        aside.write_bytes(data)
        aside.replace(whole)
    except BaseException:
        with suppress(OSError):
            aside.unlink()
        raise


_WHOLE = re.compile(r"[-+]?\d*\Z", re.ASCII)
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
    lines = cells_of(text)
    first = next(lines, None)
    if first is None or _is_number(first[1][0]):
        raise FileError(
            "it has no header", 0 if first is None else first[0], f"begin with a line like `{like}`"
        )
    number, header = first
    factors: dict[str, float | None] = {}
    for cell in header:
        name, factor = _column(number, cell, columns, what)
        if name in factors:
            raise FileError(f"the column `{name}` occurs twice", number)
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


def cells_of(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the line number and the cells of the header and of each row. An empty last cell that
    the header doesn't name is left out: some programs end every line with a separator."""
    lines = _lines(text)
    number, line = next(lines, (0, ""))
    if not number:
        return
    separator = next((mark for mark in ";\t" if mark in line and "," not in line), ",")
    header = [cell.strip() for cell in line.split(separator)]
    if len(header) > 1 and not header[-1]:
        header.pop()
    yield number, header
    for number, line in lines:
        cells = [cell.strip() for cell in line.split(separator)]
        if len(cells) == len(header) + 1 and not cells[-1]:
            cells.pop()
        yield number, cells


def number_in(cell: str, line: int) -> float:
    """Return the finite number in a cell. Raises FileError with the line number `line`."""
    try:
        return finite_number(cell)
    except UnitError as error:
        raise FileError(str(error), line, error.hint) from None


def _is_number(cell: str) -> bool:
    try:
        return isfinite(parse_number(cell))
    except UnitError as error:
        return bool(error.hint)  # a number in another notation


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
        hint = f"the columns are {known}"
        if {*cell.split()} <= {*columns} and " " in cell:
            hint = f"separate the columns with commas: `{', '.join(cell.split())}`"
        raise FileError(f"`{cell[:40]}` is not a column of {what}", number, hint)
    (name, unit), dimension = match.groups(), columns[match[1]]
    if dimension is None:
        return name, None
    if unit is None and dimension.bare_allowed:
        return name, 1.0
    units = " or ".join(f"`{name} [{known}]`" for known in dimension.units)
    if unit is None:
        raise FileError(f"`{name}` needs a unit", number, f"write {units}")
    if unit.strip() not in dimension.units:
        raise FileError(f"`{unit}` is not a unit of {dimension.name}", number, f"write {units}")
    return name, dimension.units[unit.strip()]


def _row(
    number: int, cells: list[str], factors: Mapping[str, float | None]
) -> tuple[int, dict[str, float], dict[str, str]]:
    if len(cells) != len(factors):
        message = f"{len(cells)} values in a table of {len(factors)} columns"
        hint = ""
        if len(cells) == 1 and re.search(r"[;\t]|\d +\S", cells[0]):
            hint = "separate the values like the columns of the first line"
        elif len(cells) > len(factors) and all(map(_WHOLE.match, cells)):
            hint = "a decimal comma separates values as well: write numbers with a decimal point"
        raise FileError(message, number, hint)
    numbers: dict[str, float] = {}
    words: dict[str, str] = {}
    for (name, factor), cell in zip(factors.items(), cells, strict=True):
        if factor is None:
            words[name] = cell
            continue
        numbers[name] = factor * number_in(cell, number)
    return number, numbers, words
