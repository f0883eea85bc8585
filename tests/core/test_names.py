"""Names in the letters of every language, and names that are not what they seem."""

from __future__ import annotations

import re
import unicodedata

import pytest

from kybflow.core.names import CHARACTER, LETTER, NAME, name_flaw

GOOD = [
    "nano", "m\u00f6we", "H\u00e4nsel", "\u0159eka", "\u0434\u0440\u043e\u043d_1",
    "\u03b4\u03c1\u03cc\u03bd\u03bf\u03c2", "\u7121\u4eba\u6a5f", "drone_\u7121\u4eba\u6a5f",
    "\u30c9\u30ed\u30fc\u30f3", "\u3072\u304d\u53f0", "\ub4dc\ub860_b", "\u0646\u0633\u0631",
    "\u05e8\u05d7\u05e4\u05df", "\u0939\u093f\u0902\u0926\u0940", "\u0e42\u0e14\u0e23\u0e19",
    "\u0e19\u0e49\u0e33", "\u10d3\u10e0\u10dd\u10dc\u10d8", "\u1264\u1275",
    "\u0bb5\u0bbf\u0b9a\u0bc8",
    "ma\u00f1ana", "\u0131\u015f\u0131k", "\u0111\u1ed3ng",
    "\u4f50\u3005\u6728", "\u0631\u0628\u0627\u062a\u0661", "\u067e\u0647\u067e\u0627\u062f\u06f1",
]  # fmt: skip
BAD = {
    "n\u0430no": "it mixes Latin (`n`) and Cyrillic letters (`\u0430`)",
    "\u0434\u0440\u043e\u043d_a": "it mixes Cyrillic (`\u0434`) and Latin letters (`a`)",
    "\u03b1\u0431": "it mixes Greek (`\u03b1`) and Cyrillic letters (`\u0431`)",
    "na\u200bno": "it contains a zero width space (U+200B), which can't be seen",
    "na\u202eno": "it contains a right-to-left override (U+202E), which can't be seen",
    "n\ufe0fano": "it contains a variation selector-16 (U+FE0F), which can't be seen",
    "\u3164": "it contains a hangul filler (U+3164), which can't be seen",
    "\uff4eano": "`\uff4e` looks like `n`: write that",
    "na\u2212no": "a minus sign (U+2212) is no letter",
    "n\u00b2": "a superscript two (U+00B2) is no letter",
    "dro\u2014ne": "an em dash (U+2014) is no letter",
    "\U0001f681": "a helicopter (U+1F681) is no letter",
}


@pytest.mark.parametrize("name", GOOD)
def test_a_name_has_letters_of_any_language(name: str) -> None:
    assert name_flaw(name) == ""
    assert re.fullmatch(NAME, name)


@pytest.mark.parametrize("name", BAD)
def test_a_name_that_is_not_what_it_seems_is_refused(name: str) -> None:
    assert name_flaw(name) == BAD[name]


def test_the_patterns_match_what_names_consist_of() -> None:
    letters = [c for c in map(chr, range(0x250)) if f"a{c}".isidentifier()]
    assert [c for c in map(chr, range(0x250)) if re.fullmatch(CHARACTER, c)] == [
        c for c in map(chr, range(0x250)) if c in letters or ord(c) > 0xFF
    ]
    marks = [c for c in map(chr, range(0x300, 0x10000)) if unicodedata.category(c) in ("Mn", "Mc")]
    assert all(re.fullmatch(CHARACTER, mark) for mark in marks)
    signs = "1 .,;:-+\u2212\u2013\u201c\u201d\u00a0\u00d7"
    assert not any(re.fullmatch(LETTER, sign) for sign in signs)
