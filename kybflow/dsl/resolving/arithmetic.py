"""Arithmetic with parameters: `$height + 20 cm`, `-$side`, `($a + $b) / 2`.

    sum     := product (('+' | '-') product)*
    product := factor (('*' | '/') factor)*
    factor  := ('+' | '-') factor | '(' sum ')' | '$' NAME | NUMBER [UNIT]

Sums need the same dimension on both sides. A product multiplies by a number or a share, a quotient
divides by one or by the same dimension, and a speed times a duration is a length. The result is
exact: decimal numbers are added as such, in the unit in which they are written if it is the same.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from decimal import Decimal
from fractions import Fraction
from typing import NamedTuple

from kybflow.core.names import NAME
from kybflow.core.units import (
    ACCELERATION,
    ANGLE,
    ANGULAR_ACCELERATION,
    ANGULAR_RATE,
    DIMENSIONS,
    DURATION,
    LENGTH,
    NUMBER,
    RATIO,
    SPEED,
    Dimension,
    article,
)

MAX_LENGTH = 100
"""The most characters of arithmetic, as of any value; more would nest too deep."""
_OF_UNIT = {unit: d for d in DIMENSIONS.values() for unit in d.units}
_UNIT = "|".join(re.escape(unit) for unit in sorted(_OF_UNIT, key=len, reverse=True))
_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,2})?"
_QUANTITY = rf"{_NUMBER}(?:\s*(?:{_UNIT})(?![\w^]|/[^\W\d]))?"
_TOKEN = re.compile(
    rf"\s*(?:\$(?P<name>{NAME})|(?P<number>{_NUMBER})(?:\s*(?P<unit>{_UNIT})(?![\w^]|/[^\W\d]))?"
    r"|(?P<sign>[-+*/()])|(?P<end>\Z)|(?P<unreadable>\S))"
)
_VALUE = re.compile(rf"\s*([+-]?{_NUMBER})\s*({_UNIT})?\s*\Z")
_OPERAND = rf"(?:\$(?:{NAME})|(?<![\w.$]){_QUANTITY})"
BEGINNING = re.compile(rf"\s*(?:[-+(]|{_OPERAND}\s*[-+*/])")
"""Matches the beginning of a text that, if it contains a `$name`, is meant as arithmetic."""
INSIDE = re.compile(rf"-?{_OPERAND}(?:(?:\s+[-+*/]\s+|[-+*/]){_OPERAND})*")
"""Matches arithmetic without parentheses inside a condition, or an operand alone. An operator has
spaces on both sides or on none: `[0 -$side 1]` is a point."""
_PRODUCTS = {
    (SPEED, DURATION): LENGTH,
    (ACCELERATION, DURATION): SPEED,
    (ANGULAR_RATE, DURATION): ANGLE,
    (ANGULAR_ACCELERATION, DURATION): ANGULAR_RATE,
}
_SCALES = (NUMBER, RATIO)


class Amount(NamedTuple):
    """A number in SI. unit: the unit in which the result is written, empty for the SI unit.
    is_bare: whether it is written without a unit, so that it may have that of its neighbour."""

    value: Fraction
    dimension: Dimension
    unit: str = ""
    is_bare: bool = False

    @property
    def text(self) -> str:
        """The amount as an author would write it."""
        unit = self.unit or ("%" if self.dimension is RATIO else self.dimension.si)
        return f"{float(self.value / _factor(unit))!r}".removesuffix(".0") + f" {unit}".rstrip()

    @property
    def kind(self) -> str:
        return article(self.dimension.name)


class Mistake(Exception):
    """Text that can't be worked out. start, end: the wrong characters. hint: the way out."""

    def __init__(self, start: int, end: int, message: str, hint: str) -> None:
        super().__init__(message)
        self.start, self.end, self.hint = start, end, hint


def amount_of(text: str, dimension: Dimension) -> Amount:
    """Return the amount of a parameter whose value is written as `text`."""
    match = _VALUE.match(text)
    assert match is not None
    unit = match[2] or ""
    return Amount(_exact(match[1]) * _factor(unit), dimension, unit)


def result_of(text: str, amounts: Mapping[str, Amount]) -> str:
    """Return the value of `text` as a quantity. amounts: the values of its parameters. Raises
    Mistake."""
    return _Arithmetic(text, amounts).whole()


def _exact(number: str) -> Fraction:
    return Fraction(Decimal(number))


def _factor(unit: str) -> Fraction:
    return _exact(repr(_OF_UNIT[unit].units[unit])) if unit in _OF_UNIT else Fraction(1)


