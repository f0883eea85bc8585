"""Printed tags: where a grid puts them, what overlaps, and tables of them."""

from __future__ import annotations

import random
from math import pi, sqrt
from pathlib import Path

import pytest
from toolchain import result_of

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.core.geometry import LEVEL, from_euler, from_heading, rotate
from kybflow.dsl.checks.tags import overlap
from kybflow.dsl.expanding.world import tag_of, tags_of
from kybflow.dsl.world import GridParams, TagParams
from kybflow.vision.tags import FAMILIES, read_tags
from kybflow.world.tags import Tag, TagMap

HEAD = "family, id, size, x, y, z, heading [deg]\n"


def grid(**more: object) -> TagMap:
    facts = {"family": "36h11", "count": (3, 2), "size": 0.2, "spacing": 0.05, **more}
    return TagMap(tags_of(GridParams(**facts)))  # type: ignore[arg-type]


def place(tags: TagMap, number: int) -> tuple[float, ...]:
    tag = tags.get("36h11", number)
    assert tag is not None
    return tuple(round(value, 9) for value in tag.position)


def test_columns_go_along_x_and_rows_along_y() -> None:
    tags = grid(at=(1.0, 2.0, 0.0), first=10)
    assert len(tags) == 6
    assert [place(tags, n) for n in (10, 12, 13)] == [(1, 2, 0), (1.5, 2, 0), (1, 2.25, 0)]
    assert {tag.attitude for tag in tags} == {LEVEL}


def test_the_couriers_floor() -> None:
    """Its code: origin tag 0, x = +column, y = -row, 19.5 cm squares with 1.27 cm between."""
    tags = grid(count=(10, 10), size=0.195, spacing=0.0127, rows="down")
    assert place(tags, 37) == (round(7 * 0.2077, 9), round(-3 * 0.2077, 9), 0.0)


def test_the_heading_turns_the_whole_grid() -> None:
    tags = grid(at=(1.0, 2.0, 0.0), heading=pi / 2)
    assert [place(tags, n) for n in (1, 3)] == [(1, 2.25, 0), (0.75, 2, 0)]
    upper = rotate(next(iter(tags)).attitude, (0.0, 1.0, 0.0))
    assert upper == pytest.approx((-1.0, 0.0, 0.0))


def test_what_is_left_out_keeps_its_number_and_place() -> None:
    whole, less = grid(), grid(leave_out=(1, 4))
    assert [tag.id for tag in less] == [0, 2, 3, 5]
    assert place(less, 5) == place(whole, 5)


@pytest.mark.parametrize(
    ("facing", "out", "upper", "right"),
    [
        ("up", (0, 0, 1), (0, 1, 0), (1, 0, 0)),
        ("down", (0, 0, -1), (0, 1, 0), (-1, 0, 0)),
        ("east", (1, 0, 0), (0, 0, 1), (0, 1, 0)),
        ("north", (0, 1, 0), (0, 0, 1), (-1, 0, 0)),
        ("west", (-1, 0, 0), (0, 0, 1), (0, -1, 0)),
        ("south", (0, -1, 0), (0, 0, 1), (1, 0, 0)),
    ],
)
def test_where_the_printed_side_looks(facing: str, out: object, upper: object, right: object):
    facts = {"family": "36h11", "id": 1, "size": 0.1, "at": (0.0, 0.0, 1.0), "facing": facing}
    attitude = tag_of(TagParams(**facts)).attitude  # type: ignore[arg-type]
    assert rotate(attitude, (0.0, 0.0, 1.0)) == pytest.approx(out, abs=1e-12)
    assert rotate(attitude, (0.0, 1.0, 0.0)) == pytest.approx(upper, abs=1e-12)
    assert rotate(attitude, (1.0, 0.0, 0.0)) == pytest.approx(right, abs=1e-12)


def test_every_family_has_the_tags_that_it_says() -> None:
    cv2 = pytest.importorskip("cv2")
    for name, (theirs, count) in FAMILIES.items():
        whole = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, theirs))
        assert len(whole.bytesList) == count, name


def at(x: float, y: float, z: float = 0.0, size: float = 0.2, turned: float = 0.0) -> Tag:
    return Tag("36h11", 0, size, (x, y, z), from_heading(turned))


