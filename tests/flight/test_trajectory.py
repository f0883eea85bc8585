"""Trajectories from a file: what a table may say, and the curve through it."""

import contextlib
import math
from itertools import pairwise
from math import cos, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.core.geometry import ZERO, dot, norm, scale, sub
from kybflow.flight.trajectory import Knot, Quintic, Trajectory, read_table, read_trajectory, slopes

PLAIN = "t, x, y, z\n0, 0, 0, 1\n1, 0.5, 0, 1\n2.5, 1, 0.5, 1.2\n4, 1, 1, 1\n"


def file(text: str) -> File:
    return File("way.csv", str(hash(text)), text)


def curve(text: str) -> Trajectory:
    return read_trajectory(file(text))


def refusal(text: str) -> tuple[str, int]:
    with pytest.raises(FileError) as caught:
        read_trajectory(file(text))
    return str(caught.value), caught.value.line


@pytest.mark.parametrize(
    ("text", "message", "line"),
    [
        ("", "it has no header", 0),
        ("# nothing\n\n", "it has no header", 0),
        ("0, 0, 0, 1\n", "it has no header", 1),
        ("t, x, y\n0, 0, 0\n", "the column `z` is missing", 1),
        ("t, x, x, y, z\n", "the column `x` occurs twice", 1),
        ("t, x, y, z, vx\n", "the column `vy` is missing", 1),
        (
            "t, x, y, z, ax, ay, az\n",
            "accelerations need the velocities `vx`, `vy`, `vz` beside them",
            1,
        ),
        ("t, x, y, z, yaw\n", "`yaw` needs a unit", 1),
        ("t, x [s], y, z\n", "`s` is not a unit of length", 1),
        ("t, x, y, z\n0, 0, 0, 1\n", "a trajectory has at least two rows", 0),
        ("t, x, y, z\n0, 0, 0, 1\n\n1, 0, 0\n", "3 values in a table of 4 columns", 4),
        ("t, x, y, z\n0, 0, 0, one\n", "`one` is not a number", 2),
        ("t, x, y, z\n0, 0, 0, nan\n", "`nan` is not finite", 2),
        (
            "t, x, y, z\n0, 0, 0, 1\n# later\n0, 1, 0, 1\n",
            "the time does not increase: 0 s after 0 s",
            4,
        ),
        (
            "t, x, y, z, vx, vy, vz\n0, 0, 0, 1, 0.4, 0, 0\n1, 0.4, 0, 1, 0, 0, 0\n",
            "it begins with 0.4 m/s",
            2,
        ),
        (
            "t, x, y, z, vx, vy, vz\n0, 0, 0, 1, 0, 0, 0\n1, 0.2, 0, 1, 0.4, 0, 0\n",
            "it ends with 0.4 m/s",
            3,
        ),
        (
            "t, x, y, z, vx, vy, vz\n0,0,0,1,0,0,0\n1,0.5,0,1,50,0,0\n2,1,0,1,0,0,0\n",
            "from the row before it moves 0.5 m/s, but its velocity is 25 m/s",
            3,
        ),
    ],
)
def test_a_table_that_can_not_be_flown_is_refused_at_its_line(text, message, line) -> None:
    assert refusal(text) == (message, line)


@given(st.text(max_size=300))
def test_whatever_it_holds_it_is_read_or_refused(text: str) -> None:
    for whole in (text, "t, x, y, z\n" + text):
        with contextlib.suppress(FileError):
            assert len(read_table(whole)) >= 2


def test_units_stand_in_the_header_and_the_order_is_free() -> None:
    text = "yaw [deg], z [cm], y, x [mm], t [ms]\n90, 120, 0.5, 1000, 5000\n90, 120, 0.5, 0, 9000\n"
    way = curve(text)
    motion, heading, _ = way.at(0.0)
    assert motion.position == pytest.approx((1.0, 0.5, 1.2))
    assert heading == pytest.approx(math.pi / 2)
    assert way.duration == pytest.approx(4.0)


