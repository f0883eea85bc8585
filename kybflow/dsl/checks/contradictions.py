"""Expectations that contradict each other: KYB570."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, combinations
from typing import Literal, NamedTuple

from kybflow.core.units import LENGTH
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.envelopes import reaches_of
from kybflow.dsl.diagnostics import Diagnostic, Related, Span, Text
from kybflow.dsl.expressions import tree
from kybflow.dsl.expressions.reasoning import never_holds

_When = Literal["every", "some", "last"]
_ON_THE_FLOOR = 0.3
"""How much higher than the floor an estimate of a landed vehicle may be, m."""


class _Claim(NamedTuple):
    """What an expectation claims of a condition: that it holds in every tick, in at least one, or
    in the last one. about: the values that it compares, and the vehicles whose state it tests.
    state: the state in which it is claimed; None if it is of the whole run. side: `<` or `>` for a
    single bound; two on the same side don't contradict each other."""

    text: Text
    when: _When
    condition: tree.Condition
    about: frozenset[object]
    state: str | None = None
    side: str = ""


def contradictory(case: Case) -> Iterator[Diagnostic]:
    """KYB570: two expectations contradict each other, so that one of them fails in every flight,
    whatever faults the mission injects.

    An `always` holds in every tick, and so does the bound of a `max(...) <` or a `min(...) >`,
    perhaps in one state. An `eventually` and the other statistics need a tick in which their
    condition holds, and a `finally` needs the last one. Where there are no obstacles, a vehicle in
    `landed` is no higher than the highest start.
    """
    if len(case.plan.expect) < 2:
        return
    claims = [claim for text, found in case.expected() for claim in _claims(text, found)]
    if not (case.plan.obstacles or case.plan.moving):
        floor = max(vehicle.start[2] for vehicle in case.plan.vehicles) + _ON_THE_FLOOR
        claims = [_grounded(claim, floor) for claim in claims]
    told, certain = set[Span](), reaches_of(case)(None).certain
    alike: dict[object, list[_Claim]] = {}
    for claim in claims:
        for subject in claim.about:
            alike.setdefault(subject, []).append(claim)
    for one, other in chain.from_iterable(combinations(own, 2) for own in alike.values()):
        is_one_tick = "every" in (one.when, other.when) or one.when == other.when == "last"
        if not is_one_tick or one.text is other.text:
            continue
        both = one.condition, other.condition
        elsewhere = one.state and other.state and one.state != other.state
        if elsewhere or (one.side and one.side == other.side):
            continue
        if other.text.span in told or not never_holds(tree.And(both), certain):
            continue
        if not any(never_holds(condition, certain) for condition in both):  # KYB253 reports those
            told.add(other.text.span)
            yield Diagnostic(
                "KYB570",
                f"`{other.text.as_written}` contradicts `{one.text.as_written}`",
                other.text.span,
                label="one of them fails in every flight",
                help="correct one of the two",
                related=(Related(one.text.span, "the other"),),
            )


def _claims(text: Text, expression: tree.Expression) -> list[_Claim]:
    """Return the claims of an expectation. One of a state is made of every tick, that the vehicle
    is elsewhere or the bound holds, and of one tick in the state."""
    match expression:
        case tree.Always(condition):
            return [_Claim(text, "every", condition, _subjects(condition))]
        case tree.Eventually(condition):
            return [_Claim(text, "some", condition, _subjects(condition))]
        case tree.Finally(condition):
            return [_Claim(text, "last", condition, _subjects(condition))]
        case tree.Compare(operator, tree.Aggregate(function, value, vehicle, state), right) if (
            isinstance(right, tree.Quantity) and (function, operator[0]) != ("rms", ">")
        ):
            compared, about = tree.Compare(operator, value, right), frozenset((value,))
            every: tree.Condition = compared
            some: tree.Condition = compared
            if vehicle is not None and state is not None:
                here = tree.InState(vehicle, state)
                every, some = tree.Or((tree.Not(here), compared)), tree.And((here, compared))
            claims = [_Claim(text, "some", some, about, state, operator[0])]
            if (function, operator[0]) in (("max", "<"), ("min", ">")):
                claims.append(_Claim(text, "every", every, about, state, operator[0]))
            return claims
    return []


def _grounded(claim: _Claim, floor: float) -> _Claim:
    """Return the claim; if it is that a vehicle has landed at the end, also that it is no higher
    than `floor` (m)."""
    match claim:
        case _Claim(when="last", condition=tree.InState(vehicle, "landed")):
            altitude = tree.Read(vehicle, "state.altitude")
            low = tree.Compare("<", altitude, tree.Quantity(floor, LENGTH))
            return claim._replace(
                condition=tree.And((claim.condition, low)), about=claim.about | {altitude}
            )
    return claim


def _subjects(condition: tree.Condition) -> frozenset[object]:
    match condition:
        case tree.Compare(_, left, right):
            return frozenset((right,) if isinstance(left, tree.Quantity) else (left,))
        case tree.InState(vehicle):
            return frozenset((vehicle,))
        case tree.GroupInState(_, _, vehicles):
            return frozenset(vehicles)
        case tree.Not(part):
            return _subjects(part)
        case tree.And(parts) | tree.Or(parts):
            return frozenset().union(*map(_subjects, parts))
    return frozenset()
