"""The types of a comparison: whether its two sides fit together, and what a quantity or a bare word
means beside the other."""

from __future__ import annotations

from collections.abc import Collection

from kybflow.core.units import NUMBER, RATIO, Dimension, article
from kybflow.dsl.expressions import errors
from kybflow.dsl.expressions.cursor import Cursor, Operand, is_quantity
from kybflow.dsl.expressions.tokens import Token
from kybflow.dsl.expressions.tree import (
    Compare,
    ComparisonOperator,
    Condition,
    InState,
    Not,
    Quantity,
    Read,
    Value,
    Word,
)
from kybflow.parts.observables import OBSERVABLES, chains_of

STAND_IN = Quantity(0.0, NUMBER)
"""Stands where a finding says why there is nothing."""


class Types(Cursor):
    """The middle third of the parser."""

    def compared(self, left: Operand, operator: ComparisonOperator, right: Operand) -> Condition:
        """The comparison, its sides brought to one dimension; `behavior == CHAIN` asks whether the
        vehicle is anywhere inside of the chain."""
        a, b = left.node, right.node
        if left.is_broken or right.is_broken:
            return Compare(operator, STAND_IN, STAND_IN)
        if a is None and b is None:
            return self._nothing_known(left, operator, right)
        a = a if a is not None else self._beside(left, right)
        b = b if b is not None else self._beside(right, left)
        if left.node is not None and right.node is not None:
            self._same_type(left, right)
        if operator not in ("==", "!=") and left.dimension is right.dimension is None:
            message = "names are compared with `==` and `!=`"
            self.mismatch(right, message, "names have no order", "")
        return self._in_chain(a, operator, b) or Compare(operator, a, b)

    def _in_chain(self, a: object, operator: ComparisonOperator, b: object) -> Condition | None:
        read, word = (a, b) if isinstance(a, Read) else (b, a)
        if not isinstance(read, Read) or not isinstance(word, Word) or read.name != "behavior":
            return None
        vehicle = read.vehicle or self.scope.own or ""
        states = self.scope.vehicles.get(vehicle, ())
        if not any(word.text in chains_of(state) for state in states):
            return None
        inside = InState(vehicle, word.text)
        if operator == "==":
            return inside
        return Not(inside) if operator == "!=" else None

    def _nothing_known(
        self, left: Operand, operator: ComparisonOperator, right: Operand
    ) -> Compare:
        words = [side for side in (left, right) if not is_quantity(side)]
        for word in words:
            self.unknown_name(word)
        if not words:
            message = "both sides are written out: this never changes"
            self.mismatch(left, message, "a constant", "compare with something that is measured")
        return Compare(operator, STAND_IN, STAND_IN)

    def _beside(self, side: Operand, other: Operand) -> Value:
        """What a quantity or a bare word means next to `other`."""
        place = (side.start, side.end)
        told = f"`{other.source}` is {type_name(other.dimension)}"
        if is_quantity(side) and other.dimension is not None:
            value = self.measured(side.source, place, other.dimension, told)
            if other.dimension is RATIO and not 0.0 <= value <= 1.0:
                self.findings.append(errors.never_reached(self.text, place, other.source))
            return Quantity(value, other.dimension)
        if is_quantity(side):
            self.mismatch(side, f"{told}, `{side.source}` is a quantity", "a quantity", "")
            return STAND_IN
        if other.dimension is None and isinstance(other.node, Read):
            return self._word(Token("name", side.source, *place), other.node)
        self.unknown_name(side)
        return STAND_IN

    def _word(self, token: Token, read: Read) -> Word:
        vehicle = read.vehicle or self.scope.own or ""
        known: Collection[str] | None = None
        if read.name == "behavior":
            known = self.scope.vehicles.get(vehicle)
        elif read.name == "estimator":
            known = self.scope.estimators.get(vehicle)
        words = OBSERVABLES[read.name].words
        if words and token.text not in words:
            self.unknown(token, f"`{read.name}` is never `{token.text}`", words)
        if known is not None and token.text not in known:
            message = f"`{vehicle}` has no {read.name} `{token.text}`"
            self.unknown(token, message, known)
        return Word(token.text)

    def _same_type(self, left: Operand, right: Operand) -> None:
        if left.dimension is right.dimension:
            return
        a, b = type_name(left.dimension), type_name(right.dimension)
        message = f"`{left.source}` is {a}, but `{right.source}` is {b}"
        self.mismatch(right, message, b, "")


def type_name(dimension: Dimension | None) -> str:
    return "a name" if dimension is None else article(dimension.name)
