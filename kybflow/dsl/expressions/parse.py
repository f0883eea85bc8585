"""The parser of expressions: recursive descent, bounded in depth. What the names and quantities in
it mean, and whether they fit, says `kybflow.dsl.expressions.semantics`.

    expectation := 'finished' 'within' quantity | 'always' condition | 'finally' condition
                 | 'eventually' condition ['within' quantity] | statistic operator statistic
    condition   := both ('or' both)*
    both        := single ('and' single)*
    single      := 'not' single | '(' condition ')' | VEHICLE 'in' STATE
                 | ('all' | 'any') GROUP 'in' STATE | operand operator operand
    operand     := quantity | 'time' | observable | VEHICLE '.' observable | INPUT '.' axis | word
                 | 'distance' '(' place 'to' place ')'
                 | 'separation' '(' all | some 'and' some ... ')'
                 | ('mean'|'max'|'min'|'rms') '(' operand ['in' STATE] ')'
    some        := VEHICLE | GROUP
    place       := VEHICLE | VEHICLE '.start' | 'start' | VEHICLE '.payload'
                 | 'world.points.' NAME | '[' x y z ']'
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast, get_args

from kybflow.core.text import nearest
from kybflow.core.units import DURATION, LENGTH, NUMBER, Dimension
from kybflow.dsl.diagnostics.diagnostic import Collected
from kybflow.dsl.diagnostics.spans import PREFIX, Text
from kybflow.dsl.expressions import errors, tree
from kybflow.dsl.expressions.semantics import HEALTH, Operand, Scope, Semantics, is_quantity
from kybflow.dsl.expressions.tokens import Token, tokens_of
from kybflow.parts.observables import OBSERVABLES

__all__ = ["Scope", "parse"]

MAX_DEPTH = 32
MAX_LENGTH = 2000
EXPECTATIONS = ("always", "eventually", "finally", "finished")
_QUANTIFIERS = frozenset(get_args(tree.Quantifier))
FLIPPED: Mapping[tree.ComparisonOperator, tree.ComparisonOperator] = {
    "<": ">",
    "<=": ">=",
    ">": "<",
    ">=": "<=",
    "==": "==",
    "!=": "!=",
}
_FUNCTIONS = frozenset(get_args(tree.Function))


def parse(text: Text, scope: Scope) -> Collected[tree.Expression | None]:
    """The expression that `text` says, or None and what is wrong with it. Never raises."""
    found: Collected[tree.Expression | None] | None = scope.read.get(text)
    if found is None:
        found = scope.read[text] = _parsed(text, scope)
    return found


def _parsed(text: Text, scope: Scope) -> Collected[tree.Expression | None]:
    try:
        if len(text.text) > MAX_LENGTH:
            raise errors.too_long(text, MAX_LENGTH)
        semantics = Semantics(text, scope)
        expression = _Parser(text, semantics).whole()
    except errors.Unreadable as stop:
        return Collected(None, [stop.finding])
    return Collected(None if semantics.findings else expression, semantics.findings)


class _Parser:
    """The grammar of expectations and conditions."""

    def __init__(self, text: Text, semantics: Semantics) -> None:
        self._text, self._semantics = text, semantics
        self._tokens = _Cursor(text)
        self._operands = _Operands(self._tokens, semantics)
        self._depth = 0

    def whole(self) -> tree.Expression:
        expectation = self._semantics.scope.kind == "expectation"
        expression = self._expectation() if expectation else self._condition()
        if self._tokens.peek().kind != "end":
            raise errors.unreadable(self._text, self._tokens.peek(), "`and`, `or` or the end")
        return expression

    def _expectation(self) -> tree.Expression:
        first = self._tokens.peek()
        if first.text in EXPECTATIONS:
            return self._timed(self._tokens.take())
        second = self._tokens.peek(1)
        is_call = first.text in _FUNCTIONS and second.text == "("
        if not is_call and second.kind != "operator" and second.text != "in":
            near = nearest(first.text, EXPECTATIONS)
            if near:
                raise errors.misspelt(self._text, first, near)
        return self._statistic(first)

    def _timed(self, word: Token) -> tree.Expression:
        if word.text == "finished":
            self._tokens.expect("within")
            return tree.Finished(self._limit())
        condition = self._condition()
        if word.text == "always":
            return tree.Always(condition)
        if word.text == "finally":
            return tree.Finally(condition)
        return tree.Eventually(condition, self._limit() if self._tokens.skip("within") else None)

    def _limit(self) -> float:
        """Seconds after the start, more than none."""
        token = self._tokens.peek()
        before = len(self._semantics.findings)
        value = self._operands.quantity(DURATION)
        if value <= 0.0 and len(self._semantics.findings) == before:
            place = (token.start, token.end)
            self._semantics.findings.append(errors.before_the_start(self._text, place))
        return value

    def _statistic(self, first: Token) -> tree.Condition:
        self._operands.statistics_allowed = True
        condition = self._condition()
        if self._semantics.findings or _is_statistic(condition):
            return condition
        place = (first.start, self._tokens.behind())
        finding = errors.timeless
        if self._operands.has_statistics:
            alone = isinstance(condition, tree.Compare)
            finding = errors.momentary if alone else errors.joined_statistics
        self._semantics.findings.append(finding(self._text, place))
        return condition

    def _condition(self) -> tree.Condition:
        parts = [self._both()]
        while self._tokens.skip("or"):
            parts.append(self._both())
        return parts[0] if len(parts) == 1 else tree.Or(tuple(parts))

    def _both(self) -> tree.Condition:
        parts = [self._single()]
        while self._tokens.skip("and"):
            parts.append(self._single())
        return parts[0] if len(parts) == 1 else tree.And(tuple(parts))

    def _single(self) -> tree.Condition:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise errors.too_deep(self._text, self._tokens.peek(), MAX_DEPTH)
        try:
            first, second = self._tokens.peek(), self._tokens.peek(1)
            if first.text == "not":
                self._tokens.take()
                return tree.Not(self._single())
            if first.text == "(":
                self._tokens.take()
                inner = self._condition()
                self._tokens.expect(")")
                return inner
            if second.text == "in":
                return self._in_state()
            if first.text in _QUANTIFIERS and second.kind == "name":
                return self._group_in_state()
            return self._comparison()
        finally:
            self._depth -= 1

    def _in_state(self) -> tree.Condition:
        vehicle = self._semantics.vehicle(self._tokens.name("a vehicle"))
        self._tokens.expect("in")
        return tree.InState(vehicle, self._semantics.state(vehicle, self._tokens.name("a state")))

    def _group_in_state(self) -> tree.Condition:
        quantifier = cast(tree.Quantifier, self._tokens.take().text)
        name = self._tokens.name("a group")
        vehicles = self._semantics.group(name)
        self._tokens.expect("in")
        token, before = self._tokens.name("a state"), len(self._semantics.findings)
        for vehicle in vehicles:
            if len(self._semantics.findings) == before:
                self._semantics.state(vehicle, token)
        return tree.GroupInState(quantifier, name.text, vehicles, token.text)

    def _comparison(self) -> tree.Condition:
        left = self._operands.operand()
        operator = self._tokens.operator()
        right = self._operands.operand()
        if self._tokens.peek().kind == "operator":
            raise errors.unreadable(self._text, self._tokens.peek(), "`and`, `or` or the end")
        compare = self._semantics.compared(left, operator, right)
        if not isinstance(compare, tree.Compare):
            return compare
        if isinstance(compare.left, tree.Quantity) and isinstance(compare.right, tree.Aggregate):
            return self._semantics.compared(right, FLIPPED[operator], left)
        return compare


class _Operands:
    """The grammar of one side of a comparison. A statistic is allowed in an expectation without
    `always`, `eventually` or `finally`; `has_statistics` once there is one."""

    def __init__(self, tokens: _Cursor, semantics: Semantics) -> None:
        self._tokens, self._semantics = tokens, semantics
        self._text, self._scope = semantics.text, semantics.scope
        self.statistics_allowed = False
        self.has_statistics = False

    def quantity(self, dimension: Dimension) -> float:
        """A quantity of `dimension`, in SI."""
        token = self._tokens.peek()
        if token.kind != "quantity":
            raise errors.unreadable(self._text, token, f"a {dimension.name}")
        self._tokens.take()
        return self._semantics.measured(token.text, (token.start, token.end), dimension, "")

    def operand(self) -> Operand:
        """Parse one side of a comparison. The name of a function is one only before a bracket."""
        token = self._tokens.peek()
        if token.kind == "quantity":
            self._tokens.take()
            return Operand(token.text, token.start, token.end)
        if token.kind != "name":
            raise errors.unreadable(self._text, token, "a name or a quantity")
        if self._tokens.peek(1).text == "(":
            return self._call(self._tokens.take())
        return self._path(self._tokens.take())

    def _path(self, token: Token) -> Operand:
        node, dimension = self._meaning(token)
        return Operand(token.text, token.start, token.end, node, dimension)

    def _meaning(self, token: Token) -> tuple[tree.Value | None, Dimension | None]:
        """The value that a dotted name reads, with its dimension; (None, None) for one that may be
        a bare word."""
        if token.text == "time" and self._scope.kind != "health":
            return tree.MissionTime(), DURATION
        if self._scope.kind == "health":
            name = HEALTH.get(token.text)
            return (tree.Read(None, name), OBSERVABLES[name].dimension) if name else (None, None)
        first, _, rest = token.text.partition(".")
        if token.text in OBSERVABLES and self._scope.own is not None:
            return self._read(None, token.text, token)
        if first in self._scope.vehicles and rest in OBSERVABLES:
            return self._read(first, rest, token)
        if rest in self._scope.inputs.get(first, ()):
            return tree.Axis(first, rest), NUMBER
        return None, None

    def _read(
        self, vehicle: str | None, name: str, token: Token
    ) -> tuple[tree.Read, Dimension | None]:
        if name.partition(".")[0] == "payload":
            self._semantics.payload(vehicle or self._scope.own or "", token)
        return tree.Read(vehicle, name), OBSERVABLES[name].dimension

    def _call(self, token: Token) -> Operand:
        self._tokens.expect("(")
        node: tree.Value | tree.Aggregate
        dimension: Dimension | None = LENGTH
        before = len(self._semantics.findings)
        if token.text == "distance":
            node = self._distance()
        elif token.text == "separation":
            node = self._separation(token)
        elif token.text in _FUNCTIONS:
            node, dimension = self._aggregate(token)
        else:
            message = f"there is no function `{token.text}`"
            self._semantics.unknown(token, message, [*_FUNCTIONS, "distance", "separation"])
            raise errors.Unreadable(self._semantics.findings.pop())
        self._tokens.expect(")")
        source = self._text.text[token.start : self._tokens.behind()]
        is_broken = len(self._semantics.findings) > before
        return Operand(source, token.start, self._tokens.behind(), node, dimension, is_broken)

    def _distance(self) -> tree.Distance:
        a = self._place()
        self._tokens.expect("to")
        return tree.Distance(a, self._place())

    def _place(self) -> tree.Location:
        if self._tokens.skip("["):
            point = (self.quantity(LENGTH), self.quantity(LENGTH), self.quantity(LENGTH))
            self._tokens.expect("]")
            return tree.Location(None, point=point)
        token = self._tokens.name("a vehicle or a point")
        if token.text == "start" and self._scope.own is not None:
            return tree.Location(None, start=True)
        if token.text.startswith(PREFIX):
            return tree.Location(None, point=self._semantics.point(token))
        own = "payload" if token.text.endswith(".payload") else "start"
        name = token.text.removesuffix(f".{own}")
        self._semantics.vehicle(Token("name", name, token.start, token.start + len(name)))
        if name == token.text:
            return tree.Location(name)
        if own == "start":
            return tree.Location(name, start=True)
        self._semantics.payload(name, token)
        if self._scope.kind != "expectation":
            place = (token.start, token.end)
            self._semantics.findings.append(
                errors.known_to_the_simulator(self._text, place, token.text)
            )
        return tree.Location(name, payload=True)

    def _separation(self, function: Token) -> tree.Separation:
        first = self._tokens.name("a vehicle, a group or `all`")
        if first.text == "all" and "all" not in self._scope.vehicles:
            vehicles = list(self._scope.vehicles)
        else:
            vehicles = [*self._some(first)]
            while self._tokens.skip("and"):
                vehicles += self._some(self._tokens.name("a vehicle or a group"))
        if len(set(vehicles)) < 2:
            place = (function.start, self._tokens.behind())
            message = "a separation needs two vehicles"
            way_out = "write `separation(a and b)` or `separation(all)`"
            found = errors.mismatch(self._text, place, message, "one vehicle", way_out)
            self._semantics.findings.append(found)
        return tree.Separation(tuple(dict.fromkeys(vehicles)))

    def _some(self, token: Token) -> tuple[str, ...]:
        return self._scope.groups.get(token.text) or (self._semantics.vehicle(token),)

    def _aggregate(self, token: Token) -> tuple[tree.Aggregate, Dimension | None]:
        self.has_statistics = True
        if not self.statistics_allowed:
            place = (token.start, token.end)
            self._semantics.findings.append(
                errors.misplaced_statistic(self._text, place, token.text)
            )
        inner = self.operand()
        node = inner.node
        vehicle = _subject(node)
        if (
            not isinstance(node, tree.Read | tree.Distance | tree.Separation)
            or inner.dimension is None
        ):
            node = self._no_statistic(inner)
        state = None
        if self._tokens.skip("in"):
            state = self._semantics.state(vehicle or "", self._tokens.name("a state"))
            if vehicle is None and inner.node is not None and not inner.is_broken:
                message = f"`{inner.source}` belongs to no one vehicle that could be in `{state}`"
                self._semantics.mismatch(inner, message, "of no one vehicle", "leave `in ...` away")
        function = cast(tree.Function, token.text)
        return tree.Aggregate(function, node, vehicle if state else None, state), inner.dimension

    def _no_statistic(self, inner: Operand) -> tree.Read:
        if inner.node is None and not is_quantity(inner):
            self._semantics.unknown_name(inner)
        else:
            message = f"there is no statistic of `{inner.source}`"
            self._semantics.mismatch(inner, message, "not measured in numbers", "")
        return tree.Read(None, "elapsed")


class _Cursor:
    """Walks along the tokens of a text. Raises Unreadable where another token is needed."""

    def __init__(self, text: Text) -> None:
        self._text = text
        tokens = tokens_of(text.text)
        self._tokens = [*tokens, tokens[-1]]  # so that there is always one ahead
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
            raise errors.unreadable(self._text, self.peek(), f"`{word}`")

    def behind(self) -> int:
        """Where the last token that was taken ends."""
        return self._tokens[self._next - 1].end if self._next else 0

    def name(self, what: str) -> Token:
        if self.peek().kind != "name":
            raise errors.unreadable(self._text, self.peek(), what)
        return self.take()

    def operator(self) -> tree.ComparisonOperator:
        token = self.peek()
        if token.kind != "operator":
            raise errors.unreadable(self._text, token, "a comparison such as `<`")
        return cast(tree.ComparisonOperator, self.take().text)


def _is_statistic(condition: tree.Condition) -> bool:
    return (
        isinstance(condition, tree.Compare)
        and isinstance(condition.left, tree.Aggregate)
        and isinstance(condition.right, tree.Aggregate | tree.Quantity)
    )


def _subject(node: object) -> str | None:
    """The vehicle that a value is about: of a distance, the first that is named."""
    if isinstance(node, tree.Read):
        return node.vehicle
    if isinstance(node, tree.Distance):
        return node.a.vehicle or node.b.vehicle
    return None
