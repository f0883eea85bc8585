"""What is certain of a condition, whatever the flight brings: whether it can hold, whether it
always does, whether another one follows from it.

A condition is brought into the form (a and b) or (c and d) or ...; one such group can't hold when
what it says of one value leaves nothing: an empty interval, or two names. Where that can't be told,
or the form grows beyond `_MOST` groups, nothing is said.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise, product
from math import inf
from typing import NamedTuple

from kybflow.dsl.expressions import (
    And,
    Axis,
    Compare,
    Condition,
    GroupInState,
    InState,
    MissionTime,
    Not,
    Or,
    Quantity,
    Read,
    Word,
    tree,
)
from kybflow.dsl.expressions.parse import FLIPPED
from kybflow.parts.observables import OBSERVABLES, is_in

Bounds = Callable[[object], tuple[float, float]]
"""The range that a value never leaves (SI)."""
_MOST = 64
_OPPOSITE: dict[tree.ComparisonOperator, tree.ComparisonOperator] = {
    "<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "==",
}  # fmt: skip


class _Fact(NamedTuple):
    """One comparison: the operator and bound that it puts on a value. `is_plain` is false behind a
    `not`, which also holds where the value is not known."""

    value: object
    operator: tree.ComparisonOperator
    bound: float | str
    is_plain: bool


_Group = tuple[_Fact, ...]


class _TooManyError(Exception):
    """The form has more groups than are worth looking at."""


def physical_bounds(longest: float) -> Bounds:
    """The bounds that nature sets, in a run of `longest` seconds at most: no speed or distance is
    negative, no share above one, no time longer than the run."""

    def bounds(value: object) -> tuple[float, float]:
        match value:
            case Read(_, "elapsed") | MissionTime():
                return 0.0, longest
            case Axis():
                return -1.0, 1.0
            case Read(_, name):
                return OBSERVABLES[name].low, OBSERVABLES[name].high
            case tree.Distance() | tree.Separation():
                return 0.0, inf
            case tree.Aggregate("rms", inner):
                low, high = bounds(inner)
                return 0.0, max(abs(low), abs(high))
            case tree.Aggregate(_, inner):
                return bounds(inner)
        return -inf, inf

    return bounds


def never_holds(condition: Condition, bounds: Bounds) -> bool:
    """Whether `condition` surely never holds."""
    try:
        groups = _groups(condition, True)
    except _TooManyError:
        return False
    return all(_contradicts(group, bounds) for group in groups)


def always_holds(condition: Condition, bounds: Bounds) -> bool:
    """Whether `condition` surely holds whenever its values are known."""
    return never_holds(Not(condition), bounds)


def implies(narrow: Condition, wide: Condition) -> bool:
    """Whether `wide` surely holds when `narrow` does."""
    if narrow == wide:
        return True
    try:
        told, denied = _groups(narrow, True), _groups(wide, False)
    except _TooManyError:
        return False
    plain = [tuple(fact for fact in group if fact.is_plain) for group in told]
    return all(_contradicts((*a, *b), lambda _: (-inf, inf)) for a, b in product(plain, denied))


def _groups(condition: Condition, truth: bool) -> list[_Group]:
    """The groups of which one holds when `condition` is as `truth` says."""
    match condition:  # comparisons first: nearly every condition is one
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
    """The groups that hold together, one of each part, or the groups of all parts."""
    if not together:
        return [group for part in parts for group in part]
    groups: list[_Group] = [()]
    for part in parts:
        groups = [(*a, *b) for a, b in product(groups, part)]
        if len(groups) > _MOST:
            raise _TooManyError
    return groups


def _fact(
    value: object, operator: tree.ComparisonOperator, bound: float | str, truth: bool
) -> _Fact:
    return _Fact(value, operator if truth else _OPPOSITE[operator], bound, truth)


def _contradicts(group: _Group, bounds: Bounds) -> bool:
    """Whether the facts leave no value to one of the things that they speak of."""
    facts: dict[object, list[_Fact]] = {}
    for fact in group:
        facts.setdefault(fact.value, []).append(fact)
    return any(_is_empty(of_one, bounds(value)) for value, of_one in facts.items())


def _is_empty(facts: list[_Fact], bounds: tuple[float, float]) -> bool:
    equal = {fact.bound for fact in facts if fact.operator == "=="}
    if equal & {fact.bound for fact in facts if fact.operator == "!="}:
        return True
    names = sorted(bound for bound in equal if isinstance(bound, str))
    if not all(is_in(b, a) for a, b in pairwise(names)):
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
