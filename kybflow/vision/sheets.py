"""Printable sheets of tags, true to scale, as a vector PDF or as PNG pages.

Each tag has a quiet zone of one cell with a fine cutting line around it. Its family, number and
side are printed below the quiet zone. Inside the cutting line, an arrow above the black square and
the number below it remain after cutting. They leave the smallest recommended gap between tags free,
and stay away from the corners, which detectors refine. Each page has a bar of 100 mm to check the
scale. Coordinates are millimetres from the lower left corner of the page, y up.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Sequence
from io import BytesIO
from itertools import groupby
from typing import NamedTuple

import cv2
import numpy
from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import FILL_NON_ZERO, Canvas

from kybflow.vision.projection import Array
from kybflow.vision.rendering.floor import QUIET_ZONE
from kybflow.vision.tags import cells, pattern

PAPERS = {"a4": (210.0, 297.0), "a3": (297.0, 420.0)}
_MARGIN, _GAP, _LABEL, _FOOT = 8.0, 3.0, 5.0, 12.0
_LINE = 0.15
_LETTERS = 3.0
"""Height of letters, mm."""
_BAR = 100.0
_MIN_QUIET_ZONE = 5.0
"""Smallest width of the quiet zone that remains after cutting between neighbours, mm."""
_MARK, _RIM, _ALONG = 0.4, 0.08, 0.25
"""Height of a number or arrow in the quiet zone and its distance from the cut, as fractions of the
remaining width of the zone; and where it starts along the side, as a fraction of the side."""
_DIGIT = 0.72
"""Height of a digit, as a fraction of the letters' height."""


class Rectangle(NamedTuple):
    """A filled rectangle with its lower left corner at (x, y). grey: from 0 (black) to 1
    (white)."""

    x: float
    y: float
    width: float
    height: float
    grey: float


class Words(NamedTuple):
    """A line of text that starts at (x, y)."""

    x: float
    y: float
    height: float
    text: str


class Arrow(NamedTuple):
    """A black arrow that points up from (x, y)."""

    x: float
    y: float
    height: float

    def outline(self) -> list[tuple[float, float]]:
        """Return the arrow's corners. Its tail is a fifth of its height wide, its head four
        fifths."""
        tail = ((0.1, 0.0), (0.1, 0.45), (0.4, 0.45))
        right = [(self.x + a * self.height, self.y + b * self.height) for a, b in tail]
        left = [(2.0 * self.x - x, y) for x, y in reversed(right)]
        return [*right, (self.x, self.y + self.height), *left]


class Page(NamedTuple):
    boxes: tuple[Rectangle, ...]
    words: tuple[Words, ...]
    arrows: tuple[Arrow, ...]


def lay_out(family: str, ids: Sequence[int], size: float, paper: str) -> list[Page]:
    """Return pages with tags of a family, as many on each page as fit. Raises ValueError if not
    even one fits. size: side of a tag, metres."""
    width, height = PAPERS[paper]
    side = 1000.0 * size
    whole = side * (1.0 + 2.0 * QUIET_ZONE / cells(family))
    columns = int((width - 2.0 * _MARGIN + _GAP) / (whole + _GAP))
    rows = int((height - 2.0 * _MARGIN - _FOOT + _GAP) / (whole + _LABEL + _GAP))
    if columns < 1 or rows < 1:
        raise ValueError(
            f"a tag of {in_words(size)} takes {in_words(whole / 1000.0)} with its quiet zone, and"
            f" {paper.upper()} has {width - 2.0 * _MARGIN:g} mm to print on"
        )
    tall = min(_LETTERS, whole / 15.0)
    ticks = (Rectangle(x, _MARGIN, 0.3, 4.0, 0.0) for x in (_MARGIN, _MARGIN + _BAR - 0.3))
    bar = (Rectangle(_MARGIN, _MARGIN + 1.85, _BAR, 0.3, 0.0), *ticks)
    print_at = f"{_BAR:g} mm; print on {paper.upper()} at 100 %, not fitted"
    caption = Words(_MARGIN + _BAR + 2.0, _MARGIN + 0.5, _LETTERS, print_at)
    pages = []
    for first in range(0, len(ids), columns * rows):
        boxes, words, arrows = list(bar), [caption], []
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


