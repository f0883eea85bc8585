"""Names in the letters of every language.

A name consists of letters, digits and `_` and does not begin with a digit. The patterns here match
names within a text. `name_flaw` finds names that are not what they seem: with characters that can't
be seen, or with letters of several scripts, of which some look alike. The rule for scripts is that
of a "highly restrictive" identifier in Unicode Technical Standard 39, section 5.2: one script, or
Latin with those of Chinese, Japanese or Korean. Names are compared in Unicode's normal form C, into
which the reader brings a file.
"""

from __future__ import annotations

import unicodedata

from kybflow.core.text import character_name, unseen

_MARKS = (
    r"\u0300-\u036f\u0483-\u0487\u0591-\u05bd\u05bf\u05c1-\u05c2\u05c4-\u05c5\u05c7"
    r"\u0610-\u061a\u064b-\u065f\u0670\u06d6-\u06dc\u06df-\u06e8\u06ea-\u06ed"
    r"\u0711-\u07f3\u07fd\u0816-\u082d\u0859-\u085b\u0898-\u08e1\u08e3-\u0963"
    r"\u0981-\u09e3\u09fe-\u0a75\u0a81-\u0ae3\u0afa-\u0b63\u0b82-\u0bd7\u0c00-\u0c63"
    r"\u0c81-\u0c83\u0cbc-\u0d4d\u0d57-\u0d63\u0d81-\u0df3\u0e31-\u0e3a\u0e47-\u0e4e"
    r"\u0eb1-\u0ecd\u0f18-\u0f19\u0f35\u0f37\u0f39\u0f3e-\u0f84\u0f86-\u0fbc\u0fc6"
    r"\u102b-\u103e\u1056-\u109d\u135d-\u135f\u1712-\u1734\u1752-\u17d3\u17dd"
    r"\u180b-\u180d\u180f-\u193b\u1a17-\u1a1b\u1a55-\u1a7f\u1ab0-\u1abd\u1abf-\u1b44"
    r"\u1b6b-\u1b73\u1b80-\u1bf3\u1c24-\u1c37\u1cd0-\u1cd2\u1cd4-\u1dff\u20d0-\u20dc"
    r"\u20e1\u20e5-\u20f0\u2cef-\u2cf1\u2d7f-\u2dff\u302a-\u302f\u3099-\u309a\ua66f"
    r"\ua674-\ua67d\ua69e-\ua6f1\ua802-\ua827\ua82c\ua880-\ua8c5\ua8e0-\ua8f1"
    r"\ua8ff-\ua92d\ua947-\ua953\ua980-\ua9c0\ua9e5-\uaa4d\uaa7b-\uaac1\uaaeb-\uaaef"
    r"\uaaf5-\uaaf6\uabe3-\uabea\uabec-\uabed\ufb1e\ufe00-\ufe0f\ufe20-\ufe2f"
)
"""Accents and vowel signs that follow a letter, and what is between them."""
LETTER = r"[^\W\d]"
"""The pattern of the first character of a name."""
CHARACTER = rf"[\w{_MARKS}]"
"""The pattern of the further characters of a name."""
NAME = rf"{LETTER}{CHARACTER}*"
"""The pattern of a name."""
_HIDDEN = frozenset(
    "\u034f\u115f\u1160\u17b4\u17b5\u180b\u180c\u180d\u180f\u3164\uffa0"
    + "".join(map(chr, range(0xFE00, 0xFE10)))
)
"""Marks and letters that can't be seen: variation selectors, fillers and joiners."""
_TOGETHER = (
    frozenset({"LATIN", "CJK", "HIRAGANA", "KATAKANA", "KATAKANA-HIRAGANA"}),
    frozenset({"LATIN", "CJK", "BOPOMOFO"}),
    frozenset({"LATIN", "CJK", "HANGUL"}),
)
"""Scripts that are written together."""
_OF_ANY = frozenset({"COMBINING", "MODIFIER", "FEMININE", "MASCULINE", "MICRO"})


def name_flaw(name: str) -> str:
    """Return why a name with letters beyond a to z is refused; empty if it is not, or if only its
    ASCII characters could be wrong."""
    if name.isascii():
        return ""
    hidden = next((i for i, c in enumerate(name) if c in _HIDDEN), unseen(name))
    if hidden is not None:
        return f"it contains {character_name(name[hidden])}, which can't be seen"
    scripts: dict[str, str] = {}
    for character in name:
        if character.isascii():
            if character.isalpha():
                scripts.setdefault("LATIN", character)
            continue
        if not f"a{character}".isidentifier():
            return f"{character_name(character)} is no letter"
        plain = unicodedata.normalize("NFKC", character)
        if plain.isascii():
            return f"`{character}` looks like `{plain}`: write that"
        script = unicodedata.name(character, "").partition(" ")[0]
        if script not in _OF_ANY and not unicodedata.category(character).startswith("M"):
            scripts.setdefault(script, character)
    if len(scripts) > 1 and not any(scripts.keys() <= together for together in _TOGETHER):
        (first, a), (second, b) = list(scripts.items())[:2]
        return f"it mixes {first.title()} (`{a}`) and {second.title()} letters (`{b}`)"
    return ""