class _Arithmetic:
    def __init__(self, text: str, amounts: Mapping[str, Amount]) -> None:
        self._text, self._amounts = text, amounts
        self._next = self._token(0)

    def whole(self) -> str:
        amount = self._sum()
        if self._next.lastgroup != "end":
            raise self._unexpected("`+`, `-`, `*`, `/` or the end")
        try:
            return amount.text
        except OverflowError:
            raise self._mistake(0, "the result is too large", "use smaller numbers") from None

    def _token(self, position: int) -> re.Match[str]:
        match = _TOKEN.match(self._text, position)
        assert match is not None
        return match

    def _take(self) -> None:
        self._next = self._token(self._next.end())

    def _sum(self) -> Amount:
        start, total = self._start(), self._product()
        while (sign := self._next["sign"]) in ("+", "-"):
            self._take()
            other = self._product()
            is_bare = total.is_bare and other.is_bare
            total, other = _alike(total, other), _alike(other, total)
            if total.dimension is not other.dimension:
                raise self._mistake(
                    start,
                    f"{total.kind} and {other.kind} can't be {_VERBS[sign]}",
                    f"write {total.kind} on both sides, like `{total.dimension.example}`",
                )
            value = total.value + (other.value if sign == "+" else -other.value)
            unit = total.unit if total.unit == other.unit else ""
            total = Amount(value, total.dimension, unit, is_bare)
        return total

    def _product(self) -> Amount:
        start, total = self._start(), self._factor()
        while (sign := self._next["sign"]) in ("*", "/"):
            self._take()
            other = self._factor()
            if sign == "/" and not other.value:
                raise self._mistake(start, "this divides by zero", "divide by another value")
            made = _multiplied(total, other) if sign == "*" else _divided(total, other)
            if made is None:
                hint = f"`*` and `/` take a number, as in `$value {sign} 2`"
                message = f"{total.kind} can't be {_VERBS[sign]} {other.kind}"
                raise self._mistake(start, message, hint)
            total = made
        return total

    def _factor(self) -> Amount:
        token = self._next
        sign = token["sign"]
        if sign in ("+", "-"):
            self._take()
            amount = self._factor()
            return amount._replace(value=-amount.value) if sign == "-" else amount
        if sign == "(":
            self._take()
            amount = self._sum()
            if self._next["sign"] != ")":
                raise self._unexpected("`)`")
            self._take()
            return amount
        if token["name"] is not None:
            self._take()
            return self._amounts[token["name"]]
        if token["number"] is None:
            raise self._unexpected("a quantity or a parameter")
        self._take()
        unit = token["unit"] or ""
        dimension = _OF_UNIT[unit] if unit else NUMBER
        return Amount(_exact(token["number"]) * _factor(unit), dimension, unit, not unit)

    def _start(self) -> int:
        return self._next.end() - len(self._next[0].lstrip())

    def _mistake(self, start: int, message: str, hint: str) -> Mistake:
        """Return a mistake from `start` to the last token that was taken."""
        return Mistake(start, self._next.start(), message, hint)

    def _unexpected(self, expected: str) -> Mistake:
        start = self._start()
        word = re.match(r"[^\W\d]\w*|.?", self._text[start:])
        found = word[0] if word else ""
        message = f"found {f'`{found}`' if found else 'the end'} where {expected} should be"
        if found[:1].isalpha() and self._text[:start].rstrip()[-1:].isdigit():
            message = f"`{found}` is not a unit"
        hint = "write it like `$height + 20 cm`, `$speed * 2` or `($a + $b) / 2`"
        return Mistake(start, start + max(len(found), 1), message, hint)


_VERBS = {"+": "added", "-": "subtracted", "*": "multiplied by", "/": "divided by"}


def _alike(one: Amount, other: Amount) -> Amount:
    """Return a number without a unit in the SI unit of `other`, as in the rest of the language."""
    if one.is_bare and other.dimension.bare_allowed:
        return one._replace(dimension=other.dimension, unit=other.dimension.si)
    return one


def _multiplied(one: Amount, other: Amount) -> Amount | None:
    value = one.value * other.value
    for a, b in ((one, other), (other, one)):
        if b.dimension in _SCALES:
            return Amount(value, a.dimension, a.unit, a.is_bare and b.is_bare)
        if (a.dimension, b.dimension) in _PRODUCTS:
            return Amount(value, _PRODUCTS[a.dimension, b.dimension])
    return None


def _divided(one: Amount, other: Amount) -> Amount | None:
    value = one.value / other.value
    if one.dimension is other.dimension:
        return Amount(value, NUMBER)
    if other.dimension in _SCALES:
        return Amount(value, one.dimension, one.unit)
    for factors, product in _PRODUCTS.items():
        if product is one.dimension and other.dimension in factors:
            return Amount(value, factors[other.dimension is factors[0]])
    return None
