"""Reads an occupancy map of ROS's map_server: a YAML file and its image (PGM, 8 bits).

A cell is occupied if its darkness is more than `occupied_thresh`; the darkness is (255 - value) /
255, or value / 255 with `negate`. Unknown cells are free. The image's lower left corner is at
`origin`: x, y and the map's rotation. Every error is a FileError.
"""

from __future__ import annotations

import re
from math import cos, pi, sin
from typing import TYPE_CHECKING, Any, NamedTuple

import yaml

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.world.point_cloud import FARTHEST

if TYPE_CHECKING:
    from numpy.typing import NDArray

_LONGEST = 10_000
_FINEST, _COARSEST = 1e-3, 10.0
_WORD = re.compile(rb"\s*(?:#[^\n]*\n\s*)*(\S+)")


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
    if len(file.text) > _LONGEST:
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
        raise FileError("it is no map of ROS's map_server", hint=hint) from None
    if not isinstance(image, str):
        raise FileError("`image` is no name of a file")
    if not _FINEST <= resolution <= _COARSEST or not 0.0 < occupied < 1.0:
        raise FileError("`resolution` or `occupied_thresh` is out of bounds")
    if not max(abs(x), abs(y)) <= FARTHEST or not abs(turned) <= 2 * pi:
        raise FileError("`origin` is no place")
    return MapInfo(image, resolution, (x, y, turned), occupied, negate)


def read_image(file: File) -> NDArray[Any]:
    """Return the values of a PGM image, (height, width), the top row first."""
    import numpy as np

    words, place, data = list[bytes](), 0, file.data
    while len(words) < 4 and (match := _WORD.match(data, place)):
        words.append(match[1])
        place = match.end()
    if len(words) < 4 or words[0] not in (b"P2", b"P5"):
        raise FileError("it is no PGM picture", hint="convert it: `convert map.png map.pgm`")
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
