"""Operands of a comparison: what they read, what type they have, whether two fit together.

operand   := quantity | 'time' | observable | VEHICLE '.' observable | word
           | 'distance' '(' place 'to' place ')' | 'separation' '(' all | NAME 'and' NAME ... ')'
           | ('mean'|'max'|'min'|'rms') '(' operand ['in' STATE] ')'
place     := VEHICLE | VEHICLE '.start' | 'start' | '[' x y z ']'
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, cast, get_args

from kybflow.dsl import expressions_errors as errors
from kybflow.dsl.diagnostics import Diagnostic
from kybflow.dsl.expressions_tokens import Token, tokens_of
from kybflow.dsl.expressions_tree import (
    Aggregate,
    Clock,
    Compare,
    Distance,
    Function,
    Number,
    Operator,
    Place,
    Read,
    Separation,
    Value,
    Word,
)
from kybflow.dsl.source import Text
from kybflow.errors import UnitError
from kybflow.observables import OBSERVABLES
from kybflow.units import DURATION, LENGTH, NUMBER, Dimension, parse_quantity

_HEALTH = {"age": "estimate.age", "spread": "estimate.spread"}
_FUNCTIONS = frozenset(get_args(Function))


@dataclass(frozen=True, slots=True)
class Scope:
    """What an expression may name. `vehicles` maps each to its states (the built-in ones too);
    `own` is the vehicle that asks, None in an expectation; `estimators` each vehicle's."""

    kind: Literal["condition", "health", "expectation"]
    vehicles: Mapping[str, Collection[str]]
    own: str | None = None
    estimators: Mapping[str, Collection[str]] = field(default_factory=dict)


class Operand(NamedTuple):
    """One side of a comparison as written. `node` is None for a quantity and for a bare word, whose
    meanings depend on the other side."""

    source: str
    start: int
    end: int
    node: Value | Aggregate | None = None
    dimension: Dimension | None = None


_STAND_IN = Number(0.0, NUMBER)


