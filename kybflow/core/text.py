"""The hint for a name that nothing has, and text as a keyboard has it."""

from __future__ import annotations

import unicodedata
from bisect import bisect
from collections.abc import Iterable
from difflib import get_close_matches

_LONGEST = 80
_COMPARED = 300
"""Comparing a name with thousands of others, thousands of times, would never end."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the help line for an unknown name: the nearest known one, or all of them when none is
    near and they are few."""
    names = sorted(dict.fromkeys(known))
    if near := nearest(name, names):
        return f"did you mean `{near}`?"
    if not names:
        return ""
    shown = ", ".join(f"`{n}`" for n in names[:12])
    return f"known here: {shown}{', ...' if len(names) > 12 else ''}"


def nearest(name: str, known: Iterable[str], cutoff: float = 0.6) -> str:
    """The known name that is most like `name`; empty where none is near. Of long names the
    beginning is compared, of many those around it."""
    names = sorted(known)
    near = get_close_matches(name[:_LONGEST], _around(names, name), n=1, cutoff=cutoff)
    return near[0] if near else ""


def _around(names: list[str], name: str) -> list[str]:
    if len(names) <= _COMPARED:
        return names
    place = bisect(names, name)
    return names[max(0, place - _COMPARED // 2) : place + _COMPARED // 2]


_TYPED = str.maketrans(
    dict.fromkeys("\u2212\u2010\u2011\u2012\u2013\u2014", "-")
    | dict.fromkeys("\u201c\u201d\u201e\u00ab\u00bb", '"')
    | dict.fromkeys("\u2018\u2019\u201a", "'")
)
"""Minus signs, dashes and quotes of word processors."""


def as_typed(text: str) -> str:
    """`text` with the plain characters in place of those of a word processor or of a full-width
    keyboard: minus signs, dashes, quotes, colons, commas, digits, spaces."""
    return text if text.isascii() else unicodedata.normalize("NFKC", text.translate(_TYPED))
