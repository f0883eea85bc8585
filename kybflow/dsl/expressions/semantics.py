"""The meaning of an expression: names must exist, quantities must have a dimension, and the two
sides of a comparison must fit together. Everything else is reported."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from kybflow.core import units
from kybflow.core.errors import UnitError
from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.text import did_you_mean
from kybflow.core.units import NUMBER, RATIO, Dimension, article, parse_quantity
from kybflow.dsl.diagnostics import PREFIX, Collector, Text, goals_like
from kybflow.dsl.expressions.tokens import Token
from kybflow.dsl.expressions.tree import (
    Aggregate,
    Clearance,
    Compare,
    ComparisonOperator,
    Condition,
    InState,
    Not,
    ObjectRead,
    Quantity,
    Read,
    Value,
    Word,
)
from kybflow.parts.observables import (
    NOTHING,
    OBJECT_OBSERVABLES,
    OBSERVABLES,
    ObjectObservable,
    Observable,
    chains_of,
)

_OBSTACLES = "world.obstacles."
_MOST_NAMES = 6
"""The most names in a hint."""
HEALTH: Mapping[str, str] = {"age": "estimate.age", "spread": "estimate.spread"}
"""The names that an estimator's health may read, and the observable that each stands for."""


class ObjectNames(NamedTuple):
    """What may be read of an object: its values, and its surfaces as places."""

    values: Collection[str]
    surfaces: Collection[str]


@dataclass(frozen=True, slots=True)
class Scope:
    """The names that an expression may use.

    vehicles: the states of each vehicle, including the built-in ones. own: the vehicle whose
    expression it is; None in an expectation and in a flow. estimators: those of each vehicle.
    points: those of the world. groups: the vehicles of each group. carriers: the vehicles with a
    payload. obstacles: those of the world, and for each whether vehicles keep away from it.
    objects: those of the world that move. inputs: the axes of each input.
    """

    kind: Literal["condition", "health", "expectation"]
    vehicles: Mapping[str, Collection[str]]
    own: str | None = None
    estimators: Mapping[str, Collection[str]] = field(default_factory=dict)
    points: Mapping[str, Vec3] = field(default_factory=dict)
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    carriers: Collection[str] = ()
    obstacles: Mapping[str, bool] = field(default_factory=dict)
    objects: Mapping[str, ObjectNames] = field(default_factory=dict)
    inputs: Mapping[str, Collection[str]] = field(default_factory=dict)
    read: dict[Text, Any] = field(default_factory=dict, compare=False, repr=False)
    """A cache of the texts parsed in this scope, since several checks need them."""

    @property
    def a_vehicle(self) -> str:
        """The name of a vehicle, for hints."""
        return next(iter(self.vehicles), "VEHICLE")


def observable_of(value: Read | ObjectRead) -> Observable | ObjectObservable:
    """Return the declaration of a value of a vehicle or of an object."""
    if isinstance(value, Read):
        return OBSERVABLES[value.name]
    return OBJECT_OBSERVABLES[value.name]


def is_direction(value: object) -> bool:
    """Return whether a value is a direction, which jumps from its largest to its least."""
    return isinstance(value, Read | ObjectRead) and observable_of(value).wraps


class Operand(NamedTuple):
    """One side of a comparison as written. node: its value; None for a quantity or a bare word,
    whose meaning depends on the other side. is_broken: whether an error in it is already
    reported."""

    token: Token
    node: Value | Aggregate | None = None
    dimension: Dimension | None = None
    is_broken: bool = False

    @property
    def source(self) -> str:
        return self.token.text


STAND_IN = Quantity(0.0, NUMBER)
"""Takes the place of a value whose error is already reported."""


