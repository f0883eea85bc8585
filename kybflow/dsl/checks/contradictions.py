"""Expectations that contradict each other: KYB570."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Literal, NamedTuple

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.conditions import nodes
from kybflow.dsl.checks.envelopes import reaches_of
from kybflow.dsl.diagnostics import Diagnostic, Related, Span, Text
from kybflow.dsl.expressions import parse, tree
from kybflow.dsl.expressions.reasoning import never_holds

_When = Literal["every", "some", "last"]


class _Claim(NamedTuple):
    """What an expectation claims of a condition: that it holds in every tick, in at least one, or
    in the last one. about: the values that it compares, and the vehicles whose state it tests."""

    text: Text
    when: _When
    condition: tree.Condition
    about: frozenset[object]


def contradictory(case: Case) -> Iterator[Diagnostic]:
    """KYB570: two expectations contradict each other, so that one of them fails in every flight,
    whatever faults the mission injects.

    An `always` holds in every tick, and so does the bound of a `max(...) <` or a `min(...) >`,
    perhaps in one state. An `eventually` and the other statistics need a tick in which their
    condition holds, and a `finally` needs the last one.
    """
    texts = case.plan.texts_of("expect")
    if len(texts) < 2:
        return
    scope = case.scopes.expectation()
    claims = [claim for text in texts for claim in _claims(text, parse(text, scope)[0])]
    told, certain = set[Span](), reaches_of(case)(None).certain
    for one, other in combinations(claims, 2):
        is_one_tick = "every" in (one.when, other.when) or one.when == other.when == "last"
        if not is_one_tick or one.about.isdisjoint(other.about) or other.text.span in told:
            continue
        both = one.condition, other.condition
        if one.text is other.text or not never_holds(tree.And(both), certain):
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


def _claims(text: Text, expression: tree.Expression | None) -> Iterator[_Claim]:
    """Yield the claims of an expectation. One of a state is made of every tick, that the vehicle is
    elsewhere or the bound holds, and of one tick in the state."""
    match expression:
        case tree.Always(condition):
            yield _Claim(text, "every", condition, frozenset(_subjects(condition)))
        case tree.Eventually(condition):
            yield _Claim(text, "some", condition, frozenset(_subjects(condition)))
        case tree.Finally(condition):
            yield _Claim(text, "last", condition, frozenset(_subjects(condition)))
        case tree.Compare(operator, tree.Aggregate(function, value, vehicle, state), right) if (
            isinstance(right, tree.Quantity) and (function, operator[0]) != ("rms", ">")
        ):
            compared = tree.Compare(operator, value, right)
            here = () if vehicle is None or state is None else (tree.InState(vehicle, state),)
            about = frozenset(_subjects(compared))
            if (function, operator[0]) in (("max", "<"), ("min", ">")):
                elsewhere = tuple(tree.Not(one) for one in here)
                yield _Claim(text, "every", tree.Or((*elsewhere, compared)), about)
            yield _Claim(text, "some", tree.And((*here, compared)), about)


def _subjects(condition: tree.Condition) -> Iterator[object]:
    for node in nodes(condition):
        match node:
            case tree.Compare(_, left, right):
                yield from (left, right)
            case tree.InState(vehicle, _):
                yield vehicle
            case tree.GroupInState(_, _, vehicles, _):
                yield from vehicles
