"""Operands of a comparison: what they read and what type they have.

operand   := quantity | 'time' | observable | VEHICLE '.' observable | word
           | 'distance' '(' place 'to' place ')' | 'separation' '(' all | some 'and' some ... ')'
           | ('mean'|'max'|'min'|'rms') '(' operand ['in' STATE] ')'
some      := VEHICLE | GROUP
place     := VEHICLE | VEHICLE '.start' | 'start' | VEHICLE '.payload' | 'world.points.' NAME
           | '[' x y z ']'
"""

from __future__ import annotations

from typing import cast, get_args

from kybflow.core.units import DURATION, LENGTH, Dimension
from kybflow.dsl.diagnostics.spans import PREFIX
from kybflow.dsl.expressions import errors
from kybflow.dsl.expressions.cursor import HEALTH, Operand, is_quantity
from kybflow.dsl.expressions.tokens import Token
from kybflow.dsl.expressions.tree import (
    Aggregate,
    Distance,
    Function,
    Location,
    MissionTime,
    Read,
    Separation,
    Value,
)
from kybflow.dsl.expressions.types import Types
from kybflow.parts.observables import OBSERVABLES

_FUNCTIONS = frozenset(get_args(Function))


class Operands(Types):
    """The upper third of the parser, below the grammar of conditions."""

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

    def _path(self, token: Token) -> Operand:
        node, dimension = self._meaning(token)
        return Operand(token.text, token.start, token.end, node, dimension)

    def _meaning(self, token: Token) -> tuple[Value | None, Dimension | None]:
        """What a dotted name reads; (None, None) for one that may be a bare word."""
        if token.text == "time" and self.scope.kind != "health":
            return MissionTime(), DURATION
        if self.scope.kind == "health":
            name = HEALTH.get(token.text)
            return (Read(None, name), OBSERVABLES[name].dimension) if name else (None, None)
        first, _, rest = token.text.partition(".")
        if token.text in OBSERVABLES and self.scope.own is not None:
            return self._read(None, token.text, token)
        if first in self.scope.vehicles and rest in OBSERVABLES:
            return self._read(first, rest, token)
        return None, None

    def _read(self, vehicle: str | None, name: str, token: Token) -> tuple[Read, Dimension | None]:
        if name.partition(".")[0] == "payload":
            self.payload(vehicle or self.scope.own or "", token)
        return Read(vehicle, name), OBSERVABLES[name].dimension

    def _call(self, token: Token) -> Operand:
        self.expect("(")
        node: Value | Aggregate
        dimension: Dimension | None = LENGTH
        before = len(self.findings)
        if token.text == "distance":
            node = self._distance()
        elif token.text == "separation":
            node = self._separation(token)
        elif token.text in _FUNCTIONS:
            node, dimension = self._aggregate(token)
        else:
            message = f"there is no function `{token.text}`"
            self.unknown(token, message, [*_FUNCTIONS, "distance", "separation"])
            raise errors.Unreadable(self.findings.pop())
        self.expect(")")
        source = self.text.text[token.start : self.behind()]
        is_broken = len(self.findings) > before
        return Operand(source, token.start, self.behind(), node, dimension, is_broken)

    def _distance(self) -> Distance:
        a = self._place()
        self.expect("to")
        return Distance(a, self._place())

    def _place(self) -> Location:
        if self.skip("["):
            point = (self.quantity(LENGTH), self.quantity(LENGTH), self.quantity(LENGTH))
            self.expect("]")
            return Location(None, point=point)
        token = self.name("a vehicle or a point")
        if token.text == "start" and self.scope.own is not None:
            return Location(None, start=True)
        if token.text.startswith(PREFIX):
            return Location(None, point=self.point(token))
        own = "payload" if token.text.endswith(".payload") else "start"
        name = token.text.removesuffix(f".{own}")
        self.vehicle(Token("name", name, token.start, token.start + len(name)))
        if name == token.text:
            return Location(name)
        if own == "start":
            return Location(name, start=True)
        self.payload(name, token)
        if self.scope.kind != "expectation":
            place = (token.start, token.end)
            self.findings.append(errors.known_to_the_simulator(self.text, place, token.text))
        return Location(name, payload=True)

    def _separation(self, function: Token) -> Separation:
        first = self.name("a vehicle, a group or `all`")
        if first.text == "all" and "all" not in self.scope.vehicles:
            vehicles = list(self.scope.vehicles)
        else:
            vehicles = [*self._some(first)]
            while self.skip("and"):
                vehicles += self._some(self.name("a vehicle or a group"))
        if len(set(vehicles)) < 2:
            place = (function.start, self.behind())
            message = "a separation needs two vehicles"
            way_out = "write `separation(a and b)` or `separation(all)`"
            found = errors.mismatch(self.text, place, message, "one vehicle", way_out)
            self.findings.append(found)
        return Separation(tuple(dict.fromkeys(vehicles)))

    def _some(self, token: Token) -> tuple[str, ...]:
        return self.scope.groups.get(token.text) or (self.vehicle(token),)

    def _aggregate(self, token: Token) -> tuple[Aggregate, Dimension | None]:
        self.statistics_seen = True
        if not self.statistics_allowed:
            place = (token.start, token.end)
            self.findings.append(errors.misplaced_statistic(self.text, place, token.text))
        inner = self.operand()
        node = inner.node
        vehicle = _subject(node)
        if not isinstance(node, Read | Distance | Separation) or inner.dimension is None:
            node = self._no_statistic(inner)
        state = None
        if self.skip("in"):
            state = self.state(vehicle or "", self.name("a state"))
            if vehicle is None and inner.node is not None and not inner.is_broken:
                message = f"`{inner.source}` belongs to no one vehicle that could be in `{state}`"
                self.mismatch(inner, message, "of no one vehicle", "leave `in ...` away")
        function = cast(Function, token.text)
        return Aggregate(function, node, vehicle if state else None, state), inner.dimension

    def _no_statistic(self, inner: Operand) -> Read:
        if inner.node is None and not is_quantity(inner):
            self.unknown_name(inner)
        else:
            message = f"there is no statistic of `{inner.source}`"
            self.mismatch(inner, message, "not measured in numbers", "")
        return Read(None, "elapsed")


def _subject(node: object) -> str | None:
    """The vehicle that a value is about: of a distance, the first that is named."""
    if isinstance(node, Read):
        return node.vehicle
    if isinstance(node, Distance):
        return node.a.vehicle or node.b.vehicle
    return None
