"""Text to tokens: quantities with their unit, dotted names, operators, brackets."""

from __future__ import annotations

import re
from typing import NamedTuple

KEYWORDS = frozenset({"and", "or", "not", "in", "to", "within", "always", "eventually", "finally"})
"""Words of the language; no vehicle or state may be called so."""

_TOKEN = re.compile(
    r"(?P<quantity>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[^\W\d][\w-]*(?:\.[\w-]+)*)"
    r"|(?P<operator><=|>=|==|!=|<|>)"
    r"|(?P<bracket>[()\[\]])"
)
_UNIT = re.compile(r"\s*((?:kg|g) m\^2|1/s|[°%]|[^\W\d_][\w/^]*)")
_SPACE = re.compile(r"\s*")


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
    position = _skip(text, 0)
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            found.append(Token("unreadable", text[position], position, position + 1))
            return found
        kind = match.lastgroup or ""
        end = match.end()
        if kind == "quantity":
            end = _with_unit(text, end)
        found.append(Token(kind, text[position:end], position, end))
        position = _skip(text, end)
    found.append(Token("end", "", len(text), len(text)))
    return found


def _skip(text: str, position: int) -> int:
    match = _SPACE.match(text, position)
    return match.end() if match else position


def _with_unit(text: str, end: int) -> int:
    match = _UNIT.match(text, end)
    return match.end() if match and match[1] not in KEYWORDS else end
