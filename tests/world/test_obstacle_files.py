"""The files that a scan or a map of ROS may come in, and what is told of those that are none."""

from __future__ import annotations

import struct
from math import pi

import numpy as np
import pytest

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.world.obstacle_files import occupied_places, read_image, read_info, read_points

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


PCD = """# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x normal y z
SIZE 8 4 4 4
TYPE F F F F
COUNT 1 3 1 1
WIDTH 2
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 2
DATA {data}
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
        b"0.5, -1.25, 2, 17\n1 , 0 ,0.75, 18\n",
        b"0.5;-1.25;2;\n1; 0; 0.75;\n",
        (PCD.format(data="ascii") + "0.5 7 8 9 -1.25 2\n1 7 8 9 0 .75\n").encode(),
        PCD.format(data="binary").encode()
        + b"".join(struct.pack("<d3fff", x, 7, 8, 9, y, z) for x, y, z in POINTS),
    ],
    ids=[
        "little",
        "big",
        "crlf",
        "ascii",
        "text",
        "commas",
        "table",
        "spaced",
        "semicolons",
        "pcd",
        "binary pcd",
    ],
)
def test_the_same_points_from_every_kind_of_file(data: bytes) -> None:
    assert read_points(file(data)) == pytest.approx(np.array(POINTS))


@pytest.mark.parametrize(
    ("data", "line", "said"),
    [
        (b"", 0, "it has no points"),
        (b"\x00\xff\xfe", 0, "it is neither PLY, PCD nor text"),
        (b"1 2 3\n1 2\n", 2, "no point: three numbers are needed"),
        (b"1 2 3\n1 2 inf\n", 2, "the point is not finite"),
        (b"x, y\n1, 2\n", 1, "the column `z` is missing"),
        (b"ply\nformat ascii 1.0\n", 0, "the PLY header has no end"),
        (b"ply\nformat zip 1.0\nend_header\n", 0, "the PLY header has no known format"),
        (b"ply\nformat ascii 1.0\nend_header\n", 0, "the PLY header has no element `vertex`"),
        (b"ply\nformat ascii 1.0\nelement face 2\nelement vertex 1\nend_header\n", 3, "`face`"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int x\nend_header\n", 4,
         "a point's properties must be numbers"),
        (binary("<")[:-30], 0, "it ends after 1 of its 2 points"),
        (binary("<").replace(b"vertex 2", b"vertex 9999999999999"), 0, "it ends after 2 of"),
        (binary("<").replace(b"vertex 2", b"vertex " + b"9" * 5000), 4, "too large"),
        (binary("<").replace(struct.pack("<d", 0.5), struct.pack("<d", float("nan"))), 0,
         "1 of its 2 points are not finite"),
        (b"1e999 0 0\n", 1, "the point is not finite"),
        (b"1 2 3\n1,5 -1,5 0,5\n", 2, "`1,5` has a decimal comma"),
        (b"1,5, -1,5, 0,5\n", 1, "`1,5` has a decimal comma"),
        (b"1,5;-1,5;0,5\n", 1, "`1,5` has a decimal comma"),
        (b"# a scan\n1,5,-1,5,0,5\n1,5,-1,5,0,6\n", 2, "its commas may be decimal commas"),
        (b"1 2 4_0\n", 1, "`4_0` has an underscore"),
        ("1 2 \u0663\n".encode(), 1, "`\u0663` has another keyboard's characters"),
        (PCD.format(data="ascii").encode(), 0, "it ends after 0 of its 2 points"),
        (PCD.format(data="binary_compressed").encode(), 11, "points as `binary_compressed`"),
        (PCD.format(data="ascii").replace("0 0 0 1", "1 0 0 1").encode(), 9, "another place"),
        (PCD.format(data="ascii").replace(" z", " w").encode(), 3, "no fields x, y and z"),
        (PCD.format(data="ascii").replace("SIZE 8", "SIZE 3").encode(), 3, "`x` has no size"),
        (PCD.format(data="ascii").replace("COUNT 1", "COUNT").encode(), 3, "not the same length"),
        (PCD.format(data="ascii").replace("POINTS 2", "POINTS").encode(), 10, "the number of its"),
        (PCD.format(data="ascii").replace("TYPE", "TIPE").encode(), 0, "no line `TYPE`"),
    ],
)  # fmt: skip
def test_what_is_no_scan_is_told(data: bytes, line: int, said: str) -> None:
    with pytest.raises(FileError) as caught:
        read_points(file(data))
    assert said in str(caught.value)
    assert caught.value.line == line


def test_whole_numbers_between_commas_are_points_where_they_have_one_meaning() -> None:
    assert read_points(file(b"1,-5,0,255,0,9\n")).tolist() == [[1.0, -5.0, 0.0]]
    assert read_points(file(b"1,5,2,7,2,7\n1,5,-1.5,0,0,0\n")).tolist()[0] == [1.0, 5.0, 2.0]
    named = b"x, y, z, r, g, b\n1,5,-1,5,0,5\n"
    assert read_points(file(named)).tolist() == [[1.0, 5.0, -1.0]]


def test_a_binary_file_is_recorded_byte_for_byte() -> None:
    assert file(binary("<")).data == binary("<")
    assert not file(binary("<")).is_text


INFO = """image: map.pgm
resolution: 0.5
origin: [1.0, 2.0, {yaw}]
negate: {negate}
occupied_thresh: 0.65
free_thresh: 0.196
"""
CELLS = bytes([254, 0, 254, 205, 254, 100])  # 3 x 2; 100 is 0.61 dark


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
    scaled = File("map.yaml", "", info().text + "mode: scale\n")
    assert read_info(scaled) == read_info(info())
    negated = occupied_places(read_info(info(negate=1)), values)
    assert len(negated) == 4


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not a map"),
        ("[1, 2]", "not a map"),
        ("a: &a [*a]", "not a map"),
        ("[" * 5000, "not a map"),
        ("x" * 20_000, "too long"),
        (INFO.format(yaw="nan", negate=0), "`origin` is not a position"),
        (INFO.format(yaw=0, negate=0).replace("0.5", "0"), "out of bounds"),
        (INFO.format(yaw=0, negate=0).replace("map.pgm", "[a]"), "not a file name"),
        (INFO.format(yaw=0, negate=".inf"), "not a map"),
        (INFO.format(yaw=0, negate=0).replace("0.5", "1" + "0" * 400), "out of bounds"),
        (INFO.format(yaw=0, negate=0).replace("0.5", "1e-300"), "out of bounds"),
        (INFO.format(yaw=0, negate=0).replace("2.0", "1.7e+308"), "`origin` is not a position"),
        (INFO.format(yaw=0, negate=0).replace("0.5", "0,5"), "`0,5` has a decimal comma"),
        (INFO.format(yaw=0, negate=0).replace("0.65", "6_5"), "`6_5` has an underscore"),
        (INFO.format(yaw=0, negate=0).replace("0.5", "[1]"), "not a map"),
        (INFO.format(yaw=0, negate=0).replace("0.5", "1:30"), "not a map"),
        (INFO.format(yaw=0, negate=0) + "mode: raw\n", "the mode `raw` can't be read"),
    ],
)
def test_what_is_no_map_is_told(text: str, said: str) -> None:
    with pytest.raises(FileError, match=said):
        read_info(File("map.yaml", "", text))


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "not a PGM"),
        (b"\x89PNG\r\n\x1a\n", "not a PGM"),
        (b"P5\n3 2\n255\n\x00", "3 x 2 values"),
        (b"P5\n3 2\n65535\n" + CELLS * 2, "3 x 2 values"),
        (b"P5\n999999999 999999999\n255\n" + CELLS, "999999999 x 999999999 values"),
        (b"P5\n0 2\n255\n" + CELLS, "0 x 2 values"),
        (b"P5\nthree 2\n255\n" + CELLS, "broken"),
        (b"P2\n1 1\n255\n999\n", "broken"),
        (b"P2\n1 1\n255\nx\n", "broken"),
        (b"P2\n1 1\n255\n1_0\n", "broken"),
        (b"P2\n0_1 1\n255\n1\n", "broken"),
        (b"P5\n3 2\n255", "broken"),
    ],
)
def test_what_is_no_picture_is_told(data: bytes, said: str) -> None:
    with pytest.raises(FileError, match=said):
        read_image(file(data))
