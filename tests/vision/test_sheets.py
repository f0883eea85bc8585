"""Tag sheets are true to scale, and what is printed is found."""

from __future__ import annotations

import re
import struct
import zlib
from pathlib import Path

import pytest

pytest.importorskip("cv2")

import cv2
import numpy
from toolchain import MISSIONS, invoke

from kybflow.vision.sheets import PAPERS, lay_out, pdf, png, raster
from kybflow.vision.tags import FAMILIES, cells, dictionary

POINTS = 72.0 / 25.4
EXACT = 2e-5
"""Millimetres: a length stands in the PDF with a ten-thousandth of a point."""


def found(image: numpy.ndarray, family: str) -> dict[int, numpy.ndarray]:
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary(family)).detectMarkers(image)
    return {int(i): c[0] for c, i in zip(corners, [] if ids is None else ids.ravel(), strict=True)}


@pytest.mark.thorough
@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_is_found_on_the_page_at_its_size(family: str) -> None:
    (page,) = lay_out(family, [3, 0, 29], 0.05, "a4")
    seen = found(raster(page, "a4", 254), family)
    assert seen.keys() == {0, 3, 29}
    for corners in seen.values():
        # the detector gives the centres of the outermost black pixels, 10 of which are a millimetre
        sides = numpy.linalg.norm(corners - numpy.roll(corners, 1, axis=0), axis=1)
        assert sides == pytest.approx(499.0, abs=1.5)
        assert corners[0][1] == corners[:, 1].min()  # upright
        assert corners[0][0] == corners[:, 0].min()


@pytest.mark.parametrize("family", ["36h11", "16h5", "aruco_7x7"])
@pytest.mark.parametrize("size", [0.02, 0.05, 0.195])
def test_what_is_cut_out_at_half_the_gap_has_its_number_and_an_arrow(
    family: str, size: float
) -> None:
    (page,) = lay_out(family, [27], size, "a3")
    whole = page.boxes[3]
    black = next(b for b in page.boxes if b.width == pytest.approx(1000.0 * size))
    (arrow,) = page.arrows
    mark = page.words[-1]
    assert mark.text == "27"
    low = max(black.y - 5.0, whole.y)
    high = min(black.y + black.height + 5.0, whole.y + whole.height)
    assert low < mark.y < mark.y + 0.72 * mark.height < black.y
    xs, ys = zip(*arrow.outline(), strict=True)
    assert black.y + black.height < min(ys) < max(ys) < high
    apart = 0.2 * black.width  # from the corners
    assert black.x + apart < min(mark.x, *xs)
    assert max(mark.x + 2 * 0.667 * mark.height, *xs) < black.x + black.width - apart
    tip = max(arrow.outline(), key=lambda corner: corner[1])
    assert tip == (arrow.x, arrow.y + arrow.height)


@pytest.mark.parametrize("dpi", [25, 50, 100, 254])
def test_what_is_printed_beside_a_tag_moves_no_corner(dpi: int) -> None:
    """Cut at half the least gap: white of 5 mm all around, dark floor beyond."""
    (page,) = lay_out("36h11", [123], 0.05, "a4")
    scale, corners = dpi / 25.4, []
    black = next(b for b in page.boxes if b.width == pytest.approx(50.0))
    left, low = black.x - 5.0, PAPERS["a4"][1] - black.y + 5.0
    side = round(60.0 * scale)
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    for shown in (page, page._replace(words=(), arrows=())):
        drawn = raster(shown, "a4", dpi)
        cut = drawn[round(low * scale) - side : round(low * scale), round(left * scale) :][:, :side]
        floor = numpy.pad(cut, 100, constant_values=90)
        floor = cv2.GaussianBlur(floor, (0, 0), 0.8)
        seen, ids, _ = cv2.aruco.ArucoDetector(dictionary("36h11"), parameters).detectMarkers(floor)
        assert ids.ravel().tolist() == [123]
        corners.append(seen[0])
    assert numpy.abs(corners[0] - corners[1]).max() < 0.02


def rectangles(page: bytes) -> list[tuple[float, ...]]:
    """Left, low, width, height in millimetres and grey of each, as a PDF reader takes them."""
    grey, out, operands = 0.0, [], []
    for word in page.decode().split():
        if re.fullmatch(r"-?[\d.]+", word):
            operands.append(float(word))
            continue
        if word == "cm":
            assert operands == [1.0, 0.0, 0.0, 1.0, 0.0, 0.0]
        elif word == "g":
            (grey,) = operands
        elif word == "re":
            out.append((*(number / POINTS for number in operands), grey))
        operands = []
    return out


def streams(data: bytes) -> list[bytes]:
    return [
        m[2] for m in re.finditer(rb"/Length (\d+)\s*>>\s*stream\r?\n(.*?)\nendstream", data, re.S)
    ]


@pytest.mark.parametrize(("size", "paper"), [(0.195, "a3"), (0.04, "a4"), (0.15, "a4")])
def test_lengths_on_the_page_are_exact(size: float, paper: str) -> None:
    data = pdf(lay_out("36h11", [0, 1, 2], size, paper), paper)
    boxes = [box for stream in streams(data) for box in rectangles(stream)]
    side = 1000.0 * size
    black = [b for b in boxes if b[4] == 0.0 and b[2] == pytest.approx(side, abs=EXACT)]
    assert len(black) == 3
    assert all(height == pytest.approx(side, abs=EXACT) for _, _, _, height, _ in black)
    white = [b for b in boxes if b[2] == pytest.approx(1.25 * side, abs=0.31) and b[4] == 1.0]
    for (x, y, *_), (left, low, *_) in zip(black, white, strict=True):
        assert x - left == pytest.approx(side / cells("36h11"), abs=0.16)
        assert y - low == pytest.approx(side / cells("36h11"), abs=0.16)
    assert any(b[2] == pytest.approx(100.0) and b[3] < 1.0 for b in boxes)
    width, height = PAPERS[paper]
    media = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", data)
    assert media is not None
    assert float(media[1]) == pytest.approx(width * POINTS, abs=1e-3)
    assert float(media[2]) == pytest.approx(height * POINTS, abs=1e-3)
    assert all(
        x >= 5 and y >= 5 and x + w <= width - 5 and y + h <= height - 5 for x, y, w, h, _ in boxes
    )


