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

LETTER = r"[^\W\d]"
"""The pattern of the first character of a name."""
CHARACTER = r"[^\x00-\x2f\x3a-\x40\x5b-\x5e\x60\x7b-\xa9\xab-\xb4\xb6\xb8\xb9\xbb-\xbf\xd7\xf7]"
"""The pattern of the further characters of a name. It excludes what is no letter or digit up to
U+00FF only: `\\w` would leave out vowel signs, and further ranges would make it slow to compile.
`name_flaw` refuses other signs in a name."""
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
_OF_ANY = frozenset({"COMBINING", "MODIFIER", "FEMININE", "MASCULINE", "MICRO", "Mn", "Mc", "Nd"})
"""First words of Unicode's names, and its categories of marks and digits, that belong to every
script."""


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
        script = "CJK" if script == "IDEOGRAPHIC" else script
        if script not in _OF_ANY and unicodedata.category(character) not in _OF_ANY:
            scripts.setdefault(script, character)
    if len(scripts) > 1 and not any(scripts.keys() <= together for together in _TOGETHER):
        (first, a), (second, b) = list(scripts.items())[:2]
        return f"it mixes {first.title()} (`{a}`) and {second.title()} letters (`{b}`)"
    return ""
