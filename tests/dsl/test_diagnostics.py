"""How findings are collected and shown, and when they end a compilation."""

from __future__ import annotations

import re

import pytest

from kybflow.cli.output import coloured
from kybflow.dsl.diagnostics import Collector, Diagnostic, Severity, Span, Stopped, render, to_json


def finding(line: int, start: int, end: int, message: str = "wrong") -> Diagnostic:
    return Diagnostic(
        "KYB999", message, Span("m.yaml", line, start, line, end), "here", ("why",), "do"
    )


def test_it_marks_the_text_and_says_why() -> None:
    assert render(finding(2, 3, 5), {"m.yaml": "one\na: bc d\n"}).splitlines() == [
        "m.yaml:2:3 error[KYB999]: wrong",
        "    2 | a: bc d",
        "      |   ^^ here",
        "      = why",
        "      = help: do",
    ]


def test_a_place_without_text_is_shown_without_it() -> None:
    assert len(render(finding(9, 1, 2), {"m.yaml": "one"}).splitlines()) == 3
    assert len(render(finding(1, 1, 2), {}).splitlines()) == 3


def test_a_long_line_is_cut_around_the_mark() -> None:
    text = "x" * 1000 + "HERE" + "y" * 1000
    source, marks = render(finding(1, 1001, 1005), {"m.yaml": text}).splitlines()[1:3]
    start = marks.index("^")
    assert source[start : start + 4] == "HERE"
    assert len(source) < 180


def test_a_long_message_is_cut() -> None:
    assert len(render(finding(1, 1, 2, "z" * 10_000), {}).splitlines()[0]) < 500
    assert len(to_json(finding(1, 1, 2, "z" * 10_000))["message"]) < 500


def test_nothing_in_a_file_can_command_the_terminal() -> None:
    text = render(finding(1, 1, 2, "\x1b[31m"), {"m.yaml": "a\x1b[2J\ud800"})
    assert "\x1b" not in text
    assert text.encode("utf-8")


def test_colour_changes_nothing_but_colour() -> None:
    plain = render(finding(2, 3, 5), {"m.yaml": "one\na: bc d\n"})
    assert re.sub(r"\x1b\[[0-9;]*m", "", coloured(plain)) == plain


HERE = Span("m.yaml", 1, 1, 1, 2)
ERROR = Diagnostic("KYB101", "an error", HERE, help="mend it")
WARNING = Diagnostic("KYB112", "a warning", HERE, severity=Severity.WARNING)


def test_what_is_reported_is_kept_in_order() -> None:
    found = Collector()
    found.warn("KYB112", "a warning", HERE)
    found.report("KYB101", "an error", HERE, help="mend it")
    found.add(WARNING)
    found.add([ERROR, WARNING])
    assert found.all == [WARNING, ERROR, WARNING, ERROR, WARNING]


def test_errors_stop_a_compilation_and_warnings_do_not() -> None:
    found = Collector()
    found.add(WARNING)
    found.stop_if_errors()
    found.add(ERROR)
    with pytest.raises(Stopped):
        found.stop_if_errors()