class Operands:
    """The lower half of the parser. Unknown names and wrong types become findings; only text that
    can't be read at all stops it, with Unreadable."""

    def __init__(self, text: Text, scope: Scope) -> None:
        self.text = text
        self.scope = scope
        self.findings: list[Diagnostic] = []
        self.statistics_allowed = False
        self.statistics_seen = False
        self._tokens = tokens_of(text.text)
        self._next = 0

    def peek(self, ahead: int = 0) -> Token:
        return self._tokens[min(self._next + ahead, len(self._tokens) - 1)]

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
            raise errors.unreadable(self.text, self.peek(), f"`{word}`")

    def behind(self) -> int:
        """Where the last token that was taken ends."""
        return self._tokens[self._next - 1].end if self._next else 0

    def name(self, what: str) -> Token:
        if self.peek().kind != "name":
            raise errors.unreadable(self.text, self.peek(), what)
        return self.take()

    def operator(self) -> Operator:
        token = self.peek()
        if token.kind != "operator":
            raise errors.unreadable(self.text, token, "a comparison such as `<`")
        return cast(Operator, self.take().text)

    def quantity(self, dimension: Dimension) -> float:
        token = self.peek()
        if token.kind != "quantity":
            raise errors.unreadable(self.text, token, f"a {dimension.name}")
        self.take()
        return self._measured(token.text, (token.start, token.end), dimension, "")

    def vehicle(self, token: Token) -> str:
        if token.text not in self.scope.vehicles:
            self._unknown(token, "vehicle", self.scope.vehicles)
        return token.text

    def state(self, vehicle: str, token: Token) -> str:
        states = self.scope.vehicles.get(vehicle)
        if states is not None and token.text not in states:
            self._unknown(token, f"the state of `{vehicle}`,", states)
        return token.text

    def operand(self) -> Operand:
        """One side. A function's name is one only before a bracket."""
        token = self.peek()
        if token.kind == "quantity":
            self.take()
            return Operand(token.text, token.start, token.end)
        if token.kind != "name":
            raise errors.unreadable(self.text, token, "a name or a quantity")
        if self.peek(1).text == "(":
            return self._call(self.take())
        return self._path(self.take())

    def compared(self, left: Operand, operator: Operator, right: Operand) -> Compare:
        """The comparison, its sides brought to one dimension."""
        a, b = left.node, right.node
        if a is None and b is None:
            return self._nothing_known(left, operator, right)
        a = a if a is not None else self._beside(left, right)
        b = b if b is not None else self._beside(right, left)
        if left.node is not None and right.node is not None:
            self._same_type(left, right)
        if operator not in ("==", "!=") and left.dimension is right.dimension is None:
            message = "names are compared with `==` and `!=`"
            self._mismatch(right, message, "names have no order", "")
        return Compare(operator, a, b)

    def _nothing_known(self, left: Operand, operator: Operator, right: Operand) -> Compare:
        words = [side for side in (left, right) if not _is_quantity(side)]
        for word in words:
            token = Token("name", word.source, word.start, word.end)
            self._unknown(token, "", self._names())
        if not words:
            message = "both sides are written out: this never changes"
            self._mismatch(left, message, "a constant", "compare with something that is measured")
        return Compare(operator, _STAND_IN, _STAND_IN)

    def _beside(self, side: Operand, other: Operand) -> Value:
        """What a quantity or a bare word means next to `other`."""
        place = (side.start, side.end)
        told = f"`{other.source}` is {_type_name(other.dimension)}"
        if _is_quantity(side) and other.dimension is not None:
            value = self._measured(side.source, place, other.dimension, told)
            return Number(value, other.dimension)
        if _is_quantity(side):
            self._mismatch(side, f"{told}, `{side.source}` is a quantity", "a quantity", "")
            return _STAND_IN
        token = Token("name", side.source, *place)
        if other.dimension is None and isinstance(other.node, Read):
            return self._word(token, other.node)
        self._unknown(token, "", self._names())
        return _STAND_IN

    def _word(self, token: Token, read: Read) -> Word:
        vehicle = read.vehicle or self.scope.own or ""
        known: Collection[str] | None = None
        if read.name == "behavior":
            known = self.scope.vehicles.get(vehicle)
        elif read.name == "estimator":
            known = self.scope.estimators.get(vehicle)
        if known is not None and token.text not in known:
            self._unknown(token, f"the {read.name} of `{vehicle}`,", known)
        return Word(token.text)

    def _same_type(self, left: Operand, right: Operand) -> None:
        if left.dimension is right.dimension:
            return
        a, b = _type_name(left.dimension), _type_name(right.dimension)
        message = f"`{left.source}` is {a}, but `{right.source}` is {b}"
        self._mismatch(right, message, b, "")

    def _measured(
        self, source: str, place: tuple[int, int], dimension: Dimension, label: str
    ) -> float:
        try:
            return parse_quantity(source, dimension)
        except UnitError as error:
            found = errors.mismatch(self.text, place, str(error), label, error.hint)
            self.findings.append(found)
            return 0.0

    def _path(self, token: Token) -> Operand:
        node, dimension = self._meaning(token)
        return Operand(token.text, token.start, token.end, node, dimension)

    def _meaning(self, token: Token) -> tuple[Value | None, Dimension | None]:
        """What a dotted name reads; (None, None) for one that may be a bare word."""
        if token.text == "time" and self.scope.kind != "health":
            return Clock(), DURATION
        if self.scope.kind == "health":
            name = _HEALTH.get(token.text)
            return (Read(None, name), OBSERVABLES[name].dimension) if name else (None, None)
        first, _, rest = token.text.partition(".")
        if token.text in OBSERVABLES and self.scope.own is not None:
            return Read(None, token.text), OBSERVABLES[token.text].dimension
        if first in self.scope.vehicles and rest in OBSERVABLES:
            return Read(first, rest), OBSERVABLES[rest].dimension
        return None, None

    def _names(self) -> list[str]:
        """Every name that could stand where a value is read."""
        if self.scope.kind == "health":
            return list(_HEALTH)
        own = list(OBSERVABLES) if self.scope.own is not None else []
        others = [f"{v}.{name}" for v in self.scope.vehicles for name in OBSERVABLES]
        return [*own, "time", *others]

    def _call(self, token: Token) -> Operand:
        self.expect("(")
        node: Value | Aggregate
        dimension: Dimension | None = LENGTH
        if token.text == "distance":
            node = self._distance()
        elif token.text == "separation":
            node = self._separation(token)
        elif token.text in _FUNCTIONS:
            node, dimension = self._aggregate(token)
        else:
            self._unknown(token, "the function", [*_FUNCTIONS, "distance", "separation"])
            raise errors.Unreadable(self.findings.pop())
        self.expect(")")
        source = self.text.text[token.start : self.behind()]
        return Operand(source, token.start, self.behind(), node, dimension)

    def _distance(self) -> Distance:
        a = self._place()
        self.expect("to")
        return Distance(a, self._place())

    def _place(self) -> Place:
        if self.skip("["):
            point = (self.quantity(LENGTH), self.quantity(LENGTH), self.quantity(LENGTH))
            self.expect("]")
            return Place(None, point=point)
        token = self.name("a vehicle or a point")
        if token.text == "start" and self.scope.own is not None:
            return Place(None, start=True)
        name = token.text.removesuffix(".start")
        end = token.start + len(name)
        self.vehicle(Token("name", name, token.start, end))
        return Place(name, start=name != token.text)

    def _separation(self, function: Token) -> Separation:
        first = self.name("a vehicle or `all`")
        if first.text == "all" and "all" not in self.scope.vehicles:
            vehicles = list(self.scope.vehicles)
        else:
            vehicles = [self.vehicle(first)]
            while self.skip("and"):
                vehicles.append(self.vehicle(self.name("a vehicle")))
        if len(set(vehicles)) < 2:
            place = (function.start, self.behind())
            message = "a separation needs two vehicles"
            way_out = "write `separation(a and b)` or `separation(all)`"
            found = errors.mismatch(self.text, place, message, "one vehicle", way_out)
            self.findings.append(found)
        return Separation(tuple(dict.fromkeys(vehicles)))

    def _aggregate(self, token: Token) -> tuple[Aggregate, Dimension | None]:
        self.statistics_seen = True
        if not self.statistics_allowed:
            place = (token.start, token.end)
            self.findings.append(errors.misplaced_statistic(self.text, place, token.text))
        inner = self.operand()
        node = inner.node
        vehicle = node.vehicle if isinstance(node, Read) else None
        if not isinstance(node, Read | Distance | Separation) or inner.dimension is None:
            node = self._no_statistic(inner)
        state = None
        if self.skip("in"):
            state = self.state(vehicle or "", self.name("a state"))
        function = cast(Function, token.text)
        return Aggregate(function, node, vehicle if state else None, state), inner.dimension

    def _no_statistic(self, inner: Operand) -> Read:
        if inner.node is None and not _is_quantity(inner):
            token = Token("name", inner.source, inner.start, inner.end)
            self._unknown(token, "", self._names())
        else:
            message = f"there is no statistic of `{inner.source}`"
            self._mismatch(inner, message, "not measured in numbers", "")
        return Read(None, "elapsed")

    def _unknown(self, token: Token, what: str, known: Collection[str]) -> None:
        place = (token.start, token.end)
        self.findings.append(errors.unknown(self.text, place, what, token.text, known))

    def _mismatch(self, side: Operand, message: str, label: str, way_out: str) -> None:
        place = (side.start, side.end)
        self.findings.append(errors.mismatch(self.text, place, message, label, way_out))


def _is_quantity(side: Operand) -> bool:
    return side.node is None and (side.source[0] in "+-." or side.source[0].isdigit())


def _type_name(dimension: Dimension | None) -> str:
    if dimension is None:
        return "a name"
    return f"{'an' if dimension.name[0] in 'aeiou' else 'a'} {dimension.name}"
