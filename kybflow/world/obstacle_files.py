"""Reads files of scanned obstacles. Every error is a FileError, with the line if there is one.

A point cloud is a PLY or PCD file (ASCII or binary) or text: three numbers per line, or a table
(`kybflow.core.files`) with the columns x, y and z. From a PLY file, x, y and z of the element
`vertex` are read, from a PCD file the fields x, y and z, and the rest is skipped. Some programs
write NaN where the scanner saw nothing; such points are refused, because an obstacle may be there.
Decimal commas are refused: beside commas as separators, they would move the points.

An occupancy map of ROS's map_server is a YAML file and its image (PGM, 8 bits). A cell is occupied
if its darkness is more than `occupied_thresh`; the darkness is (255 - value) / 255, or value / 255
with `negate`. The `mode` is `trinary` or `scale`. Unknown cells are free. The image's lower left
corner is at `origin`: x, y and the map's rotation.

PCD is the format of the Point Cloud Library, version 0.7:
https://pointclouds.org/documentation/tutorials/pcd_file_format.html
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from math import cos, isfinite, pi, sin
from typing import TYPE_CHECKING, Any, NamedTuple

import yaml

from kybflow.core.errors import FileError, UnitError
from kybflow.core.files import File, header_line, need, read_table
from kybflow.core.units import LENGTH, Dimension, parse_number
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
_APART = re.compile(r"[,;]*\s[\s,;]*|;+")
"""What separates numbers in a line that not only commas separate."""
_SIX_WHOLE = re.compile(r"[-+]?\d+,\d+(?:,[-+]?\d+,\d+){2}\Z", re.ASCII)
"""Six whole numbers, each second one without a sign, which may be three with decimal commas."""
_NAN = re.compile(r"[-+]?(nan|inf|infinity)\b", re.IGNORECASE)
_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER, _LONGEST_COUNT = 10_000, 18


class _Header(NamedTuple):
    """The header of a PLY or PCD file. order: the byte order of the vertices, empty for text.
    many: the number of vertices. properties: the type of each of their properties. lines, size: the
    header's length in lines and in bytes."""

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
        points = _vertices_of(file, _header(file.text))
    elif _PCD.match(file.text):
        points = _vertices_of(file, _pcd_header(file.text))
    else:
        if not file.is_text:
            raise FileError("it is neither PLY, PCD nor text", hint="convert it to PLY")
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
    stripped = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1)]
    lines = [(number, line) for number, line in stripped if line and not line.startswith("#")]
    if all(_SIX_WHOLE.match(line) for _, line in lines) and lines:
        hint = "write decimal points, or name the columns in a first line: `x, y, z, r, g, b`"
        raise FileError("its commas may be decimal commas", lines[0][0], hint)
    for number, line in lines:
        is_mixed = "," in line and _APART.search(line)
        yield _numbers(number, (_APART if is_mixed else _NUMBERS).split(line)[:3])


def _numbers(line: int, words: list[str]) -> tuple[float, ...]:
    if len(words) != 3:
        raise FileError("no point: three numbers are needed", line)
    try:
        numbers = tuple(map(parse_number, words))
    except UnitError as error:
        message = str(error) if error.hint else "no point: three numbers are needed"
        raise FileError(message, line, error.hint) from None
    if not all(map(isfinite, numbers)):
        raise FileError(
            "the point is not finite", line, "leave out points that the scanner did not see"
        )
    return numbers


def _vertices_of(file: File, header: _Header) -> NDArray[Any]:
    import numpy as np

    if not header.order:
        names = list(header.properties)
        places = [names.index(axis) for axis in _AXES]
        lines = [line.split() for line in file.text.splitlines()[header.lines :]][: header.many]
        if len(lines) < header.many:
            raise _cut_off(len(lines), header.many)
        points = [
            _numbers(number, [words[i] for i in places if i < len(words)])
            for number, words in enumerate(lines, start=header.lines + 1)
        ]
        return np.array(points, dtype=float).reshape(-1, 3)
    row = np.dtype([(name, header.order + kind) for name, kind in header.properties.items()])
    data = file.data[header.size :]
    if len(data) < header.many * row.itemsize:
        whole = len(data) // row.itemsize
        raise _cut_off(whole, header.many)
    rows = np.frombuffer(data, row, header.many)
    return np.stack([rows[axis].astype(float) for axis in _AXES], axis=1)


def _cut_off(whole: int, many: int) -> FileError:
    message = f"it ends after {whole} of its {many} points"
    return FileError(message, hint="the file is cut off: export it again")


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
            case ["element", str(element), str(count)] if count.isascii() and count.isdecimal():
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


_PCD = re.compile(r"(?:[ \t]*#[^\n]*\n)*[ \t]*VERSION[ \t]")
_PCD_TYPES = {"F": "f", "I": "i", "U": "u"}
_UNMOVED = re.compile(r"(?:-?0(?:\.0*)? ){3}1(?:\.0*)?(?: -?0(?:\.0*)?){3}\Z")
_BYTES = frozenset({"1", "2", "4", "8"})


