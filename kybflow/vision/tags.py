"""Tag families, the patterns of their tags, and tables of tags in text form.

A table (`kybflow.core.files`) has one row per tag:

    family, id, size, x, y, z, heading [deg]
    36h11, 300, 0.1, 1.0, 2.0, 0.0, 90
    ...

All of these columns are required. The columns `roll` and `pitch`, each with its unit, are optional:
a tag that lies on the floor is turned by roll about x, then by pitch about y, then by heading about
z. Errors in a table raise FileError, which names the line.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable
from math import degrees
from typing import TYPE_CHECKING, Any, NamedTuple

from kybflow.core.errors import FileError
from kybflow.core.files import File, header_line, need, read_table
from kybflow.core.geometry import from_euler, to_euler
from kybflow.core.text import did_you_mean
from kybflow.core.units import ANGLE, LENGTH, NUMBER, Dimension
from kybflow.world.tags import Tag

if TYPE_CHECKING:
    from numpy.typing import NDArray

FAMILIES: dict[str, tuple[str, int]] = {
    "36h11": ("DICT_APRILTAG_36h11", 587),
    "36h10": ("DICT_APRILTAG_36h10", 2320),
    "25h9": ("DICT_APRILTAG_25h9", 35),
    "16h5": ("DICT_APRILTAG_16h5", 30),
    "aruco_4x4": ("DICT_4X4_1000", 1000),
    "aruco_5x5": ("DICT_5X5_1000", 1000),
    "aruco_6x6": ("DICT_6X6_1000", 1000),
    "aruco_7x7": ("DICT_7X7_1000", 1000),
    "aruco_original": ("DICT_ARUCO_ORIGINAL", 1024),
}
"""Each family's OpenCV name and number of tags. Kybflow's names of AprilTag families have no
prefix."""


@functools.cache
def dictionary(family: str) -> Any:
    """Return OpenCV's dictionary of a family."""
    import cv2

    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILIES[family][0]))


def cells(family: str) -> int:
    """Return the number of cells along a side of the black square, including its border."""
    return int(dictionary(family).markerSize) + 2


@functools.cache
def pattern(family: str, id: int) -> NDArray[Any]:
    """Return the image of a tag with one pixel per cell, top row first: (cells, cells) uint8, 0 for
    black and 255 for white."""
    import cv2

    image: NDArray[Any] = cv2.aruco.generateImageMarker(dictionary(family), id, cells(family))
    return image


_NEEDED = ("family", "id", "size", "x", "y", "z", "heading")
_COLUMNS: dict[str, Dimension | None] = {
    "family": None,
    "id": NUMBER,
    **dict.fromkeys(("size", "x", "y", "z"), LENGTH),
    **dict.fromkeys(("heading", "roll", "pitch"), ANGLE),
}
MAX_TAG = 10.0
"""Largest valid side of a black square, metres."""
_LIKE = "family, id, size, x, y, z, heading [deg]"


class TagRow(NamedTuple):
    """A tag, and its line in the table."""

    tag: Tag
    line: int


def read_tags(file: File) -> tuple[TagRow, ...]:
    """Return the tags of a file, at least one. Raises FileError."""
    table = read_table(file.text, _COLUMNS, "tags", _LIKE)
    need(table, _NEEDED, header_line(file.text))
    first: dict[tuple[str, int], int] = {}
    rows: list[TagRow] = []
    for line, numbers, words in table.rows:
        family = words["family"]
        if family not in FAMILIES:
            message = f"`{family[:20]}` is not a family of tags"
            raise FileError(message, line, did_you_mean(family, FAMILIES))
        number, most = numbers["id"], FAMILIES[family][1] - 1
        if not (number.is_integer() and 0 <= number <= most):
            message = f"{family} has no tag {number:g}"
            raise FileError(message, line, f"its tags are 0 to {most}")
        if not 0.0 < numbers["size"] <= MAX_TAG:
            hint = "name the unit in the first line unless it is metres, like `size [cm]`"
            raise FileError(f"`size` must be above 0 m and at most {MAX_TAG:g} m", line, hint)
        turn = from_euler(numbers.get("roll", 0.0), numbers.get("pitch", 0.0), numbers["heading"])
        at = numbers["x"], numbers["y"], numbers["z"]
        tag = Tag(family, int(number), numbers["size"], at, turn)
        if tag.key in first:
            message = f"tag {tag.id} of {tag.family} is in line {first[tag.key]} already"
            raise FileError(message, line)
        first[tag.key] = line
        rows.append(TagRow(tag, line))
    if not rows:
        raise FileError("it has no tags")
    return tuple(rows)


def write_tags(tags: Iterable[Tag]) -> str:
    """Return tags as a table, rounded to a hundredth of a millimetre and a thousandth of a
    degree."""
    rows = ["family, id, size, x, y, z, roll [deg], pitch [deg], heading [deg]"]
    for tag in tags:
        place = [f"{metres:.5f}" for metres in tag.position]
        turn = [f"{degrees(angle):.3f}" for angle in to_euler(tag.attitude)]
        rows.append(", ".join([tag.family, str(tag.id), f"{tag.size:g}", *place, *turn]))
    return "\n".join(rows) + "\n"
