"""What stops YAML's parser is said in words, at the line to change."""

from __future__ import annotations

import pytest

from kybflow.dsl.diagnostics import Diagnostic, Findings
from kybflow.dsl.reading.reader import compose

SLIPS = {
    "a line without a colon": ("up:\n  do: hover\n  height 1 m\n  then: b\n", 3, "`height: 1 m`"),
    "the last line without a colon": ("up:\n  do: hover\n  height 1 m\n", 3, "`height: 1 m`"),
    "a colon without its space": ("up:\n  do:hover\n  then: b\n", 2, "`do: hover`"),
    "an equals sign": ("a = 1\nb: 2\n", 1, "`a: 1`"),
    "a full-width colon": ("a\uff1a1\nb: 2\n", 1, "`a: 1`"),
    "too little indentation": ("a:\n  b:\n    c: 1\n   d: 2\n", 4, "by 4, or by 2"),
    "too much indentation": ("up:\n  do: hover\n    then: b\n", 3, "indent it by 2, like line 2"),
    "a first line that is indented": ("  a: 1\nb: 2\n", 2, "indent both alike"),
    "a key in a list": ("p:\n  - a\n  use: b\n", 3, "begin it with `- `"),
    "an entry without its space": ("p:\n  - a\n  -b\n", 3, "`- b`"),
    "a list behind a key": ("h: - a\n", 1, "on the next line"),
    "a sign apart": ("h: [0, - 1, 2]\n", 1, "`-1`"),
    "a quote in quotes": ("a: 'it's'\n", 1, "written twice"),
    "a quote that stays open": ('a: "x\nb: c\n', 1, "close it"),
    "a second colon": ("a: b: c\n", 1, "quotes"),
    "a bracket too many": ("a: {b: c}}\n", 1, "remove it"),
    "two commas": ("a: [1,,2]\n", 1, "remove it"),
    "a special character": ("a: @x\n", 1, "quotes"),
    "an alias that is none": ("a: * x\n", 1, "quotes"),
    "an unknown escape": ('a: "\\d"\n', 1, "single quotes"),
    "a comparison without its name": ("when: > 3\n", 1, "quotes"),
    "no name": (": a\n", 1, "`key: value`"),
}


def findings_of(text: str) -> list[Diagnostic]:
    found = Findings()
    compose(text, "m.yaml", found)
    return found.all


@pytest.mark.parametrize("slip", SLIPS)
def test_a_slip_is_told_in_words(slip: str) -> None:
    text, line, way_out = SLIPS[slip]
    [found] = findings_of(text)
    assert found.code == "KYB004"
    assert not found.message.startswith("this is not YAML")
    assert found.span.line == line
    assert way_out in found.help


KEYS = {
    "{height: 1,5 m}": "`height: 1.5 m`",
    "{height: 1 ,5 m}": "`height: 1.5 m`",
    "{at: 1, 2, 3}": "`at: [1, 2, 3]`",
    "{at: (1, 2, 3)}": "`at: [1, 2, 3]`",
    "{mass: 1,000 g}": "`mass: 1000 g` where thousands are meant",
    "{when: x > 1,5 m, go: b}": "`when: x > 1.5 m`",
    "{within 2 s}": "`within: 2 s`",
    "{height=1 m}": "`height: 1 m`",
    "{height\uff1a1 m}": "`height: 1 m`",
    "{when: a > 1, b > 2}": "write `and`",
    "{when: a > 1 m, go b}": "`go: b`",
    "{log: up, and away}": "quotes",
    "{fence, smooth}": "`[...]`",
    "? fence": "`fence: VALUE`",
}


@pytest.mark.parametrize("text", KEYS)
def test_a_key_without_a_colon_is_refused_with_what_was_meant(text: str) -> None:
    found = findings_of(text)
    assert found[0].code == "KYB014"
    assert KEYS[text] in found[0].help


@pytest.mark.parametrize("text", ["{a: null}", "{a: ~}", 'a: ""', "a: {}", "{? a : b}", '{"a":b}'])
def test_a_null_that_is_written_is_none(text: str) -> None:
    assert findings_of(text) == []