def test_the_pdf_is_well_formed() -> None:
    data = pdf(lay_out("36h11", range(9), 0.15, "a4"), "a4")
    assert data.startswith(b"%PDF-1.")
    assert data == pdf(lay_out("36h11", range(9), 0.15, "a4"), "a4")
    assert b"/PrintScaling /None" in data
    start = int(data.rsplit(b"startxref\n", 1)[1].split()[0])
    entries = re.findall(rb"(\d{10}) \d{5} n ", data[start:])
    assert data[start:].startswith(b"xref\n0 %d\n" % (len(entries) + 1))
    for number, place in enumerate(entries, 1):
        assert data[int(place) :].startswith(b"%d 0 obj\n" % number)
    for match in re.finditer(rb"/Length (\d+)\s*>>\s*stream\r?\n", data):
        assert data[match.end() + int(match[1]) :].lstrip().startswith(b"endstream")
    assert len(streams(data)) == 9
    assert b"(36h11  id 8  150 mm) Tj" in data
    assert b"(8) Tj" in data


def test_a_png_says_its_resolution_and_is_the_page() -> None:
    (page,) = lay_out("36h11", [5], 0.1, "a4")
    data = png(page, "a4")
    at = data.index(b"pHYs")
    assert struct.unpack(">IIB", data[at + 4 : at + 13]) == (11811, 11811, 1)
    assert struct.unpack(">I", data[at + 13 : at + 17])[0] == zlib.crc32(data[at : at + 13])
    image = cv2.imdecode(numpy.frombuffer(data, numpy.uint8), cv2.IMREAD_GRAYSCALE)
    assert image.shape == (3508, 2480)
    assert found(image, "36h11").keys() == {5}


def test_the_command_writes_a_pdf_and_pages_of_png(tmp_path: Path) -> None:
    floor, pad = tmp_path / "floor.pdf", tmp_path / "pad.png"
    result = invoke(
        "tags", "--ids", "0-3,7", "--size", "19.5cm", "--paper", "a3", "--out", str(floor)
    )
    assert result.exit_code == 0, result.output
    assert f"wrote {floor}" in result.output
    assert len(streams(floor.read_bytes())) == 5
    result = invoke(
        "tags", "--ids", "0-12", "--size", "40 mm", "--family", "25h9", "--out", str(pad)
    )
    assert result.exit_code == 0, result.output
    assert sorted(p.name for p in tmp_path.glob("*.png")) == ["pad-1.png", "pad-2.png"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("--ids", "0-600", "--size", "4cm"),
            "`0-600` is not within 0 to 586, the tags of 36h11",
        ),
        (("--ids", "5-2", "--size", "4cm"), "`5-2` is not within 0 to 586"),
        (("--ids", "x", "--size", "4cm"), "`x` is neither a number nor a range such as 0-9"),
        (
            ("--ids", "0", "--size", "19.5cm"),
            "Invalid value for --paper: a tag of 195 mm takes 243.75 mm with its quiet zone, and A4"
            " has 194 mm to print on; use --paper a3 or a smaller --size",
        ),
        (
            ("--ids", "0", "--size", "1m"),
            "Invalid value for --size: a tag of 1 m takes 1.25 m with its quiet zone, and A4 has"
            " 194 mm to print on; use a smaller one",
        ),
        (
            ("--ids", "0", "--size", "5", "--paper", "a3"),
            "Invalid value for --size: a tag of 5 m takes 6.25 m with its quiet zone, and A3 has"
            " 281 mm to print on; a number without a unit is in metres; write 5cm",
        ),
        (
            (f"{MISSIONS}/courier.yaml",),
            "Invalid value for --paper: a tag of 195 mm takes 243.75 mm with its quiet zone, and A4"
            " has 194 mm to print on; use --paper a3",
        ),
        (("--ids", "0", "--size", "4deg"), "`4deg` is an angle, but a length is needed"),
        (("--ids", "0", "--size", "0"), "`0` is not above 0"),
        (
            ("--ids", "0", "--size", "4cm", "--family", "36h12"),
            "there is no family `36h12`; the families are",
        ),
        (("--ids", "0"), "give a MISSION, or --ids and --size"),
        ((f"{MISSIONS}/windy.yaml",), "has no tags; add them in `world: {tags: ...}`"),
        ((f"{MISSIONS}/courier.yaml", "--ids", "0"), "MISSION has tags of its own"),
    ],
)
def test_the_command_says_what_is_wrong(
    arguments: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    result = invoke("tags", *arguments, "--out", str(tmp_path / "x.pdf"))
    assert result.exit_code == 2
    assert message in " ".join(re.sub(r"[│\n]", " ", result.output).split())
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_only_what_it_can() -> None:
    result = invoke("tags", "--ids", "0", "--size", "4cm", "--out", "x.doc")
    assert result.exit_code == 2
    assert "doesn't end in .pdf or .png" in result.output