@pytest.mark.parametrize(
    ("other", "does"),
    [
        (at(0.19, 0.0), True),
        (at(0.2, 0.0), False),
        (at(0.2, 0.2), False),
        (at(0.19, 0.19), True),
        (at(0.0, 0.0, size=0.02), True),
        (at(0.1 * (1 + sqrt(2)) - 0.01, 0.0, turned=pi / 4), True),
        (at(0.1 * (1 + sqrt(2)) + 0.01, 0.0, turned=pi / 4), False),
        (at(0.18, 0.18, turned=pi / 4), False),
        (at(0.0, 0.0, 0.004), True),
        (at(0.0, 0.0, 0.1), False),
        (Tag("36h11", 0, 0.2, (0.0, 0.0, 0.0), from_euler(pi, 0.0, 0.0)), False),
        (Tag("36h11", 0, 0.2, (0.0, 0.0, 0.0), from_euler(pi / 2, 0.0, 0.0)), False),
    ],
)
def test_squares_overlap_on_one_plane_that_face_the_same_way(other: Tag, does: bool) -> None:
    assert overlap(at(0.0, 0.0), other) is does
    assert overlap(other, at(0.0, 0.0)) is does


def test_a_table_of_tags() -> None:
    text = (
        "# surveyed\nfamily, x, y, z, id, size [cm], heading [deg], roll [rad], pitch [deg]\n"
        f"\n36h11, 1, 2, 3, 5, 10, 90, 0, 0\naruco_4x4, 0, 0, 1, 999, 20, 0, {pi / 2}, 0\n"
    )
    first, second = read_tags(File("t.csv", "", text))
    assert first == (Tag("36h11", 5, 0.1, (1.0, 2.0, 3.0), from_heading(pi / 2)), 4)
    assert (second.tag.id, second.tag.size, second.line) == (999, 0.2, 5)
    assert rotate(second.tag.attitude, (0.0, 0.0, 1.0)) == pytest.approx((0, -1, 0), abs=1e-12)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("", 0, "it has no header"),
        (HEAD, 0, "it has no tags"),
        ("id, size\n1, 2\n", 1, "the column `family` is missing"),
        ("family, id, size, x, y, z, heading\n", 1, "`heading` needs a unit"),
        (HEAD + "36h12, 1, 0.1, 0, 0, 0, 0\n", 2, "`36h12` is not a family of tags"),
        (HEAD + "36h11, 587, 0.1, 0, 0, 0, 0\n", 2, "36h11 has no tag 587"),
        (HEAD + "36h11, 1.5, 0.1, 0, 0, 0, 0\n", 2, "36h11 has no tag 1.5"),
        (HEAD + "36h11, -1, 0.1, 0, 0, 0, 0\n", 2, "36h11 has no tag -1"),
        (HEAD + "36h11, 1, 0, 0, 0, 0, 0\n", 2, "`size` must be above 0 m and at most 10 m"),
        (HEAD + "36h11, 1, 1e9, 0, 0, 0, 0\n", 2, "`size` must be above 0 m and at most 10 m"),
        (HEAD + "36h11, 1, nan, 0, 0, 0, 0\n", 2, "`nan` is not finite"),
        (HEAD + "36h11, 1, 0.1, 0, 0, 0\n", 2, "6 values in a table of 7 columns"),
        (HEAD + 2 * "36h11, 1, 0.1, 0, 0, 0, 0\n", 3, "tag 1 of 36h11 is in line 2 already"),
    ],
)
def test_what_is_wrong_with_a_table(text: str, line: int, message: str) -> None:
    with pytest.raises(FileError) as caught:
        read_tags(File("t.csv", "", text))
    assert (str(caught.value), caught.value.line) == (message, line)


def test_overlaps_are_found_among_thousands(tmp_path: Path) -> None:
    """As many as comparing each with each finds, though it is done cell by cell."""
    generator = random.Random(1)

    def row(number: int) -> str:
        x, y = generator.uniform(0, 8), generator.uniform(0, 8)
        return f"36h10, {number}, 0.1, {x:.3f}, {y:.3f}, 0, {generator.uniform(0, 360):.1f}\n"

    (tmp_path / "tags.csv").write_text(HEAD + "".join(map(row, range(600))))
    mission = (
        "kybflow: 1\nmission: m\nimport: {std: kybflow/airframes}\n"
        "world: {tags: {lab: {file: tags.csv}}}\n"
        "vehicles: {a: {like: std.nano_plus, behaviors: {idle: {do: wait_on_ground}}}}\n"
    )
    text = (tmp_path / "tags.csv").read_text()
    tags = [row.tag for row in read_tags(File("t.csv", "", text))]
    count = sum(overlap(a, b) for i, a in enumerate(tags) for b in tags[i + 1 :])
    assert count > 100
    found = result_of(tmp_path / "m.yaml", mission).diagnostics
    (finding,) = (d for d in found if d.code == "KYB384")
    assert finding.label.endswith(f"; {count - 1} more pairs")
