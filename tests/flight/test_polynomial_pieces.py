"""Polynomial pieces, as uav_trajectories writes them, are flown as they are written."""

from __future__ import annotations

from hashlib import sha256
from math import cos, sin

import pytest

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.flight.trajectory import read_trajectory

POWERS = [f"{axis}^{power}" for axis in ("x", "y", "z", "yaw") for power in range(8)]
HEADER = ",".join(("duration", *POWERS))


def piece(duration: float, **axes: tuple[float, ...]) -> str:
    cells = [
        coefficient
        for axis in ("x", "y", "z", "yaw")
        for coefficient in (*axes.get(axis, ()), *[0.0] * 8)[:8]
    ]
    return ",".join(f"{cell:.6f}" for cell in (duration, *cells))


# p(s) = 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7 is at rest at 0 and 1, with p(1) = 1
REST_TO_REST = (0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0)
BACK = (1.0, 0.0, 0.0, 0.0, -35.0, 84.0, -70.0, 20.0)
LINES = [
    HEADER,
    piece(1.0, x=REST_TO_REST, z=(1.0,), yaw=(0.0, 0.5)),
    piece(1.0, x=BACK, y=REST_TO_REST, z=(1.0,), yaw=(0.5, 0.5)),
]


def trajectory(lines: list[str]):
    text = "\n".join(lines) + "\n"
    return read_trajectory(File("figure8.csv", sha256(text.encode()).hexdigest(), text))


def value(s: float) -> float:
    return 35 * s**4 - 84 * s**5 + 70 * s**6 - 20 * s**7


@pytest.mark.parametrize("first", [HEADER, f"# {HEADER}", HEADER.replace("duration", "Duration")])
def test_the_curve_is_that_of_the_polynomials(first: str) -> None:
    curve = trajectory([first, *LINES[1:]])
    assert curve.duration == 2.0
    for s in (0.0, 0.13, 0.37, 0.5, 0.77, 0.999):
        motion, heading, _ = curve.at(s)
        assert motion.position == pytest.approx((value(s), 0.0, 1.0), abs=1e-4)
        assert (cos(heading), sin(heading)) == pytest.approx((cos(0.5 * s), sin(0.5 * s)), abs=1e-2)
        motion, _, _ = curve.at(1.0 + s)
        assert motion.position == pytest.approx((1.0 - value(s), value(s), 1.0), abs=1e-4)
    assert curve.figures.speed == pytest.approx(35 / 16 * 2**0.5, rel=1e-2)
    assert curve.at(2.0)[1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("lines", "line", "message"),
    [
        (LINES[:1], 0, "it has no pieces"),
        ([HEADER.replace("z^0", "w^0"), *LINES[1:]], 1, "the column `z^0` is missing"),
        ([*LINES, "1,2"], 4, "2 values in a table of 33 columns"),
        ([*LINES, piece(0.0)], 4, "a piece lasts above 0 s and at most 3600 s"),
        ([*LINES, piece(1.0, z=(1.0,))], 4, "this piece does not begin where the one before ends"),
        ([*LINES, *[piece(3000.0, y=(1.0,), z=(1.0,))]], 4, "more than 20000 points, 0.1 s apart"),
        ([*LINES, LINES[1].replace("1.000000", "1_0", 1)], 4, "`1_0` has an underscore"),
    ],
)
def test_what_can_not_be_flown_is_refused_at_its_line(
    lines: list[str], line: int, message: str
) -> None:
    with pytest.raises(FileError) as caught:
        trajectory(lines)
    assert (str(caught.value), caught.value.line) == (message, line)
