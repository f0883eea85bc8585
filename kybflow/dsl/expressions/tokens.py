"""Text to tokens: quantities with their unit, dotted names, operators, brackets."""

from __future__ import annotations

import re
from typing import NamedTuple

KEYWORDS = frozenset({"and", "or", "not", "in", "to", "within", "always", "eventually", "finally"})
"""Words of the language; no vehicle or state may be called so."""

_TOKEN = re.compile(
    r"\s*(?:(?P<quantity>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[^\W\d][\w-]*(?:\.[\w-]+)*)"
    r"|(?P<operator><=|>=|==|!=|<|>)"
    r"|(?P<bracket>[()\[\]])"
    r"|(?P<unreadable>.)"
    r"|(?P<end>\Z))",
    re.DOTALL,
)
_UNIT = re.compile(r"\s*((?:kg|g) m\^2|1/s|[°%]|[^\W\d_][\w/^]*)")


class Token(NamedTuple):
    """A piece of the text from `start` to `end`.

    kind: quantity, name, operator, bracket, unreadable (a character that no token begins with) or
    end.
    """

    kind: str
    text: str
    start: int
    end: int


def tokens_of(text: str) -> list[Token]:
    """The tokens of `text`, closed by one of the kind `end`; an unreadable one ends the list."""
    found: list[Token] = []
    end = 0
    while match := _TOKEN.match(text, end):
        kind = match.lastgroup or ""
        start, end = match.span(kind)
        if kind == "quantity":
            end = _with_unit(text, end)
        found.append(Token(kind, text[start:end], start, end))
        if kind in ("unreadable", "end"):
            break
    return found


def _with_unit(text: str, end: int) -> int:
    match = _UNIT.match(text, end)
    return match.end() if match and match[1] not in KEYWORDS else end
