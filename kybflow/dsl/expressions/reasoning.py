"""Prove facts about conditions that hold in any flight: whether a condition can hold, always holds,
or implies another.

A condition is converted to disjunctive normal form, (a and b) or (c and d) or ... A group can't
hold if its bounds on one value leave an empty interval, or if it requires two different names for
one value. Nothing is proven about a condition with more than `_MOST_GROUPS` groups.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import chain, combinations, pairwise, product
from math import hypot, inf
from types import MappingProxyType
from typing import NamedTuple

from kybflow.dsl.expressions import (
    And,
    Axis,
    Compare,
    Condition,
    GroupInState,
    InState,
    Location,
    MissionTime,
    Not,
    Or,
    Quantity,
    Read,
    Word,
    tree,
)
from kybflow.dsl.expressions.parse import FLIPPED
from kybflow.parts.observables import OBJECT_OBSERVABLES, OBSERVABLES, Envelope, is_in
from kybflow.world.shapes import Box

Bounds = Callable[[object], tuple[float, float]]
"""A function that returns the range (SI) that a value never leaves."""
_MOST_GROUPS = 64
_OPPOSITE: dict[tree.ComparisonOperator, tree.ComparisonOperator] = {
    "<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "==",
}  # fmt: skip


class _Fact(NamedTuple):
    """One comparison of a value with a bound. is_plain: whether it is not negated; a negated
    comparison also holds if the value is unknown."""

    value: object
    operator: tree.ComparisonOperator
    bound: float | str
    is_plain: bool


_Group = tuple[_Fact, ...]


class _TooManyError(Exception):
    """The normal form has more than `_MOST_GROUPS` groups."""


class Envelopes(NamedTuple):
    """The regions in which the vehicles are. of: the envelope of each vehicle by name; a vehicle
    without one may be anywhere. own: the vehicle whose condition is evaluated. obstacles: the box
    that contains each obstacle; one without a box is endless. joints: the range of each object's
    joint."""

    of: Mapping[str, Envelope]
    own: str | None = None
    obstacles: Mapping[str, Box] = MappingProxyType({})
    joints: Mapping[str, tuple[float, float]] = MappingProxyType({})

    def get(self, vehicle: str | None) -> Envelope | None:
        name = self.own if vehicle is None else vehicle
        return None if name is None else self.of.get(name)

    def box(self, place: Location) -> Box:
        """Return the box in which a location can be."""
        if place.point is not None:
            return Box(place.point, place.point)
        if place.obstacle is not None:
            return self.obstacles.get(place.obstacle, EVERYWHERE)
        if place.object is not None:
            return EVERYWHERE
        envelope = self.get(place.vehicle)
        if envelope is None:
            return EVERYWHERE
        if place.start or place.vehicle is None:
            return Box(envelope.start, envelope.start)
        around = Box(envelope.low, envelope.high)
        return around.grown(_PAYLOAD_DISTANCE) if place.payload else around

    def apart(self, value: tree.Distance | tree.Separation | tree.Clearance) -> tuple[float, float]:
        """Return the range of a distance. It may be negative only from an obstacle."""
        match value:
            case tree.Distance(a, b):
                near, far = _apart(self.box(a), self.box(b))
                is_solid = a.obstacle is not None or b.obstacle is not None
                return -inf if is_solid and near == 0.0 else near, far
            case tree.Separation(vehicles, obstacles):
                flown = [Location(vehicle) for vehicle in vehicles]
                solid = [Location(None, obstacle=obstacle) for obstacle in obstacles]
                pairs = chain(combinations(flown, 2), product(flown, solid))
                low, high = zip(*(self.apart(tree.Distance(a, b)) for a, b in pairs), strict=True)
                return min(low), min(high)
            case tree.Clearance(vehicle, obstacles):
                return -inf, self.apart(tree.Separation((vehicle,), obstacles))[1]


EVERYWHERE = Box((-inf, -inf, -inf), (inf, inf, inf))
ANYWHERE = Envelopes({})
_PAYLOAD_DISTANCE = (1.0, 1.0, 1.0)
"""How far from its vehicle a payload may be, on board or after it was released, along each axis,
m."""


def physical_bounds(
    longest: float, there: Envelopes = ANYWHERE, at_first: Bounds | None = None
) -> Bounds:
    """Return the bounds of values in a run of at most `longest` seconds whose vehicles stay in
    their envelopes: no speed or distance is negative, no ratio is above one, no time is longer than
    the run.

    there: the envelopes of the vehicles. at_first: the bounds of values in the first tick: the
    minimum over a run is at most its first value, and the maximum at least.
    """

    def bounds(value: object) -> tuple[float, float]:
        match value:
            case Read(_, "elapsed") | MissionTime():
                return 0.0, longest
            case Axis():
                return -1.0, 1.0
            case Read(vehicle, name):
                return OBSERVABLES[name].bounds(there.get(vehicle))
            case tree.ObjectRead(one, name):
                read = OBJECT_OBSERVABLES[name]
                usual = read.low, read.high
                return there.joints.get(one, usual) if read.of_joint else usual
            case tree.Distance() | tree.Separation() | tree.Clearance():
                return there.apart(value)
            case tree.Aggregate(function, inner, _, state):
                first = at_first(inner) if at_first is not None and state is None else None
                return _statistic(function, bounds(inner), first)
        return -inf, inf

    return bounds


def _statistic(
    function: tree.Function, each: tuple[float, float], first: tuple[float, float] | None
) -> tuple[float, float]:
    """Return the range of a statistic. each: the range of every value. first: the range of the
    first value, or None."""
    low, high = each
    if function == "rms":
        return 0.0, max(abs(low), abs(high))
    if first is not None and function == "min":
        return low, min(high, first[1])
    if first is not None and function == "max":
        return max(low, first[0]), high
    return low, high


def _apart(a: Box, b: Box) -> tuple[float, float]:
    """Return the least and the largest distance between points of two boxes."""
    sides = list(zip(*a, *b, strict=True))
    near = hypot(*(max(0.0, r - q, p - s) for p, q, r, s in sides))
    return near, hypot(*(max(s - p, q - r) for p, q, r, s in sides))


def never_holds(condition: Condition, bounds: Bounds) -> bool:
    """Return whether `condition` is certain never to hold."""
    try:
        groups = _groups(condition, True)
    except _TooManyError:
        return False
    return all(_contradicts(group, bounds) for group in groups)


def always_holds(condition: Condition, bounds: Bounds) -> bool:
    """Return whether `condition` is certain to hold whenever its values are known."""
    return never_holds(Not(condition), bounds)


def implies(narrow: Condition, wide: Condition) -> bool:
    """Return whether `wide` is certain to hold whenever `narrow` holds."""
    if narrow == wide:
        return True
    try:
        held, denied = _groups(narrow, True), _groups(wide, False)
    except _TooManyError:
        return False
    plain = [tuple(fact for fact in group if fact.is_plain) for group in held]
    return all(_contradicts((*a, *b), lambda _: (-inf, inf)) for a, b in product(plain, denied))


def _groups(condition: Condition, truth: bool) -> list[_Group]:
    """Return groups of facts such that `condition` has the value `truth` exactly if all facts of
    one group hold."""
    match condition:  # comparisons first, since most conditions are comparisons
        case Compare(operator, Quantity(bound, _), value):
            return [(_fact(value, FLIPPED[operator], bound, truth),)]
        case Compare(operator, value, Quantity(bound, _) | Word(bound)):
            return [(_fact(value, operator, bound, truth),)]
        case Not(part):
            return _groups(part, not truth)
        case GroupInState(quantifier, _, vehicles, state):
            parts = tuple(InState(vehicle, state) for vehicle in vehicles)
            return _groups(And(parts) if quantifier == "all" else Or(parts), truth)
        case And(parts) | Or(parts):
            return _joined([_groups(p, truth) for p in parts], isinstance(condition, And) is truth)
        case InState(vehicle, state):
            return [(_Fact(Read(vehicle, "behavior"), "==" if truth else "!=", state, truth),)]
    return [(_Fact(condition, "==" if truth else "!=", "true", truth),)]


def _joined(parts: list[list[_Group]], together: bool) -> list[_Group]:
    """Return the groups of a condition with several parts. together: whether the parts must hold
    together; then each group combines one group of every part. Otherwise the groups of all parts
    are returned."""
    if not together:
        return [group for part in parts for group in part]
    groups: list[_Group] = [()]
    for part in parts:
        groups = [(*a, *b) for a, b in product(groups, part)]
        if len(groups) > _MOST_GROUPS:
            raise _TooManyError
    return groups


def _fact(
    value: object, operator: tree.ComparisonOperator, bound: float | str, truth: bool
) -> _Fact:
    return _Fact(value, operator if truth else _OPPOSITE[operator], bound, truth)


def _contradicts(group: _Group, bounds: Bounds) -> bool:
    """Return whether no value of something that a group compares satisfies all of the group's
    facts."""
    facts: dict[object, list[_Fact]] = {}
    for fact in group:
        facts.setdefault(fact.value, []).append(fact)
    return any(_is_empty(of_one, bounds(value)) for value, of_one in facts.items())


def _is_empty(facts: list[_Fact], bounds: tuple[float, float]) -> bool:
    equal = {fact.bound for fact in facts if fact.operator == "=="}
    unequal = {fact.bound for fact in facts if fact.operator == "!="}
    if equal & unequal:
        return True
    names = sorted(bound for bound in equal if isinstance(bound, str))
    if not all(is_in(b, a) for a, b in pairwise(names)):
        return True
    if any(is_in(name, other) for name in names for other in unequal if isinstance(other, str)):
        return True
    (low, high), open_low, open_high = bounds, False, False
    for _, operator, bound, _ in facts:
        if isinstance(bound, str):
            continue
        if operator in (">", ">=", "==") and (bound, operator == ">") > (low, open_low):
            low, open_low = bound, operator == ">"
        if operator in ("<", "<=", "==") and (-bound, operator == "<") > (-high, open_high):
            high, open_high = bound, operator == "<"
    return low > high or (low == high and (open_low or open_high))