def test_it_goes_through_its_rows_and_rests_at_both_ends() -> None:
    way = curve(PLAIN)
    for row in read_table(PLAIN):
        assert way.at(row.time)[0].position == pytest.approx(row.position, abs=1e-12)
    for end in (0.0, way.duration - 1e-9):
        motion, _, _ = way.at(end)
        assert norm(motion.velocity) < 1e-6
        assert norm(motion.acceleration) < 1e-6
    assert way.at(99.0)[0].position == way.end == (1.0, 1.0, 1.0)


@st.composite
def tables(draw):
    rows, time = [], 0.0
    for _ in range(draw(st.integers(2, 12))):
        x, y, z = (draw(st.floats(-2.0, 2.0)) for _ in range(3))
        rows.append(f"{time!r}, {x!r}, {y!r}, {z!r}, {draw(st.floats(-400.0, 400.0))!r}")
        time += draw(st.floats(0.1, 3.0))
    return "t, x, y, z, yaw [deg]\n" + "\n".join(rows)


@settings(max_examples=15)
@given(tables())
def test_it_has_no_step_up_to_the_acceleration(text: str) -> None:
    way, tiny = curve(text), 1e-6
    for row in read_table(text)[1:-1]:
        (before, turned, rate), (after, turns, rates) = way.at(row.time - tiny), way.at(row.time)
        for left, right in zip(before[:3], after[:3], strict=True):
            assert norm(sub(left, right)) <= 1e-3 * (1.0 + norm(after.jerk) + norm(before.jerk))
        assert turned == pytest.approx(turns, abs=1e-3)
        assert rate == pytest.approx(rates, abs=1e-2)


@settings(max_examples=6)
@given(tables())
def test_its_figures_bound_what_it_flies_and_its_points_are_its_path(text: str) -> None:
    way = curve(text)
    figures = way.figures
    points = [point for point, _ in figures.points]
    for i in range(200):
        motion, _, _ = way.at(way.duration * i / 199)
        assert norm(motion.velocity) <= figures.speed * 1.01 + 0.01
        assert math.hypot(*motion.acceleration[:2]) <= figures.acceleration * 1.05 + 0.05
        assert off(motion.position, points) < 0.03
    assert points[0] == way.start
    assert points[-1] == way.end


def off(p, points) -> float:
    """From the polyline through `points`."""
    best = math.inf
    for a, b in pairwise(points):
        way, to = sub(b, a), sub(p, a)
        along = dot(way, to) / dot(way, way) if dot(way, way) else 0.0
        best = min(best, norm(sub(to, scale(way, min(max(along, 0.0), 1.0)))))
    return best


def test_stated_velocities_and_accelerations_are_flown() -> None:
    rows, k = [], math.pi / 2.0
    for t in (0.1 * i for i in range(41)):
        x, v = 0.3 * (1.0 - math.cos(k * t)), 0.3 * k * math.sin(k * t)
        rows.append(f"{t}, {x}, 0, 1, {v}, 0, 0, {0.3 * k * k * math.cos(k * t)}, 0, 0")
    way = curve("t, x, y, z, vx, vy, vz, ax, ay, az\n" + "\n".join(rows))
    for i in range(400):
        t = 0.01 * i
        motion, heading, rate = way.at(t)
        assert motion.position[0] == pytest.approx(0.3 * (1 - math.cos(k * t)), abs=1e-7)
        assert motion.velocity[0] == pytest.approx(0.3 * k * math.sin(k * t), abs=1e-5)
        assert motion.acceleration[0] == pytest.approx(0.3 * k * k * math.cos(k * t), abs=1e-3)
        assert motion.jerk[0] == pytest.approx(-0.3 * k**3 * math.sin(k * t), abs=0.05)
        assert (heading, rate) == (None, 0.0)


def test_headings_turn_the_shorter_way() -> None:
    way = curve("t, x, y, z, yaw [deg]\n0,0,0,1,170\n2,0,0,1,-170\n4,0,0,1,170\n")
    headings = [way.at(0.05 * i)[1] for i in range(81)]
    assert min(headings) == pytest.approx(math.radians(170.0))
    assert max(headings) == pytest.approx(math.radians(190.0))
    assert way.at(1.0)[2] > 0.0


