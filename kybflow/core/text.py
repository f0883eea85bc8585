"""Texts of messages: hints for unknown names, plain characters instead of typographic ones, and
tables of details, which a reader may show or leave out.

The first line of a message with a table, the headline, is a message in itself. Each line of the
table is indented and ends with a newline, so that the table can still be found after several
messages were joined by `; `.
"""

from __future__ import annotations

import unicodedata
from bisect import bisect
from collections.abc import Iterable
from difflib import get_close_matches

_MAX_NAME = 80
_MOST_COMPARED = 300
"""The most names that are compared, because comparing every unknown name with thousands would take
too long."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the hint for an unknown name: the most similar known name, or else the first 12 known
    names."""
    names = sorted(dict.fromkeys(known))
    if near := nearest(name, names):
        return f"did you mean `{near}`?"
    if not names:
        return ""
    shown = ", ".join(f"`{n}`" for n in names[:12])
    return f"known here: {shown}{', ...' if len(names) > 12 else ''}"


def nearest(name: str, known: Iterable[str], cutoff: float = 0.6) -> str:
    """Return the known name that is most similar to `name`, or an empty string if none is similar.
    Only the first 80 characters of `name` are compared; if there are many known names, only its
    alphabetical neighbours are considered."""
    names = sorted(known)
    if len(names) > _MOST_COMPARED:
        place = bisect(names, name)
        names = names[max(0, place - _MOST_COMPARED // 2) : place + _MOST_COMPARED // 2]
    near = get_close_matches(name[:_MAX_NAME], names, n=1, cutoff=cutoff)
    return near[0] if near else ""


_TYPED = str.maketrans(
    dict.fromkeys("\u2212\u2010\u2011\u2012\u2013\u2014", "-")
    | dict.fromkeys("\u201c\u201d\u201e\u00ab\u00bb", '"')
    | dict.fromkeys("\u2018\u2019\u201a", "'")
    | {"\u066b": "."}
)
"""Maps minus signs, dashes and quotes of word processors, and the Arabic decimal separator, to
characters of a keyboard."""


def as_typed(text: str) -> str:
    """Return `text` with the characters of word processors, full-width keyboards and other scripts
    replaced by plain ones: minus signs, dashes, quotes, colons, commas, digits and spaces."""
    if text.isascii():
        return text
    plain = unicodedata.normalize("NFKC", text.translate(_TYPED))
    return "".join(str(unicodedata.decimal(c)) if c.isdecimal() else c for c in plain)


_OPENING, _CLOSING = (
    "\u201c\u201d\u201e\u00ab\u00bb\u2018\u2019\u201a",
    "\u201d\u201c\u00bb\u00ab\u2019\u2018",
)


def in_typographic_quotes(text: str) -> bool:
    """Return whether `text` is in the quotes of a word processor."""
    return len(text) > 1 and text[0] in _OPENING and text[-1] in _CLOSING


def unseen(text: str) -> int | None:
    """Return the index of the first character of `text` that can't be seen and isn't a plain space,
    or that reverses the direction of writing; None if there is none."""
    if text.isascii():
        return None
    kinds = ("Cf", "Cc", "Zs", "Zl", "Zp")
    strange = (i for i, c in enumerate(text) if c > "~" and unicodedata.category(c) in kinds)
    return next(strange, None)


def character_name(character: str) -> str:
    """Return the name of a character, such as `a no-break space (U+00A0)`."""
    name = unicodedata.name(character, "a character without a name").lower()
    indefinite = "" if name.startswith("a ") else "an " if name[0] in "aeiou" else "a "
    return f"{indefinite}{name} (U+{ord(character):04X})"


INDENT = "  "


def detailed(headline: str, lines: Iterable[str]) -> str:
    """Return `headline` with `lines` as its table."""
    below = "".join(f"{INDENT}{line}\n" for line in lines)
    return f"{headline}\n{below}" if below else headline


def headline(text: str) -> str:
    """Return `text` without its tables; unchanged if it has none."""
    lines = text.split("\n")
    rest = [line for line in lines if not line.startswith(INDENT)]
    return text if len(rest) == len(lines) else "".join(rest)


def details(text: str) -> list[str]:
    """Return the lines of the tables in `text`, without their indent."""
    return [line.removeprefix(INDENT) for line in text.split("\n") if line.startswith(INDENT)]
