"""Split a text into tokens: quantities with their unit, dotted names, operators, brackets. The
cursor steps through the tokens and reports unexpected ones."""

from __future__ import annotations

import re
from typing import NamedTuple

from kybflow.core.names import CHARACTER, LETTER
from kybflow.core.text import as_typed
from kybflow.dsl.diagnostics import Collector, Text
from kybflow.dsl.reading.nodes import NAME_A_POINT, NO_POINT, no_commas

KEYWORDS = frozenset({"and", "or", "not", "in", "to", "within", "always", "eventually", "finally"})
"""The words of the language, which can't be the name of a vehicle or state."""

_WORD = f"{CHARACTER[:-1]}-]"
_TOKEN = re.compile(
    r"\s*(?:(?P<quantity>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    rf"|(?P<name>{LETTER}{_WORD}*(?:\.{_WORD}+)*)"
    r"|(?P<operator><=|>=|==|!=|<|>)"
    r"|(?P<bracket>[()\[\]])"
    r"|(?P<unreadable>.)"
    r"|(?P<end>\Z))",
    re.DOTALL,
)
_UNIT = re.compile(r"\s*((?:kg|g) m\^2|1/s|[°%]|[^\W\d_][\w/^]*)")
_HABITS = {
    "=": "write `==`",
    "!": "write `not` or `!=`",
    "&": "write `and`",
    "|": "write `or`",
    "$": "a parameter is written as a word of its own",
    "°": "write `deg`",
}
_COORDINATES = re.compile(r"[([]?[-+\d.]+[\s,]+[-+\d.]+[\s,]+[-+\d.]+[)\]]?\s*\)")
"""A point written out as the last argument of a function."""


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
    """Return the tokens of `text`. The last has the kind `end`, or `unreadable` if the rest can't
    be split."""
    found: list[Token] = []
    end = 0
    while match := _TOKEN.match(text, end):
        kind = match.lastgroup or ""
        start, end = match.span(kind)
        if kind == "quantity" and (unit := _UNIT.match(text, end)) and unit[1] not in KEYWORDS:
            end = unit.end()
        found.append(Token(kind, text[start:end], start, end))
        if kind in ("unreadable", "end"):
            break
    return found


class Unreadable(Exception):
    """Ends the parsing of a text; the reason is already reported."""


class Cursor:
    """Steps through the tokens of a text. Raises Unreadable if the next token is not the expected
    one."""

    def __init__(self, text: Text, found: Collector) -> None:
        self._text, self._found = text, found
        tokens = tokens_of(text.text)
        self._tokens = [*tokens, tokens[-1]]  # so that `peek(1)` always exists
        self._next = 0

    def peek(self, ahead: int = 0) -> Token:
        return self._tokens[self._next + ahead]

    def take(self) -> Token:
        token = self.peek()
        self._next += 1
        return token

    def skip(self, word: str) -> bool:
        found = self.peek().text == word
        self._next += found
        return found

    def expect(self, word: str) -> None:
        if not self.skip(word):
            raise self.unexpected(f"`{word}`")

    def behind(self) -> int:
        """Return the position after the last token that was taken."""
        return self._tokens[self._next - 1].end if self._next else 0

    def of_kind(self, kind: str, what: str) -> Token:
        """Take and return a token of the given kind. what: how reports call the expected token."""
        token = self.peek()
        if token.kind != kind:
            raise self.unexpected(what)
        self._next += 1
        return token

    def unexpected(self, expected: str) -> Unreadable:
        """Report the next token as not `expected`, and return the exception to raise."""
        token = self.peek()
        shown = f"`{token.text}`" if token.text else "the end"
        hint = _way_out(self._text.text, token)
        if not token.text and expected == "`)`":
            hint = f"close the parenthesis: `{self._text.text.strip()})`"
        elif not token.text and "comparison" in expected:
            hint = "compare it, for example with `< 5 cm`"
        message = f"found {shown} where {expected} should be"
        return self.stopped("KYB210", NO_POINT if hint == NAME_A_POINT else message, "", hint)

    def stopped(self, code: str, message: str, label: str, help: str = "") -> Unreadable:
        """Report at the next token why parsing stops, and return the exception to raise."""
        token = self.peek()
        self._found.report(code, message, self._text.part(token.start, token.end), label, help=help)
        return Unreadable()


def _way_out(text: str, token: Token) -> str:
    before, after = text[: token.start], text[token.end :]
    if token.text == "," and before[-1:].isdigit() and after[:1].isdigit():
        number, rest = re.split(r"[^\d]", before)[-1], re.split(r"[^\d]", after)[0]
        return f"write `{number}.{rest}`, with a decimal point"
    if not token.text.isascii() and (typed := as_typed(token.text)) != token.text:
        return f"write a plain `{typed}`"
    if before.count("[") > before.count("]") or _COORDINATES.match(text, token.start):
        return NAME_A_POINT
    if token.text == "," and before.count("(") <= before.count(")"):
        return "the language has no commas: write `and` where both must hold"
    if token.text == ",":
        return no_commas(text[max(0, before.rfind("(") - len("separation")) :])
    if not token.text and text.count("(") > text.count(")"):
        return "inside {...} YAML ends a value at a comma: write `distance(a to b)` without one"
    return _HABITS.get(token.text, "")