def _pcd_header(text: str) -> _Header:
    head = text[:_LONGEST_HEADER]
    said: dict[str, tuple[int, list[str]]] = {}
    place = 0
    for number, line in enumerate(head.splitlines(keepends=True), start=1):
        place += len(line)
        key, *words = line.split() or [""]
        if key and not key.startswith("#"):
            said[key] = number, words
        if key == "DATA":
            break
    missing = {"FIELDS", "SIZE", "TYPE", "POINTS", "DATA"} - {*said}
    if missing:
        raise FileError(f"the PCD header has no line `{min(missing)}`")
    at, data = said["DATA"]
    if data not in (["ascii"], ["binary"]):
        hint = "save it as ASCII: `pcl_convert_pcd_ascii_binary IN.pcd OUT.pcd 0`"
        raise FileError(f"points as `{' '.join(data)[:20]}` can't be read", at, hint)
    at, viewpoint = said.get("VIEWPOINT", (0, []))
    if viewpoint and not _UNMOVED.match(" ".join(viewpoint)):
        hint = "move them into the world, and write `VIEWPOINT 0 0 0 1 0 0 0`"
        raise FileError("its points are as seen from another place", at, hint)
    at, counts = said["POINTS"]
    many = counts[0] if counts else ""
    if not (many.isascii() and many.isdecimal() and len(many) <= _LONGEST_COUNT):
        raise FileError("the number of its points is missing", at)
    size = len(head[:place].encode("utf-8", "surrogateescape"))
    order = "" if data == ["ascii"] else "<"
    return _Header(order, int(many), _pcd_fields(said), said["DATA"][0], size)


def _pcd_fields(said: Mapping[str, tuple[int, list[str]]]) -> dict[str, str]:
    """Return the type of each number of a point, by field; of a field with several numbers, the
    further ones have a number in their name."""
    line, names = said["FIELDS"]
    (_, sizes), (_, types) = said["SIZE"], said["TYPE"]
    _, counts = said.get("COUNT", (0, ["1"] * len(names)))
    properties: dict[str, str] = {}
    if not len(names) == len(sizes) == len(types) == len(counts):
        raise FileError("FIELDS, SIZE, TYPE and COUNT have not the same length", line)
    for name, size, kind, count in zip(names, sizes, types, counts, strict=True):
        whole = count in map(str, range(1, _MOST_NUMBERS))
        if size not in _BYTES or kind not in _PCD_TYPES or kind + size == "F1" or not whole:
            raise FileError(f"`{name[:20]}` has no size and type that are known", line)
        for i in range(int(count)):
            properties[f"{name}_{len(properties)}" if i or name in properties else name] = (
                f"{_PCD_TYPES[kind]}{size}"
            )
    if not {*_AXES} <= {*properties}:
        raise FileError("its points have no fields x, y and z", line)
    return properties


_MOST_NUMBERS = 4097
"""More numbers than a field of a point has, which may be a histogram."""
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
        root: Any = yaml.compose(file.text, Loader=yaml.SafeLoader)
        said = {key.value: value for key, value in root.value}
        image, mode, negated = said["image"], said.get("mode"), said.get("negate")
        resolution, occupied = _number_of(said["resolution"]), _number_of(said["occupied_thresh"])
        x, y, turned = map(_number_of, said["origin"].value)
        negate = False if negated is None else _NEGATE[negated.value]
    except (
        yaml.YAMLError, RecursionError, AttributeError, KeyError, TypeError, ValueError,
    ):  # fmt: skip
        hint = "it needs `image`, `resolution`, `origin: [x, y, yaw]` and `occupied_thresh`"
        raise FileError("it is not a map of ROS's map_server", hint=hint) from None
    if not isinstance(image, yaml.ScalarNode):
        raise FileError("`image` is not a file name")
    if mode is not None and mode.value not in ("trinary", "scale"):
        raise FileError(
            f"the mode `{str(mode.value)[:20]}` can't be read, because it has no threshold",
            mode.start_mark.line + 1,
            "save the map with `mode: trinary`",
        )
    if not _MIN_CELL <= resolution <= _MAX_CELL or not 0.0 < occupied < 1.0:
        raise FileError("`resolution` or `occupied_thresh` is out of bounds")
    if not max(abs(x), abs(y)) <= MAX_RANGE or not abs(turned) <= 2 * pi:
        raise FileError("`origin` is not a position")
    return MapInfo(image.value, resolution, (x, y, turned), occupied, negate)


_NEGATE = {"0": False, "1": True, "false": False, "true": True}


def _number_of(node: Any) -> float:
    if not isinstance(node, yaml.ScalarNode):
        raise TypeError
    try:
        return parse_number(node.value)
    except UnitError as error:
        if not error.hint:
            raise ValueError from None
        raise FileError(str(error), node.start_mark.line + 1, error.hint) from None


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
        if not all(map(bytes.isdigit, words[1:])):
            raise FileError("it is a broken PGM picture")
        width, height, most = (int(word) for word in words[1:])
        if words[0] == b"P5":
            values = np.frombuffer(data, np.uint8, offset=place + 1)
        elif b"_" in data[place:]:
            raise FileError("it is a broken PGM picture")
        else:
            values = np.array(data[place:].split(), np.uint8)
    except (ValueError, OverflowError):
        raise FileError("it is a broken PGM picture") from None
    if most != 255 or min(width, height) < 1 or len(values) < width * height:
        message = f"{width} x {height} values of 8 bits are needed, but this has others"
        raise FileError(message, hint="export it again, with 8 bits for each pixel")
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