def test_resting_rows_stay_where_they_are() -> None:
    way = curve("t, x, y, z\n0, 1, 2, 3\n5, 1, 2, 3\n")
    assert way.at(2.0)[0][:2] == ((1.0, 2.0, 3.0), ZERO)
    assert way.figures.speed == 0.0


def test_a_trajectory_of_years_is_judged_soon() -> None:
    way = curve("t, x, y, z\n0, 0, 0, 1\n1e9, 1, 0, 1\n")
    assert len(way.figures.points) < 30_000


numbers = st.floats(-5.0, 5.0)
knots = st.builds(Knot, numbers, numbers, numbers)


@given(knots, knots, st.floats(0.05, 10.0))
def test_a_piece_goes_through_both_knots_with_their_derivatives(a: Knot, b: Knot, h: float) -> None:
    piece = Quintic.between(a, b, h)
    assert piece.at(0.0)[:3] == pytest.approx(a)
    scale = 1.0 + max(map(abs, (*a, *b))) * (1.0 + 1.0 / h**2)
    assert piece.at(h)[:3] == pytest.approx(b, abs=1e-10 * scale)


@given(knots, knots, st.floats(0.2, 5.0), st.floats(0.1, 0.9))
def test_what_it_gives_are_each_others_derivatives(a: Knot, b: Knot, h: float, at: float) -> None:
    piece, s, d = Quintic.between(a, b, h), at * h, 1e-5 * h
    before, here, after = piece.at(s - d), piece.at(s), piece.at(s + d)
    for order in range(3):
        slope = (after[order] - before[order]) / (2.0 * d)
        scale = 1.0 + max(abs(x) for x in (*before, *after)) / h
        assert slope == pytest.approx(here[order + 1], abs=1e-4 * scale)


def test_a_quintic_is_met_exactly() -> None:
    def curve(t: float) -> Knot:
        return Knot(t**5 - 2.0 * t**3, 5.0 * t**4 - 6.0 * t**2, 20.0 * t**3 - 12.0 * t)

    piece = Quintic.between(curve(-1.0), curve(1.5), 2.5)
    for t in (-0.5, 0.0, 0.7, 1.2):
        assert piece.at(t + 1.0)[0] == pytest.approx(curve(t).value)


def test_slopes_are_those_of_a_smooth_curve_and_zero_at_the_ends() -> None:
    times = [0.05 * i + 0.01 * (i % 3) for i in range(60)]
    end = times[-1]
    values = [cos(6.0 * t / end * 3.141592653589793) for t in times]
    found = slopes(times, values)
    k = 6.0 / end * 3.141592653589793
    for t, slope in list(zip(times, found, strict=True))[2:-2]:
        assert slope == pytest.approx(-k * sin(k * t), abs=0.02 * k)
    assert (found[0], found[-1]) == (0.0, 0.0)


def test_two_values_are_left_and_reached_at_rest() -> None:
    assert slopes([0.0, 1.0], [3.0, 4.0]) == [0.0, 0.0]


@given(st.lists(st.tuples(st.floats(0.01, 2.0), numbers), min_size=3, max_size=30))
def test_the_spline_of_its_slopes_has_no_step_in_the_second_derivative(steps) -> None:
    times = [sum(h for h, _ in steps[: i + 1]) for i in range(len(steps))]
    values = [value for _, value in steps]
    found = slopes(times, values)
    rows = list(zip(times, values, found, strict=True))
    bends = []
    for (t, p, v), (u, q, w) in pairwise(rows):
        h = u - t
        bends.append(((6.0 * (q - p) / h - 4.0 * v - 2.0 * w) / h, h))
        bends.append(((-6.0 * (q - p) / h + 2.0 * v + 4.0 * w) / h, h))
    for (left, h), (right, g) in zip(bends[1:-1:2], bends[2::2], strict=True):
        assert left == pytest.approx(right, abs=1e-6 * (1.0 + 1.0 / h**2 + 1.0 / g**2) * 100.0)
