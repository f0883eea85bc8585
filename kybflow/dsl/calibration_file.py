"""A camera calibration file in the format of ROS and OpenCV (YAML).

    image_width: 640
    image_height: 480
    camera_matrix: {rows: 3, cols: 3, data: [fx, 0, cx, 0, fy, cy, 0, 0, 1]}
    distortion_model: plumb_bob
    distortion_coefficients: {rows: 1, cols: 5, data: [k1, k2, p1, p2, k3]}

Other keys are ignored (`camera_info` has more). Reading errors are raised as FileError with the
line number.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import isfinite

from kybflow.core.errors import FileError, UnitError
from kybflow.core.files import File
from kybflow.core.units import parse_number
from kybflow.dsl.diagnostics import Collector
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, describe, items_of
from kybflow.dsl.reading.reader import compose
from kybflow.world.cameras import Lens

_TAGGED = "KYB008"
"""The code for OpenCV's `!!opencv-matrix` tag, which is ignored here."""
_MODELS = ("plumb_bob",)
_HINT = (
    "a calibration has `image_width`, `image_height`, `camera_matrix` and `distortion_coefficients`"
)


def read_calibration(file: File) -> Lens:
    """Return the lens that a calibration file describes. Raises FileError."""
    first, _, rest = file.text.partition("\n")
    text = f"\n{rest}" if first.startswith("%YAML") else file.text
    found = Collector()
    root = compose(text, file.name, found)
    for finding in found.all:
        if finding.code != _TAGGED:
            raise FileError(finding.message, finding.span.line)
    if not isinstance(root, Mapping):
        what = "nothing" if root is None else describe(root)
        raise FileError(f"a calibration is a mapping, but this is {what}", hint=_HINT)
    width, height = (_size(root, key) for key in ("image_width", "image_height"))
    matrix, line = _matrix(root, "camera_matrix")
    if len(matrix) != 9:
        raise FileError(f"`camera_matrix` has 9 numbers, not {len(matrix)}", line)
    fx, skew, cx, zero, fy, cy, *last = matrix
    if fx <= 0.0 or fy <= 0.0 or [skew, zero, *last] != [0.0, 0.0, 0.0, 0.0, 1.0]:
        raise FileError("`camera_matrix` is not [fx, 0, cx, 0, fy, cy, 0, 0, 1]", line)
    if not (0.0 < cx < width and 0.0 < cy < height):
        raise FileError(f"the lens looks past its image of {width} x {height}", line)
    return Lens(width, height, fx, fy, cx, cy, _distortion(root))


def write_calibration(lens: Lens) -> str:
    """Return the text of a calibration file that describes a lens."""
    matrix = (lens.fx, 0.0, lens.cx, 0.0, lens.fy, lens.cy, 0.0, 0.0, 1.0)
    return (
        f"image_width: {lens.width}\n"
        f"image_height: {lens.height}\n"
        f"camera_matrix: {_written(3, 3, matrix)}\n"
        "distortion_model: plumb_bob\n"
        f"distortion_coefficients: {_written(1, 5, lens.distortion)}\n"
    )


def _written(rows: int, columns: int, numbers: Iterable[float]) -> str:
    data = ", ".join(f"{number:.8g}" for number in numbers)
    return f"{{rows: {rows}, cols: {columns}, data: [{data}]}}"


def _distortion(root: Mapping) -> tuple[float, float, float, float, float]:
    model = root.get("distortion_model")
    if isinstance(model, Scalar) and model.text not in _MODELS:
        message = f"the distortion model `{model.text[:40]}` is not known"
        raise FileError(message, model.span.line, "calibrate with `plumb_bob`: k1, k2, p1, p2, k3")
    numbers, line = _matrix(root, "distortion_coefficients")
    if any(number != 0.0 for number in numbers[5:]):
        raise FileError(f"{len(numbers)} coefficients of distortion; 5 are known", line)
    k1, k2, p1, p2, k3 = (*numbers, 0.0, 0.0, 0.0, 0.0, 0.0)[:5]
    return k1, k2, p1, p2, k3


def _size(root: Mapping, key: str) -> int:
    node = _needed(root, key)
    (number,) = _numbers(node, key) if isinstance(node, Scalar) else (0.0,)
    if not (number.is_integer() and 1 <= number <= 20_000):
        raise FileError(f"`{key}` must be a number of pixels", node.span.line)
    return int(number)


def _matrix(root: Mapping, key: str) -> tuple[tuple[float, ...], int]:
    """Return the numbers of a matrix, row by row, and their line number."""
    node = _needed(root, key)
    if isinstance(node, Mapping):
        node = _needed(node, "data")
    return tuple(_numbers(node, key)), node.span.line


def _needed(root: Mapping, key: str) -> Node:
    node = root.get(key)
    if node is None:
        raise FileError(f"`{key}` is missing", root.span.line if key == "data" else 0, _HINT)
    return node


def _numbers(node: Node, key: str) -> Iterator[float]:
    """Yield the numbers of a scalar, a list, or a list of rows."""
    if not isinstance(node, Scalar):
        for item in items_of(node):
            yield from _numbers(item, key)
        return
    try:
        value = parse_number(node.text)
    except UnitError as error:
        message = f"`{node.text[:20]}` in `{key}` is not a number"
        raise FileError(message, node.span.line, error.hint) from None
    if not isfinite(value):
        raise FileError(f"`{node.text}` in `{key}` is not finite", node.span.line)
    yield value
