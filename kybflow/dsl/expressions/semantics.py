"""What an expression means: names that must exist, quantities that must have a dimension, and the
two sides of a comparison, which must fit together. What does not becomes a finding."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from kybflow.core.errors import UnitError
from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.units import NUMBER, RATIO, Dimension, article, parse_quantity
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, goals_like
from kybflow.dsl.diagnostics.spans import PREFIX, Text
from kybflow.dsl.expressions import errors
from kybflow.dsl.expressions.tokens import Token
from kybflow.dsl.expressions.tree import (
    Aggregate,
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

HEALTH: Mapping[str, str] = {"age": "estimate.age", "spread": "estimate.spread"}
"""What an estimator's health may read, and the observable it stands for."""


@dataclass(frozen=True, slots=True)
class Scope:
    """What an expression may name. `vehicles` maps each to its states (the built-in ones too);
    `own` is the vehicle that asks, None in an expectation and in a flow; `estimators` each
    vehicle's; `points` those of the world; `groups` maps each to its vehicles; `carriers` are the
    vehicles with a payload; `inputs` maps each to its axes."""

    kind: Literal["condition", "health", "expectation"]
    vehicles: Mapping[str, Collection[str]]
    own: str | None = None
    estimators: Mapping[str, Collection[str]] = field(default_factory=dict)
    points: Mapping[str, Vec3] = field(default_factory=dict)
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    carriers: Collection[str] = ()
    inputs: Mapping[str, Collection[str]] = field(default_factory=dict)
    read: dict[Text, Any] = field(default_factory=dict, compare=False, repr=False)
    """What was parsed in this scope; several checks ask for the same."""


class Operand(NamedTuple):
    """One side of a comparison as written. `node` is None for a quantity and for a bare word, whose
    meanings depend on the other side. A broken one has its finding already."""

    source: str
    start: int
    end: int
    node: Value | Aggregate | None = None
    dimension: Dimension | None = None
    is_broken: bool = False


STAND_IN = Quantity(0.0, NUMBER)
"""Stands where a finding says why there is nothing."""


class Semantics:
    """Judges the names, types and units of one expression. Unknown names and wrong units become
    findings, with a stand-in for what they should be, so that the rest is judged too."""

    def __init__(self, text: Text, scope: Scope) -> None:
        self.text = text
        self.scope = scope
        self.findings: list[Diagnostic] = []

    def vehicle(self, token: Token) -> str:
        if token.text in self.scope.groups:
            message = f"`{token.text}` is a group, and one vehicle is needed"
            self.findings.append(errors.group_for_one(self.text, token, message))
        elif token.text not in self.scope.vehicles:
            message = f"there is no vehicle `{token.text}`"
            place = f"{PREFIX}{token.text}"
            known = {place: ()} if token.text in self.scope.points else self.scope.vehicles
            self.unknown(token, message, known)
        return token.text

    def point(self, token: Token) -> Vec3:
        """The coordinates of `world.points.NAME`."""
        name = token.text.removeprefix(PREFIX)
        if name not in self.scope.points:
            place = Token("name", name, token.end - len(name), token.end)
            self.unknown(place, f"the world has no point `{name}`", self.scope.points)
        return self.scope.points.get(name, ZERO)

    def payload(self, vehicle: str, token: Token) -> None:
        """A vehicle whose payload is asked for must have one."""
        if vehicle in self.scope.vehicles and vehicle not in self.scope.carriers:
            place = (token.start, token.end)
            self.findings.append(errors.no_payload(self.text, place, vehicle))

    def group(self, token: Token) -> tuple[str, ...]:
        if token.text not in self.scope.groups:
            message = f"there is no group `{token.text}`"
            self.unknown(token, message, self.scope.groups)
        return self.scope.groups.get(token.text, ())

    def state(self, vehicle: str, token: Token) -> str:
        states = self.scope.vehicles.get(vehicle)
        if states is not None and token.text not in states:
            message = f"`{vehicle}` has no state `{token.text}`"
            self.unknown(token, message, goals_like(token.text, states))
        return token.text

    def measured(
        self, source: str, place: tuple[int, int], dimension: Dimension, label: str
    ) -> float:
        try:
            return parse_quantity(source, dimension)
        except UnitError as error:
            found = errors.mismatch(self.text, place, str(error), label, error.hint)
            self.findings.append(found)
            return 0.0

    def _readable(self) -> list[str]:
        """Every name that a value can be read from here, for suggestions."""
        if self.scope.kind == "health":
            return list(HEALTH)
        own = list(OBSERVABLES) if self.scope.own is not None else []
        others = [f"{v}.{name}" for v in self.scope.vehicles for name in OBSERVABLES]
        axes = [f"{name}.{axis}" for name, axes in self.scope.inputs.items() for axis in axes]
        return [*own, "time", *others, *axes]

    def unknown_name(self, side: Operand, other: Operand | None = None) -> None:
        """Marks what is unknown of a dotted name: all of it, or what follows a vehicle. `other` is
        what it is compared with."""
        first, _, rest = side.source.partition(".")
        token = Token("name", side.source, side.start, side.end)
        if first in self.scope.vehicles and rest:
            token = Token("name", rest, side.end - len(rest), side.end)
            message = f"`{rest}` of `{first}` is unknown"
            self.unknown(token, message, _fitting(rest, OBSERVABLES, other))
        elif first in self.scope.inputs and rest:
            token = Token("name", rest, side.end - len(rest), side.end)
            message = f"`{rest}` is no axis of `{first}`"
            self.unknown(token, message, self.scope.inputs[first])
        else:
            known = _fitting(side.source, self._readable(), other)
            self.unknown(token, f"`{side.source}` is unknown", known)

    def unknown(self, token: Token, message: str, known: Collection[str]) -> None:
        place = (token.start, token.end)
        self.findings.append(errors.unknown(self.text, place, message, token.text, known))

    def mismatch(self, side: Operand, message: str, label: str, way_out: str) -> None:
        place = (side.start, side.end)
        self.findings.append(errors.mismatch(self.text, place, message, label, way_out))

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
            self.unknown_name(word, right if word is left else left)
        if not words:
            message = "both sides are written out: this never changes"
            self.mismatch(left, message, "a constant", "compare with something that is measured")
        return Compare(operator, STAND_IN, STAND_IN)

    def _beside(self, side: Operand, other: Operand) -> Value:
        """The value of a quantity or a bare word beside `other`, which gives it its dimension."""
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


def _fitting(name: str, known: Collection[str], other: Operand | None) -> Collection[str]:
    """Those of `known` that are of `name` (`battery.remaining` of `battery`) and of the dimension
    of `other`, where there are any; else all."""
    members = [one for one in known if one.startswith(f"{name}.") and one in OBSERVABLES]
    if other is None or not is_quantity(other):
        return members or known
    return [one for one in members if _can_be(other.source, OBSERVABLES[one].dimension)] or known


def _can_be(source: str, dimension: Dimension | None) -> bool:
    if dimension is None:
        return False
    try:
        parse_quantity(source, dimension)
    except UnitError:
        return False
    return True


def is_quantity(side: Operand) -> bool:
    return side.node is None and (side.source[0] in "+-." or side.source[0].isdigit())


def type_name(dimension: Dimension | None) -> str:
    return "a name" if dimension is None else article(dimension.name)
