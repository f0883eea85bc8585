"""The files that a scan may come in, and what is told of those that are none."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.world.obstacle_files import read_points

POINTS = [(0.5, -1.25, 2.0), (1.0, 0.0, 0.75)]
HEADER = """ply
format {format} 1.0
comment of a scanner
element vertex 2
property {x} x
property uchar red
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
"""


def file(data: bytes) -> File:
    return File("scan", "", data.decode("utf-8-sig", "surrogateescape"))


def binary(order: str, newline: str = "\n") -> bytes:
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    header = HEADER.format(format=name, x="double").replace("\n", newline)
    rows = b"".join(struct.pack(f"{order}dBff", x, 200, y, z) for x, y, z in POINTS)
    return header.encode() + rows + struct.pack(f"{order}Biii", 3, 0, 1, 1)


@pytest.mark.parametrize(
    "data",
    [
        binary("<"),
        binary(">"),
        binary("<", "\r\n"),
        (HEADER.format(format="ascii", x="float") + "0.5 7 -1.25 2\n1 7 0 .75\n3 0 1 1\n").encode(),
        b"# a scan\n0.5 -1.25 2 17\n\n1 0 0.75 18\n",
        b"0.5,-1.25,2\r\n1,0,0.75\r\n",
        b"\xef\xbb\xbfz [cm], x, intensity, y\n200, 0.5, 9, -1.25\n75, 1, 9, 0\n",
    ],
    ids=["little", "big", "crlf", "ascii", "text", "commas", "table"],
)
def test_the_same_points_from_every_kind_of_file(data: bytes) -> None:
    assert read_points(file(data)) == pytest.approx(np.array(POINTS))


@pytest.mark.parametrize(
    ("data", "line", "said"),
    [
        (b"", 0, "it has no points"),
        (b"\x00\xff\xfe", 0, "it is neither PLY nor text"),
        (b"1 2 3\n1 2\n", 2, "no point: three numbers are needed"),
        (b"1 2 3\n1 2 inf\n", 2, "the point is not finite"),
        (b"x, y\n1, 2\n", 1, "the column `z` is missing"),
        (b"ply\nformat ascii 1.0\n", 0, "the PLY header has no end"),
        (b"ply\nformat zip 1.0\nend_header\n", 0, "the PLY header has no format that is known"),
        (b"ply\nformat ascii 1.0\nend_header\n", 0, "the PLY header has no element `vertex`"),
        (b"ply\nformat ascii 1.0\nelement face 2\nelement vertex 1\nend_header\n", 3, "`face`"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int x\nend_header\n", 4,
         "a point's properties must be numbers"),
        (binary("<")[:-30], 0, "it ends after 1 of its 2 points"),
        (binary("<").replace(b"vertex 2", b"vertex 9999999999999"), 0, "it ends after 2 of"),
        (binary("<").replace(b"vertex 2", b"vertex " + b"9" * 5000), 4, "so many elements"),
        (binary("<").replace(struct.pack("<d", 0.5), struct.pack("<d", float("nan"))), 0,
         "1 of its 2 points are not finite"),
        (b"1e999 0 0\n", 1, "the point is not finite"),
    ],
)  # fmt: skip
def test_what_is_no_scan_is_told(data: bytes, line: int, said: str) -> None:
    with pytest.raises(FileError) as caught:
        read_points(file(data))
    assert said in str(caught.value)
    assert caught.value.line == line


def test_a_binary_file_is_recorded_byte_for_byte() -> None:
    assert file(binary("<")).data == binary("<")
    assert not file(binary("<")).is_text
