"""Sheets of tags to print, true to scale: a PDF of plain vector operators, or PNG pages.

Each tag stands in its quiet zone of one cell, with a fine line to cut along, and its family, number
and side below that. What stays when it is cut, even between neighbours: an arrow above it and its
number below, as far from the black square as the least gap allows that the floor's page advises,
and away from its corners, which a detector refines. Each page has a bar of 100 mm to hold a ruler
to. Lengths here are millimetres, from the lower left corner of the page, y up.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import cv2
import numpy

from kybflow.vision.families import cells, pattern
from kybflow.vision.printing.floor import QUIET
from kybflow.vision.projection import Array

PAPERS = {"a4": (210.0, 297.0), "a3": (297.0, 420.0)}
_MARGIN, _GAP, _LABEL, _FOOT = 8.0, 3.0, 5.0, 12.0
_LINE = 0.15
_LETTERS = 3.0
"""Height of letters."""
_BAR = 100.0
_LEFT = 5.0
"""What is left of the quiet zone at the least when it is cut between neighbours."""
_MARK, _RIM, _ALONG = 0.4, 0.08, 0.25
"""Height of a number or an arrow in the quiet zone, and how far it is from the cut, of what is
left; where it begins, of the side."""
_DIGIT = 0.72
"""Height of a digit, of the letters'."""


class Box(NamedTuple):
    """A rectangle with its lower left corner at (x, y), filled with a grey, 0 black to 1 white."""

    x: float
    y: float
    width: float
    height: float
    grey: float


class Words(NamedTuple):
    """A line of text that begins at (x, y), its letters `height` tall."""

    x: float
    y: float
    height: float
    text: str


class Arrow(NamedTuple):
    """A black arrow that points up, the middle of its tail's end at (x, y)."""

    x: float
    y: float
    height: float

    def outline(self) -> list[tuple[float, float]]:
        """Its corners: a tail of a fifth, a head of four fifths of its height across."""
        tail = ((0.1, 0.0), (0.1, 0.45), (0.4, 0.45))
        right = [(self.x + a * self.height, self.y + b * self.height) for a, b in tail]
        left = [(2.0 * self.x - x, y) for x, y in reversed(right)]
        return [*right, (self.x, self.y + self.height), *left]


class Page(NamedTuple):
    boxes: tuple[Box, ...]
    words: tuple[Words, ...]
    arrows: tuple[Arrow, ...]


def lay_out(family: str, ids: Sequence[int], size: float, paper: str) -> list[Page]:
    """Pages with the tags of a family, `size` metres a side, as many on each as fit. Raises
    ValueError where not even one fits."""
    width, height = PAPERS[paper]
    side = 1000.0 * size
    whole = side * (1.0 + 2.0 * QUIET / cells(family))
    columns = int((width - 2.0 * _MARGIN + _GAP) / (whole + _GAP))
    rows = int((height - 2.0 * _MARGIN - _FOOT + _GAP) / (whole + _LABEL + _GAP))
    if columns < 1 or rows < 1:
        raise ValueError(
            f"a tag of {spoken(size)} takes {spoken(whole / 1000.0)} with its quiet zone, and"
            f" {paper.upper()} has {width - 2.0 * _MARGIN:g} mm to print on"
        )
    tall = min(_LETTERS, whole / 15.0)
    pages = []
    for first in range(0, len(ids), columns * rows):
        boxes, words, arrows = list(_bar()), [_caption(paper)], []
        for place, number in enumerate(ids[first : first + columns * rows]):
            x = _MARGIN + (place % columns) * (whole + _GAP)
            y = height - _MARGIN - whole - (place // columns) * (whole + _LABEL + _GAP)
            boxes += _tag(family, number, x, y, side, whole)
            text = f"{family}  id {number}  {side:g} mm"
            words.append(Words(x, y - tall - 0.5, tall, text))
            mark, arrow = _marks(number, x, y, side, whole)
            words.append(mark)
            arrows.append(arrow)
        pages.append(Page(tuple(boxes), tuple(words), tuple(arrows)))
    return pages


def spoken(metres: float) -> str:
    """A length in words: metres from one on, else millimetres."""
    return f"{metres:g} m" if metres >= 1.0 else f"{1000.0 * metres:g} mm"


def _marks(number: int, x: float, y: float, side: float, whole: float) -> tuple[Words, Arrow]:
    """A tag's number below its black square and an arrow above, in the quiet zone, which begins at
    (x, y)."""
    rim = 0.5 * (whole - side)
    left = min(_LEFT, rim - _LINE)
    low, tall = (1.0 - _MARK - _RIM) * left, _MARK * left
    along = x + rim + _ALONG * side
    mark = Words(along, y + rim - low - tall, tall / _DIGIT, str(number))
    return mark, Arrow(along, y + rim + side + low, tall)


def _tag(family: str, number: int, x: float, y: float, side: float, whole: float) -> list[Box]:
    """The black square with its white cells, joined along rows, in a line to cut along."""
    picture = pattern(family, number)
    rim, cell = 0.5 * (whole - side), side / len(picture)
    boxes = [
        Box(x, y, whole, whole, 0.6),
        Box(x + _LINE, y + _LINE, whole - 2.0 * _LINE, whole - 2.0 * _LINE, 1.0),
        Box(x + rim, y + rim, side, side, 0.0),
    ]
    for row, line in enumerate(picture > 0):
        ends = numpy.flatnonzero(numpy.diff(line.astype(int), prepend=0, append=0)).tolist()
        low = y + rim + side - (row + 1) * cell
        boxes += [
            Box(x + rim + first * cell, low, (last - first) * cell, cell, 1.0)
            for first, last in zip(ends[::2], ends[1::2], strict=True)
        ]
    return boxes


def _bar() -> tuple[Box, ...]:
    ends = (_MARGIN, _MARGIN + _BAR - 0.3)
    ticks = tuple(Box(x, _MARGIN, 0.3, 4.0, 0.0) for x in ends)
    return (Box(_MARGIN, _MARGIN + 1.85, _BAR, 0.3, 0.0), *ticks)


def _caption(paper: str) -> Words:
    text = f"{_BAR:g} mm; print on {paper.upper()} at 100 %, not fitted"
    return Words(_MARGIN + _BAR + 2.0, _MARGIN + 0.5, _LETTERS, text)


_POINTS = 72.0 / 25.4


def pdf(pages: Iterable[Page], paper: str) -> bytes:
    """The pages as a PDF (ISO 32000-1): filled rectangles and Helvetica, which every reader has."""
    width, height = (length * _POINTS for length in PAPERS[paper])
    streams = [_operators(page) for page in pages]
    kids = " ".join(f"{4 + 2 * i} 0 R" for i in range(len(streams)))
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {len(streams)} >>".encode(),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    for i, stream in enumerate(streams):
        objects.append(
            f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.4f} {height:.4f}]"
            f" /Resources << /Font << /F 3 0 R >> >> /Contents {5 + 2 * i} 0 R >>".encode()
        )
        objects.append(b"<< /Length %d >>\nstream\n%s\nendstream" % (len(stream), stream))
    return _file(objects)