class Semantics:
    """Checks the names, types and units of one expression. Unknown names and wrong units are
    reported and replaced by a stand-in, so that the rest can be checked."""

    def __init__(self, text: Text, scope: Scope, found: Collector) -> None:
        self._text = text
        self._scope = scope
        self._found = found

    def report(self, code: str, token: Token, message: str, label: str, help: str = "") -> None:
        span = self._text.part(token.start, token.end)
        self._found.report(code, message, span, label, help=help)

    def report_unknown(self, token: Token, message: str, known: Collection[str]) -> None:
        """Report a name that doesn't exist. known: the names that exist."""
        name = token.text
        inside = [f"`{k}`" for k in known if k.startswith(f"{name}.") or k == PREFIX + name]
        if len(inside) > 1:
            hint = f"write one of {', '.join(inside[:_MOST_NAMES])}"
        else:
            hint = f"did you mean {inside[0]}?" if inside else did_you_mean(name, known)
        self.report("KYB211", token, message, "unknown", hint)

    def vehicle(self, token: Token) -> str:
        name, scope = token.text, self._scope
        if name in scope.groups:
            message = f"`{name}` is a group, and one vehicle is needed"
            hint = f"write `all {name} in STATE` or `any {name} in STATE`"
            self.report("KYB212", token, message, "several vehicles", hint)
        elif name in scope.obstacles:
            message = f"`{name}` is an obstacle, and a vehicle is needed"
            hint = f"write `distance({scope.a_vehicle} to {name})` for how near it is"
            self.report("KYB212", token, message, "an obstacle", hint)
        elif name in scope.objects:
            message = f"`{name}` is an object, and a vehicle is needed"
            self.report("KYB212", token, message, "an object", "name a vehicle")
        elif name not in scope.vehicles:
            is_point = name in scope.points
            known = (
                [f"{PREFIX}{name}"]
                if is_point
                else [*scope.vehicles, *scope.obstacles, *scope.objects]
            )
            self.report_unknown(token, f"there is no vehicle `{name}`", known)
        return name

    def point(self, token: Token) -> Vec3:
        """Return the coordinates of `world.points.NAME`, m; report an unknown point."""
        name, points = token.text.removeprefix(PREFIX), self._scope.points
        if name not in points:
            place = Token("name", name, token.end - len(name), token.end)
            self.report_unknown(place, f"the world has no point `{name}`", points)
        return points.get(name, ZERO)

    def obstacle(self, token: Token) -> str | None:
        """Return the obstacle that `NAME` or `world.obstacles.NAME` names, or None if the token
        names something else; report an unknown obstacle."""
        name, obstacles = token.text.removeprefix(_OBSTACLES), self._scope.obstacles
        if name in obstacles:
            return name
        if name == token.text:
            return None
        place = Token("name", name, token.end - len(name), token.end)
        self.report_unknown(place, f"the world has no obstacle `{name}`", obstacles)
        return name

    def surface(self, name: str, surface: str, token: Token) -> None:
        """Report an unknown surface of an object."""
        known = self._scope.objects[name].surfaces
        if surface and surface not in known:
            place = token._replace(text=surface, start=token.end - len(surface))
            self.report_unknown(place, f"`{name}` has no surface `{surface}`", known)

    def clearance(self, function: Token, vehicle: Token) -> Clearance:
        """Return the clearance of a vehicle from the obstacles that it keeps away from; report if
        there is none."""
        kept = tuple(name for name, is_kept in self._scope.obstacles.items() if is_kept)
        if not kept:
            message = "the world has no obstacle from which to keep clear"
            hint = "write one under `obstacles` of the `world`, without `contact: allowed`"
            self.report("KYB211", function, message, "from nothing", hint)
        return Clearance(self.vehicle(vehicle), kept)

    def payload(self, vehicle: str, token: Token) -> None:
        """Report an expression that reads the payload of a vehicle without one."""
        if vehicle in self._scope.vehicles and vehicle not in self._scope.carriers:
            hint = f"give `{vehicle}` one: `payload: {{mass: 200 g, size: 10 cm}}`"
            self.report("KYB211", token, f"`{vehicle}` carries no payload", "unknown", hint)

    def group(self, token: Token) -> tuple[str, ...]:
        groups = self._scope.groups
        if token.text not in groups:
            self.report_unknown(token, f"there is no group `{token.text}`", groups)
        return groups.get(token.text, ())

    def state(self, vehicle: str, token: Token) -> str:
        states = self._scope.vehicles.get(vehicle)
        if states is not None and token.text not in states:
            message = f"`{vehicle}` has no state `{token.text}`"
            self.report_unknown(token, message, goals_like(token.text, states))
        return token.text

    def measured(self, token: Token, dimension: Dimension, label: str) -> float:
        """Return the quantity `token` in SI; report any other text."""
        try:
            return parse_quantity(token.text, dimension)
        except UnitError as error:
            self.report("KYB212", token, str(error), label, error.hint)
            return 0.0

    def unknown_name(self, side: Operand, other: Operand | None = None) -> None:
        """Report the unknown part of a dotted name: all of it, or what follows the vehicle or
        input. other: the other side of the comparison."""
        token, scope = side.token, self._scope
        first, _, rest = token.text.partition(".")
        inner = token._replace(text=rest, start=token.end - len(rest))
        if first in scope.vehicles and rest:
            known = _fitting(rest, OBSERVABLES, other)
            self.report_unknown(inner, f"`{rest}` of `{first}` is unknown", known)
        elif first in scope.groups and rest in OBSERVABLES:
            message = f"`{first}` is a group, and `{rest}` is one vehicle's"
            hint = f"write it of each: {of_each(scope.groups[first], f'{rest} ...')}"
            self.report("KYB212", token, message, "several vehicles", hint)
        elif token.text in OBSERVABLES and scope.kind != "health":
            message = f"`{token.text}` belongs to a vehicle, but none is named"
            hint = f"write `{scope.a_vehicle}.{token.text}`"
            if token.text == "elapsed":
                hint += (
                    ", the time in its behavior; `time` is the time since the start, and"
                    " `after: 5 s` in a `next` the time in a phase"
                )
            self.report("KYB211", token, message, "of which vehicle?", hint)
        elif (named := token.text.removeprefix(_OBSTACLES).split(".")[0]) in scope.obstacles:
            message = f"`{named}` is an obstacle, of which only distances can be read"
            hint = f"write `distance({scope.a_vehicle} to {named})`"
            self.report("KYB212", token, message, "an obstacle", hint)
        elif first in scope.objects:
            known = scope.objects[first].values
            if rest:
                self.report_unknown(inner, f"`{rest}` of `{first}` is unknown", known)
            else:
                message = f"`{first}` is an object, and one of its values is needed"
                hint = f"write one of {', '.join(f'`{first}.{value}`' for value in known)}"
                self.report("KYB212", token, message, "an object", hint)
        elif first in scope.inputs and rest:
            self.report_unknown(inner, f"`{first}` has no axis `{rest}`", scope.inputs[first])
        else:
            own = list(OBSERVABLES) if scope.own is not None else []
            others = [f"{v}.{name}" for v in scope.vehicles for name in OBSERVABLES]
            axes = [f"{name}.{axis}" for name, axes in scope.inputs.items() for axis in axes]
            of_objects = [f"{n}.{v}" for n, one in scope.objects.items() for v in one.values]
            readable = (
                [*own, "time", *others, *of_objects, *axes]
                if scope.kind != "health"
                else list(HEALTH)
            )
            known = _fitting(token.text, readable, other)
            self.report_unknown(token, f"`{token.text}` is unknown", known)

    def compared(self, left: Operand, operator: ComparisonOperator, right: Operand) -> Condition:
        """Return the comparison of two sides; report them if they can't be compared. `behavior ==
        CHAIN` holds in every state of the chain."""
        a, b = left.node, right.node
        if left.is_broken or right.is_broken:
            return Compare(operator, STAND_IN, STAND_IN)
        if a is None and b is None:
            words = [side for side in (left, right) if not is_quantity(side)]
            for word in words:
                self.unknown_name(word, right if word is left else left)
            if not words:
                message = "both sides are written out: this never changes"
                hint = "compare with something that is measured"
                self.report("KYB212", left.token, message, "a constant", hint)
            return Compare(operator, STAND_IN, STAND_IN)
        a = a if a is not None else self._beside(left, right)
        b = b if b is not None else self._beside(right, left)
        is_mixed = left.dimension is not right.dimension
        if left.node is not None and right.node is not None and is_mixed:
            own, other = type_name(left.dimension), type_name(right.dimension)
            message = f"`{left.source}` is {own}, but `{right.source}` is {other}"
            hint = f"compare `{left.source}` with {own}"
            self.report("KYB212", right.token, message, "can't be compared", hint)
        if operator not in ("==", "!=") and left.dimension is right.dimension is None:
            message = "names are compared with `==` and `!=`"
            hint = f"write `{left.source} == {right.source}`"
            self.report("KYB212", right.token, message, "names have no order", hint)
        return self._in_chain(a, operator, b) or Compare(operator, a, b)

    def _in_chain(self, a: object, operator: ComparisonOperator, b: object) -> Condition | None:
        read, word = (a, b) if isinstance(a, Read) else (b, a)
        if not isinstance(read, Read) or not isinstance(word, Word) or read.name != "behavior":
            return None
        vehicle = read.vehicle or self._scope.own or ""
        states = self._scope.vehicles.get(vehicle, ())
        if not any(word.text in chains_of(state) for state in states):
            return None
        inside = InState(vehicle, word.text)
        if operator == "==":
            return inside
        return Not(inside) if operator == "!=" else None

    def _beside(self, side: Operand, other: Operand) -> Value:
        """Return the value of a quantity or a bare word, whose dimension is that of the other
        side."""
        is_of = f"`{other.source}` is {type_name(other.dimension)}"
        if is_quantity(side) and other.dimension is not None:
            value = self.measured(side.token, other.dimension, is_of)
            if other.dimension is RATIO and not 0.0 <= value <= 1.0:
                message = f"`{other.source}` is never more than 100 % or less than 0 %"
                hint = "write a value from 0 % to 100 %"
                if side.source.isdecimal() and value <= 100.0:
                    hint = f"`{side.source} %` is meant: a bare number is a share, and 1 is 100 %"
                self.report("KYB215", side.token, message, "never reached", hint)
            return Quantity(value, other.dimension)
        if is_quantity(side):
            message = f"{is_of}, but `{side.source}` is a quantity"
            self.report("KYB212", side.token, message, "a name is needed")
        elif other.dimension is None and isinstance(other.node, Read):
            return self._word(side.token, other.node)
        else:
            self.unknown_name(side)
        return STAND_IN

    def _word(self, token: Token, read: Read) -> Word:
        vehicle = read.vehicle or self._scope.own or ""
        known: Collection[str] | None = None
        if read.name == "behavior":
            known = self._scope.vehicles.get(vehicle)
        elif read.name == "estimator":
            known = self._scope.estimators.get(vehicle)
        words = OBSERVABLES[read.name].words
        if read.name == "contact":
            words = (*self._scope.objects, NOTHING)
        if words and token.text not in words:
            self.report_unknown(token, f"`{read.name}` is never `{token.text}`", words)
        if known is not None and token.text not in known:
            message = f"`{vehicle}` has no {read.name} `{token.text}`"
            self.report_unknown(token, message, known)
        return Word(token.text)


def of_each(vehicles: Collection[str], rest: str, word: str = "and") -> str:
    """Return a condition about the value `rest` of each vehicle, for a hint."""
    shown = f" {word} ".join(f"{vehicle}.{rest}" for vehicle in list(vehicles)[:_MOST_EACH])
    return f"`{shown}{' ...' if len(vehicles) > _MOST_EACH else ''}`"


_MOST_EACH = 3


def _fitting(name: str, known: Collection[str], other: Operand | None) -> Collection[str]:
    """Return the names in `known` that extend `name` (such as `battery.remaining` for `battery`).
    If the other side of the comparison is a quantity, return only those of its dimension. If there
    are none, return all of `known`."""
    members = [one for one in known if one.startswith(f"{name}.") and one in OBSERVABLES]
    if other is None or not is_quantity(other):
        return members or known
    dimensions = {one: OBSERVABLES[one].dimension for one in members}
    return [o for o, d in dimensions.items() if d and units.is_quantity(other.source, d)] or known


def is_quantity(side: Operand) -> bool:
    return side.node is None and (side.source[0] in "+-." or side.source[0].isdigit())


def type_name(dimension: Dimension | None) -> str:
    return "a name" if dimension is None else article(dimension.name)
