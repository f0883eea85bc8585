"""Maps of ROS's map_server: where their cells are, and what is told of those that are none."""

from __future__ import annotations

from math import pi

import pytest

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.world.obstacle_files import occupied_places, read_image, read_info

INFO = """image: map.pgm
resolution: 0.5
origin: [1.0, 2.0, {yaw}]
negate: {negate}
occupied_thresh: 0.65
free_thresh: 0.196
"""
CELLS = bytes([254, 0, 254, 205, 254, 100])  # 3 x 2; 100 is 0.61 dark


def file(data: bytes) -> File:
    return File("map", "", data.decode("utf-8", "surrogateescape"))


def info(yaw: float = 0.0, negate: int = 0) -> File:
    return File("map.yaml", "", INFO.format(yaw=yaw, negate=negate))


BINARY = file(b"P5\n# CREATOR: map_saver 0.5 m/pix\n3 2\n255\n" + CELLS)
TEXT = file(b"P2 3 2\n255\n254 0 254\n205 254 100\n")


@pytest.mark.parametrize("image", [BINARY, TEXT], ids=["binary", "text"])
def test_occupied_cells_are_where_ros_has_them(image: File) -> None:
    values = read_image(image)
    assert occupied_places(read_info(info()), values).tolist() == [[1.75, 2.75]]
    turned = occupied_places(read_info(info(pi / 2)), values)
    assert turned.tolist()[0] == pytest.approx([1.0 - 0.75, 2.0 + 0.75])
    negated = occupied_places(read_info(info(negate=1)), values)
    assert len(negated) == 4


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no map"),
        ("[1, 2]", "no map"),
        ("a: &a [*a]", "no map"),
        ("[" * 5000, "no map"),
        ("x" * 20_000, "too long"),
        (INFO.format(yaw="nan", negate=0), "`origin` is no place"),
        (INFO.format(yaw=0, negate=0).replace("0.5", "0"), "out of bounds"),
        (INFO.format(yaw=0, negate=0).replace("map.pgm", "[a]"), "no name of a file"),
        (INFO.format(yaw=0, negate=".inf"), "no map"),
        (INFO.format(yaw=0, negate=0).replace("0.5", "1" + "0" * 400), "no map"),
        (INFO.format(yaw=0, negate=0).replace("0.5", "1e-300"), "out of bounds"),
        (INFO.format(yaw=0, negate=0).replace("2.0", "1.7e+308"), "`origin` is no place"),
    ],
)
def test_what_is_no_map_is_told(text: str, said: str) -> None:
    with pytest.raises(FileError, match=said):
        read_info(File("map.yaml", "", text))


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "no PGM"),
        (b"\x89PNG\r\n\x1a\n", "no PGM"),
        (b"P5\n3 2\n255\n\x00", "3 x 2 values"),
        (b"P5\n3 2\n65535\n" + CELLS * 2, "3 x 2 values"),
        (b"P5\n999999999 999999999\n255\n" + CELLS, "999999999 x 999999999 values"),
        (b"P5\n0 2\n255\n" + CELLS, "0 x 2 values"),
        (b"P5\nthree 2\n255\n" + CELLS, "broken"),
        (b"P2\n1 1\n255\n999\n", "broken"),
        (b"P2\n1 1\n255\nx\n", "broken"),
        (b"P5\n3 2\n255", "broken"),
    ],
)
def test_what_is_no_picture_is_told(data: bytes, said: str) -> None:
    with pytest.raises(FileError, match=said):
        read_image(file(data))
