"""Which vehicles a mission expects to end in `fault`: that ending is then no failure of the run.

`finally sick in fault`, or `eventually`, says so, also as `sick.behavior == fault`, of a group, and
as a part of `and` and `or`. What stands under `not` expects the opposite.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from kybflow.dsl.expressions import (
    And,
    Compare,
    Eventually,
    Expression,
    Finally,
    GroupInState,
    InState,
    Or,
    Read,
    Word,
)
from kybflow.dsl.plan import ExpectationPlan

_FAULT = "fault"


def foreseen_faults(expectations: Iterable[ExpectationPlan]) -> frozenset[str]:
    """The vehicles that the expectations let end in `fault`. Whether they hold is judged apart."""
    said = (plan.expression for plan in expectations)
    return frozenset(name for one in said for name in _expected(one))


def _expected(expression: Expression) -> Iterator[str]:
    match expression:
        case Finally(condition) | Eventually(condition, _):
            yield from _expected(condition)
        case And(parts) | Or(parts):
            for part in parts:
                yield from _expected(part)
        case InState(vehicle, state) if state == _FAULT:
            yield vehicle
        case GroupInState(_, _, vehicles, state) if state == _FAULT:
            yield from vehicles
        case Compare("==", Read(str(vehicle), "behavior"), Word(state)) if state == _FAULT:
            yield vehicle
