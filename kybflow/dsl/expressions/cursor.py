"""Walking along the tokens of an expression, and what is common to every rule of its grammar: names
that must exist, quantities that must have a dimension, findings."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, cast

from kybflow.core.errors import UnitError
from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.units import Dimension, parse_quantity
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, goals_like
from kybflow.dsl.diagnostics.spans import PREFIX, Text
from kybflow.dsl.expressions import errors
from kybflow.dsl.expressions.tokens import Token, tokens_of
from kybflow.dsl.expressions.tree import Aggregate, ComparisonOperator, Value
from kybflow.parts.observables import OBSERVABLES

HEALTH: Mapping[str, str] = {"age": "estimate.age", "spread": "estimate.spread"}
"""What an estimator's health may read, and the observable it stands for."""


@dataclass(frozen=True, slots=True)
class Scope:
    """What an expression may name. `vehicles` maps each to its states (the built-in ones too);
    `own` is the vehicle that asks, None in an expectation and in a flow; `estimators` each
    vehicle's; `points` those of the world; `groups` maps each to its vehicles; `carriers` are the
    vehicles with a payload."""

    kind: Literal["condition", "health", "expectation"]
    vehicles: Mapping[str, Collection[str]]
    own: str | None = None
    estimators: Mapping[str, Collection[str]] = field(default_factory=dict)
    points: Mapping[str, Vec3] = field(default_factory=dict)
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    carriers: Collection[str] = ()
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


class Cursor:
    """The lower third of the parser. Unknown names and wrong units become findings; only text that
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

    def operator(self) -> ComparisonOperator:
        token = self.peek()
        if token.kind != "operator":
            raise errors.unreadable(self.text, token, "a comparison such as `<`")
        return cast(ComparisonOperator, self.take().text)

    def quantity(self, dimension: Dimension) -> float:
        token = self.peek()
        if token.kind != "quantity":
            raise errors.unreadable(self.text, token, f"a {dimension.name}")
        self.take()
        return self.measured(token.text, (token.start, token.end), dimension, "")

    def vehicle(self, token: Token) -> str:
        if token.text in self.scope.groups:
            message = f"`{token.text}` is a group, and one vehicle is needed"
            self.findings.append(errors.group_for_one(self.text, token, message))
        elif token.text not in self.scope.vehicles:
            message = f"there is no vehicle `{token.text}`"
            self.unknown(token, message, self.scope.vehicles)
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

    def _names(self) -> list[str]:
        """Every name that could stand where a value is read."""
        if self.scope.kind == "health":
            return list(HEALTH)
        own = list(OBSERVABLES) if self.scope.own is not None else []
        others = [f"{v}.{name}" for v in self.scope.vehicles for name in OBSERVABLES]
        return [*own, "time", *others]

    def unknown_name(self, side: Operand) -> None:
        """Marks what is unknown of a dotted name: all of it, or what follows a vehicle."""
        first, _, rest = side.source.partition(".")
        token = Token("name", side.source, side.start, side.end)
        if first in self.scope.vehicles and rest:
            token = Token("name", rest, side.end - len(rest), side.end)
            self.unknown(token, f"`{rest}` of `{first}` is unknown", OBSERVABLES)
        else:
            self.unknown(token, f"`{side.source}` is unknown", self._names())

    def unknown(self, token: Token, message: str, known: Collection[str]) -> None:
        place = (token.start, token.end)
        self.findings.append(errors.unknown(self.text, place, message, token.text, known))

    def mismatch(self, side: Operand, message: str, label: str, way_out: str) -> None:
        place = (side.start, side.end)
        self.findings.append(errors.mismatch(self.text, place, message, label, way_out))


def is_quantity(side: Operand) -> bool:
    return side.node is None and (side.source[0] in "+-." or side.source[0].isdigit())