def _operators(page: Page) -> bytes:
    """In millimetres: the first operator scales them to points. Boxes of one grey that follow each
    other are one path, so that no seam shows between cells."""
    lines = [f"{_POINTS:.10f} 0 0 {_POINTS:.10f} 0 0 cm"]
    for i, box in enumerate(page.boxes):
        if i == 0 or page.boxes[i - 1].grey != box.grey:
            lines += ["f"] if i else []
            lines.append(f"{box.grey:g} g")
        lines.append(f"{box.x:.6f} {box.y:.6f} {box.width:.6f} {box.height:.6f} re")
    lines += ["f", "0 g"]
    for arrow in page.arrows:
        (x, y), *others = arrow.outline()
        lines += [f"{x:.4f} {y:.4f} m", *(f"{x:.4f} {y:.4f} l" for x, y in others), "h f"]
    for words in page.words:
        text = words.text.replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)")
        lines.append(f"BT /F {words.height:.4f} Tf {words.x:.4f} {words.y:.4f} Td ({text}) Tj ET")
    return "\n".join(lines).encode("ascii")


def _file(objects: Sequence[bytes]) -> bytes:
    """Numbered objects, the table of where they begin, the trailer."""
    out, places = bytearray(b"%PDF-1.4\n"), []
    for i, body in enumerate(objects):
        places.append(len(out))
        out += b"%d 0 obj\n%s\nendobj\n" % (i + 1, body)
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    count, start = len(objects) + 1, len(out)
    out += f"xref\n0 {count}\n0000000000 65535 f \n{table}".encode()
    out += f"trailer\n<< /Size {count} /Root 1 0 R >>\nstartxref\n{start}\n%%EOF\n".encode()
    return bytes(out)


def png(page: Page, paper: str, dpi: int = 300) -> bytes:
    """A page as a grey PNG that says its resolution."""
    drawn = raster(page, paper, dpi)
    data: bytes = cv2.imencode(".png", drawn)[1].tobytes()
    # after the signature and the header: pHYs, pixels a metre
    body = b"pHYs" + struct.pack(">IIB", *[round(dpi / 0.0254)] * 2, 1)
    chunk = struct.pack(">I", 9) + body + struct.pack(">I", zlib.crc32(body))
    header = 8 + 25
    return data[:header] + chunk + data[header:]


def raster(page: Page, paper: str, dpi: int) -> Array:
    """A page as pixels; each edge on the nearest one."""
    width, height = PAPERS[paper]
    scale = dpi / 25.4
    drawn = numpy.full((round(height * scale), round(width * scale)), 255, numpy.uint8)
    for box in page.boxes:
        left, right = round(box.x * scale), round((box.x + box.width) * scale)
        top, bottom = (round((height - y) * scale) for y in (box.y + box.height, box.y))
        drawn[top:bottom, left:right] = round(255.0 * box.grey)
    for arrow in page.arrows:
        corners = numpy.array([(x * scale, (height - y) * scale) for x, y in arrow.outline()])
        cv2.fillPoly(drawn, [(16.0 * corners).round().astype(numpy.int32)], 0, cv2.LINE_AA, 4)
    for words in page.words:
        at = (round(words.x * scale), round((height - words.y) * scale))
        tall = words.height * scale / 30.0
        thick = max(1, round(0.1 * words.height * scale))
        cv2.putText(drawn, words.text, at, cv2.FONT_HERSHEY_SIMPLEX, tall, 0, thick, cv2.LINE_AA)
    return drawn
