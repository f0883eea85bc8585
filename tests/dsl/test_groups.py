"""Groups in conditions and expectations: read, described, bound to live views."""

from __future__ import annotations

from typing import Any

import pytest
from fake_view import FakeView

from kybflow.dsl.diagnostics.spans import Span, Text
from kybflow.dsl.expressions import GroupInState, Not, Scope, Separation, describe, parse
from kybflow.runtime.conditions import reader_of

VEHICLES = dict.fromkeys("abc", ("up", "hover")) | {"d": ("up",)}
GROUPS = {"pair": ("a", "b"), "swarm": ("a", "b", "c", "d")}
FLOW = Scope("condition", VEHICLES, groups=GROUPS)


def text(words: str) -> Text:
    return Text(words, Span("m.yaml", 1, 1, 1, 1 + len(words)))


def read(words: str) -> Any:
    expression, findings = parse(text(words), FLOW)
    assert findings == []
    return expression


def test_all_and_any_of_a_group() -> None:
    assert read("all pair in hover") == GroupInState("all", "pair", ("a", "b"), "hover")
    assert read("not any pair in up") == Not(GroupInState("any", "pair", ("a", "b"), "up"))


@pytest.mark.parametrize(
    "words",
    [
        "all pair in hover",
        "any swarm in up and a in up",
        "not all pair in up",
        "not (any pair in up or d in up)",
    ],
)
def test_what_is_described_reads_as_the_same(words: str) -> None:
    expression = read(words)
    assert read(describe(expression)) == expression


def test_a_separation_of_groups_is_that_of_their_vehicles() -> None:
    assert read("separation(swarm) > 1 m").left == Separation(("a", "b", "c", "d"))
    assert read("separation(pair and d) > 1 m").left == Separation(("a", "b", "d"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("all pairs in hover", "there is no group `pairs`"),
        ("all a in hover", "there is no group `a`"),
        ("all swarm in hover", "`d` has no state `hover`"),
        ("pair in hover", "`pair` is a group, and one vehicle is needed"),
        ("distance(a to pair) < 1 m", "`pair` is a group, and one vehicle is needed"),
        ("all pair hover", "found `hover` where `in` should be"),
    ],
)
def test_what_is_wrong_is_said_once(words: str, message: str) -> None:
    assert [finding.message for finding in parse(text(words), FLOW)[1]] == [message]


def test_a_vehicle_called_like_a_quantifier_is_still_a_vehicle() -> None:
    scope = Scope("condition", {"all": ("up",)}, groups=GROUPS)
    assert parse(text("all in up"), scope)[1] == []


@pytest.mark.parametrize(
    ("words", "behaviors", "holds"),
    [
        ("all pair in hover", "hover hover", True),
        ("all pair in hover", "hover up", False),
        ("any pair in hover", "hover up", True),
        ("any pair in hover", "up up", False),
        ("all pair in fetch", "fetch.lift fetch", True),
    ],
)
def test_they_hold_of_the_vehicles_as_they_are(words: str, behaviors: str, holds: bool) -> None:
    vehicles = dict.fromkeys("ab", ("up", "hover", "fetch"))
    expression, _ = parse(text(words), Scope("condition", vehicles, groups=GROUPS))
    assert expression is not None
    views = {n: FakeView(behavior=b) for n, b in zip("ab", behaviors.split(), strict=True)}
    assert reader_of(expression, views, None, lambda: 0.0)() is holds
