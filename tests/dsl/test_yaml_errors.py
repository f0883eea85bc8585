"""What stops YAML's parser is said in words, at the line to change."""

from __future__ import annotations

import pytest

from kybflow.dsl.diagnostics import Collector, Diagnostic
from kybflow.dsl.reading.nodes import to_json
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
    found = Collector()
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


def test_tabs_before_a_comment_are_yaml() -> None:
    found = Collector()
    root = compose("a:\n\t# one\n  b: 1\n \t \n\t\t# two\n  c: 2 \t# three\n\t#\n", "m.yaml", found)
    assert found.all == []
    assert to_json(root) == {"a": {"b": 1, "c": 2}}


def test_a_tab_that_indents_is_still_told_beside_one_before_a_comment() -> None:
    [found] = findings_of("a:\n\t# one\n\tb: 1\n")
    assert (found.span.line, found.message) == (3, "a tab can't indent YAML")


STRANGE = {
    "a:\n  b: {c: 1}\n\u00a0 d: 2\n  e: 3\n": (3, 1, "a no-break space (U+00A0) is before `d`"),
    "a:\n  b: 1\n\u2003d: 2\n": (3, 1, "an em space (U+2003)"),
    "a: \u201eb\u201c\n": (1, 4, 'write `"b"`'),
    "\u00aba\u00bb: b\n": (1, 1, 'write `"a"`'),
    "a: [b, \u2018c\u2019]\n": (1, 8, 'write `"c"`'),
    "a\u200b: b\n": (1, 2, "a zero width space (U+200B) is behind `a`"),
    "a: la\u202end\n": (1, 6, "a right-to-left override (U+202E) is in `land`"),
    "a: b\u00a0\n": (1, 5, "write `b`"),
}


@pytest.mark.parametrize("text", STRANGE)
def test_a_strange_character_is_named_where_it_is(text: str) -> None:
    line, column, said = STRANGE[text]
    [found] = findings_of(text)
    assert (found.code, found.span.line, found.span.column) == ("KYB016", line, column)
    assert said in f"{found.message}; {found.help}"


@pytest.mark.parametrize(
    "text",
    [
        "log: \u201ehello\u201c\n",
        "help: \u0646\u0645\u06cc\u200c\u062e\u0648\u0627\u0647\u0645\n",
        'a: "\u201cb\u201d"\n',
        "a: 1  # \u00a0\u201cnote\u201d\n",
        "m\u00f6we: {H\u00e4nsel: \u00e9}\n",
        "a: |\n  \u00a0x\n",
    ],
)
def test_texts_and_letters_of_other_languages_are_left_alone(text: str) -> None:
    assert findings_of(text) == []


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