def in_words(metres: float) -> str:
    """Return a length as text: in metres from 1 m on, otherwise in millimetres."""
    return f"{metres:g} m" if metres >= 1.0 else f"{1000.0 * metres:g} mm"


def _marks(number: int, x: float, y: float, side: float, whole: float) -> tuple[Words, Arrow]:
    """Return the number below a tag's black square and the arrow above it. (x, y): the corner of
    the quiet zone, in which both lie."""
    rim = 0.5 * (whole - side)
    left = min(_MIN_QUIET_ZONE, rim - _LINE)
    low, tall = (1.0 - _MARK - _RIM) * left, _MARK * left
    along = x + rim + _ALONG * side
    mark = Words(along, y + rim - low - tall, tall / _DIGIT, str(number))
    return mark, Arrow(along, y + rim + side + low, tall)


def _tag(
    family: str, number: int, x: float, y: float, side: float, whole: float
) -> list[Rectangle]:
    """Return the rectangles of a tag: its cutting line, its black square, and its white cells, with
    neighbours in a row joined."""
    picture = pattern(family, number)
    rim, cell = 0.5 * (whole - side), side / len(picture)
    boxes = [
        Rectangle(x, y, whole, whole, 0.6),
        Rectangle(x + _LINE, y + _LINE, whole - 2.0 * _LINE, whole - 2.0 * _LINE, 1.0),
        Rectangle(x + rim, y + rim, side, side, 0.0),
    ]
    for row, line in enumerate(picture > 0):
        ends = numpy.flatnonzero(numpy.diff(line.astype(int), prepend=0, append=0)).tolist()
        low = y + rim + side - (row + 1) * cell
        boxes += [
            Rectangle(x + rim + first * cell, low, (last - first) * cell, cell, 1.0)
            for first, last in zip(ends[::2], ends[1::2], strict=True)
        ]
    return boxes


def pdf(pages: Iterable[Page], paper: str) -> bytes:
    """Return the pages as a PDF that is the same in every run. Consecutive boxes of the same grey
    form one path, so that no seams show between cells."""
    out = BytesIO()
    size = [length * mm for length in PAPERS[paper]]
    canvas = Canvas(out, pagesize=size, invariant=1, pageCompression=0)
    canvas.setViewerPreference("PrintScaling", "None")
    for page in pages:
        for grey, boxes in groupby(page.boxes, key=lambda box: box.grey):
            path = canvas.beginPath()
            for box in boxes:
                path.rect(*(length * mm for length in box[:4]))
            canvas.setFillGray(grey)
            canvas.drawPath(path, stroke=0, fill=1, fillMode=FILL_NON_ZERO)
        canvas.setFillGray(0.0)
        for arrow in page.arrows:
            path = canvas.beginPath()
            for n, (x, y) in enumerate(arrow.outline()):
                (path.lineTo if n else path.moveTo)(x * mm, y * mm)
            canvas.drawPath(path, stroke=0, fill=1)
        for words in page.words:
            canvas.setFont("Helvetica", words.height * mm)
            canvas.drawString(words.x * mm, words.y * mm, words.text)
        canvas.showPage()
    canvas.save()
    return out.getvalue()


def png(page: Page, paper: str, dpi: int = 300) -> bytes:
    """Return a page as a grey PNG that states its resolution."""
    drawn = raster(page, paper, dpi)
    data: bytes = cv2.imencode(".png", drawn)[1].tobytes()
    # insert pHYs, pixels a metre, after the signature and the header
    body = b"pHYs" + struct.pack(">IIB", *[round(dpi / 0.0254)] * 2, 1)
    chunk = struct.pack(">I", 9) + body + struct.pack(">I", zlib.crc32(body))
    header = 8 + 25
    return data[:header] + chunk + data[header:]


def raster(page: Page, paper: str, dpi: int) -> Array:
    """Return a page as pixels, with each edge rounded to the nearest pixel: (height, width)
    uint8."""
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
