"""Tables as spreadsheets and other programs write them: read where they have one meaning, and else
refused with the line and what to write."""

from __future__ import annotations

import pytest

from kybflow.core.errors import FileError, UnitError
from kybflow.core.files import read_table
from kybflow.core.units import LENGTH, parse_number

COLUMNS = {"x": LENGTH, "y": LENGTH, "word": None}


def rows(text: str) -> list[tuple[int, dict[str, float], dict[str, str]]]:
    return list(read_table(text, COLUMNS, "a test", "x, y").rows)


@pytest.mark.parametrize(
    "text",
    [
        "x, y\n1, 2.5\n",
        "x;y\n1;2.5\n",
        "x\ty\n1\t2.5\n",
        "x, y,\n1, 2.5,\n",
        "x;y;\r\n1;2.5;\r\n",
        "x, y\n1, 2.5,\n",
        "x, y,\n1, 2.5\n",
        "x [cm]; y\n100; 2.5\n",
    ],
)
def test_each_separator_gives_the_same_values(text: str) -> None:
    assert rows(text) == [(2, {"x": 1.0, "y": 2.5}, {})]


def test_an_empty_last_word_is_a_value() -> None:
    assert rows("x, y, word\n1, 2,\n1, 2, ,\n") == [
        (2, {"x": 1.0, "y": 2.0}, {"word": ""}),
        (3, {"x": 1.0, "y": 2.0}, {"word": ""}),
    ]


@pytest.mark.parametrize(
    ("text", "line", "message", "hint"),
    [
        ("x;y\n1;2,5\n", 2, "`2,5` has a decimal comma", "write `2.5`, with a decimal point"),
        ("x\ty\n1\t2,5\n", 2, "`2,5` has a decimal comma", "write `2.5`, with a decimal point"),
        ("x, y\n1,0,2,5\n", 2, "4 values in a table of 2 columns", "a decimal comma separates"),
        ("x, y\n1, 2\n4_0, 2\n", 3, "`4_0` has an underscore", "write `40`"),
        ("x, y\n1, \u0663\n", 2, "`\u0663` has another keyboard's characters", "write `3`"),
        ("x, y\n1, \u22122\n", 2, "`\u22122` has another keyboard's characters", "write `-2`"),
        ("x, y\n1;2\n", 2, "1 values in a table of 2 columns", "separate the values like"),
        ("x, y\n1 2\n", 2, "1 values in a table of 2 columns", "separate the values like"),
        (
            "x y\n1 2\n",
            1,
            "`x y` is not a column of a test",
            "separate the columns with commas: `x, y`",
        ),
        ("1, 2\n", 1, "it has no header", "begin with a line like `x, y`"),
        ("x, y\n1, , 2\n", 2, "3 values in a table of 2 columns", ""),
        ("x, y\n1, two\n", 2, "`two` is not a number", ""),
        ("x, y\n1, 0x10\n", 2, "`0x10` is not a number", ""),
        ("x, y\n1, inf\n", 2, "`inf` is not finite", ""),
    ],
)
def test_another_notation_is_refused_at_its_line(
    text: str, line: int, message: str, hint: str
) -> None:
    with pytest.raises(FileError) as caught:
        rows(text)
    assert (str(caught.value), caught.value.line) == (message, line)
    assert hint in caught.value.hint


@pytest.mark.parametrize(
    ("text", "value"), [("1", 1.0), (" -2.5e-1\t", -0.25), ("+.5", 0.5), ("3.", 3.0)]
)
def test_a_number_is_read(text: str, value: float) -> None:
    assert parse_number(text) == value


@pytest.mark.parametrize(
    "text", ["", "1_000", "\u0661\u0662", "\uff11", "1,5", "1 m", "--1", "1.2.3", "\u00bd", "1e"]
)
def test_nothing_else_is_a_number(text: str) -> None:
    with pytest.raises(UnitError):
        parse_number(text)
