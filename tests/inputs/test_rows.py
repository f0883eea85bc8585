"""Rows of what an input said: read, written and read back, and refused with their line."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kybflow.core.errors import FileError
from kybflow.core.signals import NS
from kybflow.inputs.rows import InputRow, head, line, parse
from kybflow.inputs.script import RowsLink

AXES = ("x", "turn")
NAMES = st.frozensets(
    st.from_regex(r"[A-Z_\u00e4\u0436][a-z0-9_\u00e4\u7121]{0,8}", fullmatch=True), max_size=3
)
VALUES = st.floats(-1.0, 1.0)
SPOKEN = st.builds(
    lambda x, turn, held: (dict(zip(AXES, (x, turn), strict=True)), held, ""),
    VALUES, VALUES, NAMES,
)  # fmt: skip
WORDS = st.from_regex(r"[A-Za-z]{1,9}( [A-Za-z`.]{1,9})?", fullmatch=True)
SILENT = st.builds(lambda why: ({}, frozenset(), why), WORDS)


@settings(max_examples=30)
@given(st.dictionaries(st.integers(0, 150_000), st.one_of(SPOKEN, SILENT), min_size=1))
def test_what_is_written_reads_back_to_the_tick(told: dict[int, tuple[object, ...]]) -> None:
    rows = tuple(InputRow(tick * NS // 250, *told[tick]) for tick in sorted(told))  # type: ignore[arg-type]
    text = head(AXES) + "".join(line(row, AXES) for row in rows)
    assert rows == parse(text).rows


def test_an_axis_may_be_no_number() -> None:
    [row] = parse("t, x\n0, nan").rows
    assert math.isnan(row.axes["x"])


def test_columns_and_buttons_are_named() -> None:
    said = parse("t, x, buttons\n0, 0, \n1, 0.5, hold go\n")
    assert said.axes == ("x",)
    assert said.buttons == ("go", "hold")


@pytest.mark.parametrize(
    ("text", "number", "message"),
    [
        ("", 1, "the first column must be `t`"),
        ("x, t\n0, 0", 1, "the first column must be `t`"),
        ("t, x, x\n0, 0, 0", 1, "the column `x` occurs twice"),
        ("t, x\n", 0, "it has no rows"),
        ("t, x\n0, 0\n0, 1", 3, "must rise"),
        ("t, x\n-1, 0", 2, "must rise"),
        ("t, x\nnan, 0", 2, "`t` must be a number of seconds"),
        ("t, x\n0, 1.1", 2, "from -1 to 1"),
        ("t, x\n0, fast", 2, "`x` must be a number, not `fast`"),
        ("t, x\n0, 0, 0", 2, "3 cells under 2 columns"),
        ("t, x, buttons\n0, 0, 1a", 2, "can't name a button"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(text: str, number: int, message: str) -> None:
    with pytest.raises(FileError, match=message) as caught:
        parse(text)
    assert number == caught.value.line


def test_a_link_holds_each_row_and_misses_no_button() -> None:
    link = RowsLink(
        parse("t,x,buttons,lost\n1,0,,\n1.001,0.5,go,\n1.002,0.2,,\n3,,,unplugged").rows
    )
    assert link.read(0) is None
    assert link.trouble() is None
    said = link.read(2 * NS)
    assert said is not None
    assert ({"x": 0.2}, {"go"}) == (said.axes, said.held)
    later = link.read(2 * NS + 1)
    assert later is not None
    assert frozenset() == later.held
    assert link.read(3 * NS) is None
    assert link.trouble() == "unplugged"
