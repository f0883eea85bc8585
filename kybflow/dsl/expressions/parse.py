"""The parser of expressions: recursive descent, bounded in depth.

    expectation := 'finished' 'within' quantity | 'always' condition | 'finally' condition
                 | 'eventually' condition ['within' quantity] | statistic operator statistic
    condition   := both ('or' both)*
    both        := single ('and' single)*
    single      := 'not' single | '(' condition ')' | VEHICLE 'in' STATE
                 | ('all' | 'any') GROUP 'in' STATE | operand operator operand

Operands, their types and units: `kybflow.dsl.expressions.operands`.
"""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import cast, get_args

from kybflow.core.units import DURATION
from kybflow.dsl.diagnostics.diagnostic import Collected
from kybflow.dsl.diagnostics.spans import Text
from kybflow.dsl.expressions import errors
from kybflow.dsl.expressions.cursor import Scope
from kybflow.dsl.expressions.operands import Operands
from kybflow.dsl.expressions.tokens import Token
from kybflow.dsl.expressions.tree import (
    Aggregate,
    Always,
    And,
    Compare,
    ComparisonOperator,
    Condition,
    Eventually,
    Expression,
    Finally,
    Finished,
    GroupInState,
    InState,
    Not,
    Or,
    Quantifier,
    Quantity,
)

__all__ = ["Scope", "parse"]

MAX_DEPTH = 32
MAX_LENGTH = 2000
EXPECTATIONS = ("always", "eventually", "finally", "finished")
_QUANTIFIERS = frozenset(get_args(Quantifier))
FLIPPED: Mapping[ComparisonOperator, ComparisonOperator] = {
    "<": ">",
    "<=": ">=",
    ">": "<",
    ">=": "<=",
    "==": "==",
    "!=": "!=",
}


def parse(text: Text, scope: Scope) -> Collected[Expression | None]:
    """The expression that `text` says, or None and what is wrong with it. Never raises."""
    if text not in scope.read:
        scope.read[text] = _parsed(text, scope)
    found: Collected[Expression | None] = scope.read[text]
    return found


def _parsed(text: Text, scope: Scope) -> Collected[Expression | None]:
    try:
        if len(text.text) > MAX_LENGTH:
            raise errors.too_long(text, MAX_LENGTH)
        parser = _Parser(text, scope)
        expression = parser.whole()
    except errors.Unreadable as stop:
        return Collected(None, [stop.finding])
    return Collected(None if parser.findings else expression, parser.findings)


class _Parser(Operands):
    """The grammar. A form whose names or types are wrong leaves a finding and a stand-in, so that
    the rest is judged too."""

    def __init__(self, text: Text, scope: Scope) -> None:
        super().__init__(text, scope)
        self._depth = 0

    def whole(self) -> Expression:
        expectation = self.scope.kind == "expectation"
        expression = self._expectation() if expectation else self._condition()
        if self.peek().kind != "end":
            raise errors.unreadable(self.text, self.peek(), "`and`, `or` or the end")
        return expression

    def _expectation(self) -> Expression:
        first = self.peek()
        if self.skip("finished"):
            self.expect("within")
            return Finished(self._limit())
        if self.skip("always"):
            return Always(self._condition())
        if self.skip("finally"):
            return Finally(self._condition())
        if self.skip("eventually"):
            condition = self._condition()
            limit = self._limit() if self.skip("within") else None
            return Eventually(condition, limit)
        near = get_close_matches(first.text, EXPECTATIONS, n=1)
        if near and self.peek(1).kind != "operator" and self.peek(1).text != "in":
            raise errors.misspelt(self.text, first, near[0])
        return self._statistic(first)

    def _limit(self) -> float:
        """Seconds after the start, more than none."""
        token = self.peek()
        before = len(self.findings)
        value = self.quantity(DURATION)
        if value <= 0.0 and len(self.findings) == before:
            place = (token.start, token.end)
            self.findings.append(errors.before_the_start(self.text, place))
        return value

    def _statistic(self, first: Token) -> Condition:
        self.statistics_allowed = True
        condition = self._condition()
        if self.findings or _is_statistic(condition):
            return condition
        place = (first.start, self.behind())
        finding = errors.timeless
        if self.statistics_seen:
            alone = isinstance(condition, Compare)
            finding = errors.momentary if alone else errors.joined_statistics
        self.findings.append(finding(self.text, place))
        return condition

    def _condition(self) -> Condition:
        parts = [self._both()]
        while self.skip("or"):
            parts.append(self._both())
        return parts[0] if len(parts) == 1 else Or(tuple(parts))

    def _both(self) -> Condition:
        parts = [self._single()]
        while self.skip("and"):
            parts.append(self._single())
        return parts[0] if len(parts) == 1 else And(tuple(parts))

    def _single(self) -> Condition:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise errors.too_deep(self.text, self.peek(), MAX_DEPTH)
        try:
            if self.skip("not"):
                return Not(self._single())
            if self.skip("("):
                inner = self._condition()
                self.expect(")")
                return inner
            if self.peek(1).text == "in":
                return self._in_state()
            if self.peek().text in _QUANTIFIERS and self.peek(1).kind == "name":
                return self._group_in_state()
            return self._comparison()
        finally:
            self._depth -= 1

    def _in_state(self) -> Condition:
        vehicle = self.vehicle(self.name("a vehicle"))
        self.expect("in")
        return InState(vehicle, self.state(vehicle, self.name("a state")))

    def _group_in_state(self) -> Condition:
        quantifier = cast(Quantifier, self.take().text)
        name = self.name("a group")
        vehicles = self.group(name)
        self.expect("in")
        token, before = self.name("a state"), len(self.findings)
        for vehicle in vehicles:
            if len(self.findings) == before:
                self.state(vehicle, token)
        return GroupInState(quantifier, name.text, vehicles, token.text)

    def _comparison(self) -> Condition:
        left = self.operand()
        operator = self.operator()
        right = self.operand()
        if self.peek().kind == "operator":
            raise errors.unreadable(self.text, self.peek(), "`and`, `or` or the end")
        compare = self.compared(left, operator, right)
        if not isinstance(compare, Compare):
            return compare
        if isinstance(compare.left, Quantity) and isinstance(compare.right, Aggregate):
            return self.compared(right, FLIPPED[operator], left)
        return compare


def _is_statistic(condition: Condition) -> bool:
    return (
        isinstance(condition, Compare)
        and isinstance(condition.left, Aggregate)
        and isinstance(condition.right, Aggregate | Quantity)
    )
