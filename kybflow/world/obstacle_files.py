"""Reads files of scanned obstacles. Every error is a FileError, with the line if there is one.

A point cloud is a PLY file (ASCII or binary) or text: three numbers per line, or a table
(`kybflow.core.files`) with the columns x, y and z. From a PLY file, x, y and z of the element
`vertex` are read and the rest is skipped. Some programs write NaN where the scanner saw nothing;
such points are refused, because an obstacle may be there.

An occupancy map of ROS's map_server is a YAML file and its image (PGM, 8 bits). A cell is occupied
if its darkness is more than `occupied_thresh`; the darkness is (255 - value) / 255, or value / 255
with `negate`. Unknown cells are free. The image's lower left corner is at `origin`: x, y and the
map's rotation.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from math import cos, isfinite, pi, sin
from typing import TYPE_CHECKING, Any, NamedTuple

import yaml

from kybflow.core.errors import FileError
from kybflow.core.files import File, header_line, need, read_table
from kybflow.core.units import LENGTH, Dimension
from kybflow.world.scanned import MAX_RANGE

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
        hint = "leave out points that the scanner did not see"
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
        raise FileError(
            "the point is not finite", line, "leave out points that the scanner did not see"
        )
    return numbers


def _ply(file: File) -> NDArray[Any]:
    import numpy as np

    header = _header(file.text)
    if not header.order:
        names = list(header.properties)
        places = [names.index(axis) for axis in _AXES]
        lines = [line.split() for line in file.text.splitlines()[header.lines :]][: header.many]
        if len(lines) < header.many:
            raise FileError(f"it ends after {len(lines)} of its {header.many} points")
        points = [
            _numbers(number, [words[i] for i in places if i < len(words)])
            for number, words in enumerate(lines, start=header.lines + 1)
        ]
        return np.array(points, dtype=float).reshape(-1, 3)
    row = np.dtype([(name, header.order + kind) for name, kind in header.properties.items()])
    data = file.data[header.size :]
    if len(data) < header.many * row.itemsize:
        whole = len(data) // row.itemsize
        raise FileError(f"it ends after {whole} of its {header.many} points")
    rows = np.frombuffer(data, row, header.many)
    return np.stack([rows[axis].astype(float) for axis in _AXES], axis=1)


def _header(text: str) -> _Header:
    head, ended, rest = text[:_LONGEST_HEADER].partition("end_header")
    if not ended:
        raise FileError("the PLY header has no end", hint="it ends with a line `end_header`")
    order = re.search(r"^format[ \t]+(\w+)", head, re.MULTILINE)
    if order is None or order[1] not in _ORDERS:
        raise FileError("the PLY header has no known format")
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
                    raise FileError("the number of elements is too large", number)
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


_MAX_YAML = 10_000
_MIN_CELL, _MAX_CELL = 1e-3, 10.0
_PGM_WORD = re.compile(rb"\s*(?:#[^\n]*\n\s*)*(\S+)")


class MapInfo(NamedTuple):
    """The content of the YAML file. image: the path of the image, relative to this file.
    resolution: metres per cell. origin: x and y (m) and the rotation (rad). occupied: the darkness
    above which a cell is occupied. negate: whether white is occupied."""

    image: str
    resolution: float
    origin: tuple[float, float, float]
    occupied: float
    negate: bool


def read_info(file: File) -> MapInfo:
    if len(file.text) > _MAX_YAML:
        raise FileError("it is too long for a map's YAML file")
    try:
        info: Any = yaml.safe_load(file.text)
        image, resolution = info["image"], float(info["resolution"])
        x, y, turned = map(float, info["origin"])
        occupied, negate = float(info["occupied_thresh"]), bool(int(info.get("negate", 0)))
    except (
        yaml.YAMLError, RecursionError, AttributeError, KeyError, TypeError, ValueError,
        OverflowError,
    ):  # fmt: skip
        hint = "it needs `image`, `resolution`, `origin: [x, y, yaw]` and `occupied_thresh`"
        raise FileError("it is not a map of ROS's map_server", hint=hint) from None
    if not isinstance(image, str):
        raise FileError("`image` is not a file name")
    if not _MIN_CELL <= resolution <= _MAX_CELL or not 0.0 < occupied < 1.0:
        raise FileError("`resolution` or `occupied_thresh` is out of bounds")
    if not max(abs(x), abs(y)) <= MAX_RANGE or not abs(turned) <= 2 * pi:
        raise FileError("`origin` is not a position")
    return MapInfo(image, resolution, (x, y, turned), occupied, negate)


def read_image(file: File) -> NDArray[Any]:
    """Return the values of a PGM image, (height, width), the top row first."""
    import numpy as np

    words, place, data = list[bytes](), 0, file.data
    while len(words) < 4 and (match := _PGM_WORD.match(data, place)):
        words.append(match[1])
        place = match.end()
    if len(words) < 4 or words[0] not in (b"P2", b"P5"):
        raise FileError("it is not a PGM picture", hint="convert it: `convert map.png map.pgm`")
    try:
        width, height, most = (int(word) for word in words[1:])
        values = (
            np.frombuffer(data, np.uint8, offset=place + 1)
            if words[0] == b"P5"
            else np.array(data[place:].split(), np.uint8)
        )
    except (ValueError, OverflowError):
        raise FileError("it is a broken PGM picture") from None
    if most != 255 or min(width, height) < 1 or len(values) < width * height:
        raise FileError(f"{width} x {height} values of 8 bits are needed, but this has others")
    return values[: width * height].reshape(height, width)


def occupied_places(info: MapInfo, image: NDArray[Any]) -> NDArray[Any]:
    """Return the centres of the occupied cells in the world, (n, 2), metres."""
    import numpy as np

    dark = image / 255.0 if info.negate else (255.0 - image) / 255.0
    rows, columns = np.nonzero(dark > info.occupied)
    cells = np.column_stack((columns + 0.5, len(image) - rows - 0.5)) * info.resolution
    x, y, turned = info.origin
    c, s = cos(turned), sin(turned)
    places: NDArray[Any] = cells @ np.array(((c, s), (-s, c))) + (x, y)
    return places
