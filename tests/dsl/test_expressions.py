"""Conditions and expectations: what is read, how it is typed, what is said of a mistake."""

from __future__ import annotations

import re
from typing import Any

import pytest
from fake_view import FakeView
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core.units import ANGLE, DURATION, LENGTH, RATIO
from kybflow.dsl.diagnostics import Span, Text
from kybflow.dsl.expressions import (
    Aggregate,
    Always,
    And,
    Compare,
    Distance,
    Eventually,
    Finished,
    GroupInState,
    InState,
    Location,
    MissionTime,
    Not,
    Or,
    Quantity,
    Read,
    Scope,
    Separation,
    Word,
    describe,
    parse,
)
from kybflow.dsl.expressions.semantics import ObjectNames
from kybflow.runtime.conditions import reader_of

VEHICLES = {"a": ("up", "eight", "hover", "landed"), "b": ("up", "landed")}
CONDITION = Scope("condition", VEHICLES, "a", {"a": ("mocap", "inertial")})
HEALTH = Scope("health", VEHICLES, "a")
EXPECTATION = Scope("expectation", VEHICLES)
GROUPS = {"pair": ("a", "b"), "swarm": ("a", "b", "c", "d")}
FLOW = Scope("condition", dict.fromkeys("abc", ("up", "hover")) | {"d": ("up",)}, groups=GROUPS)


def text(words: str) -> Text:
    return Text(words, Span("m.yaml", 3, 11, 3, 11 + len(words)))


def read(words: str, scope: Scope = CONDITION) -> Any:
    expression, findings = parse(text(words), scope)
    assert findings == []
    return expression


def first_error(words: str, scope: Scope = CONDITION) -> tuple[str, str, str]:
    """(its code, its message, the text that it marks)."""
    expression, findings = parse(text(words), scope)
    assert expression is None
    finding = findings[0]
    marked = words[finding.span.column - 11 : finding.span.end_column - 11]
    return finding.code, finding.message, marked


LOW = Compare("<", Read(None, "battery.remaining"), Quantity(0.2, RATIO))
HIGH = Compare(">", Read(None, "state.altitude"), Quantity(1.0, LENGTH))
LATE = Compare(">", Read(None, "elapsed"), Quantity(3.0, DURATION))


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("battery.remaining < 20 %", LOW),
        ("state.altitude > 1 m and elapsed > 3 s", And((HIGH, LATE))),
        ("state.altitude > 100cm or elapsed>3", Or((HIGH, LATE))),
        ("not (battery.remaining < 20 %)", Not(LOW)),
        ("b in landed", InState("b", "landed")),
        ("b.behavior == up", Compare("==", Read("b", "behavior"), Word("up"))),
        ("estimator != mocap", Compare("!=", Read(None, "estimator"), Word("mocap"))),
        ("time >= 2 min", Compare(">=", MissionTime(), Quantity(120.0, DURATION))),
        (
            "distance(a to b.start) < 80 cm",
            Compare("<", Distance(Location("a"), Location("b", True)), Quantity(0.8, LENGTH)),
        ),
        (
            "distance(start to [1.0 -2.0 120 cm]) < 1",
            Compare(
                "<",
                Distance(Location(None, True), Location(None, False, (1.0, -2.0, 1.2))),
                Quantity(1.0, LENGTH),
            ),
        ),
    ],
)
def test_conditions(words: str, expected: Any) -> None:
    assert expected == read(words)


def test_and_binds_tighter_than_or() -> None:
    assert Or((LOW, And((HIGH, LATE)))) == read(
        "battery.remaining < 20 % or state.altitude > 1 m and elapsed > 3 s"
    )


def test_health_reads_the_estimators_own_age_and_spread() -> None:
    expected = And(
        (
            Compare("<", Read(None, "estimate.age"), Quantity(0.3, DURATION)),
            Compare("<", Read(None, "estimate.spread"), Quantity(0.05, LENGTH)),
        )
    )
    assert expected == read("age < 300 ms and spread < 5 cm", HEALTH)


TO_POINT = Aggregate(
    "max", Distance(Location(None, point=(1.0, 2.0, 3.0)), Location("b")), "b", "landed"
)
ERROR = Aggregate("mean", Read("a", "position_error"), "a", "eight")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("mean(a.position_error in eight) < 4 cm", Compare("<", ERROR, Quantity(0.04, LENGTH))),
        ("4 cm > mean(a.position_error in eight)", Compare("<", ERROR, Quantity(0.04, LENGTH))),
        ("finished within 60 s", Finished(60.0)),
        (
            "always separation(all) > 60 cm",
            Always(Compare(">", Separation(("a", "b")), Quantity(0.6, LENGTH))),
        ),
        ("eventually b in landed within 90 s", Eventually(InState("b", "landed"), 90.0)),
        ("eventually b in landed", Eventually(InState("b", "landed"), None)),
        (
            "max(distance([1 2 3] to b) in landed) < 1 cm",
            Compare("<", TO_POINT, Quantity(0.01, LENGTH)),
        ),
    ],
)
def test_expectations(words: str, expected: Any) -> None:
    assert expected == read(words, EXPECTATION)


@pytest.mark.parametrize(
    ("words", "code", "message", "marked"),
    [
        ("state.altitud > 1 m", "KYB211", "`state.altitud` is unknown", "state.altitud"),
        ("b.spead > 1 m", "KYB211", "`spead` of `b` is unknown", "spead"),
        ("c in landed", "KYB211", "there is no vehicle `c`", "c"),
        ("b in eight", "KYB211", "`b` has no state `eight`", "eight"),
        ("estimator == vrpn", "KYB211", "`a` has no estimator `vrpn`", "vrpn"),
        ("speed(b) > 1 m", "KYB211", "there is no function `speed`", "speed"),
        (
            "state.altitude > 1 m/s",
            "KYB212",
            "`1 m/s` is a speed, but a length is needed",
            "1 m/s",
        ),
        (
            "elapsed < state.speed",
            "KYB212",
            "`elapsed` is a duration, but `state.speed` is a speed",
            "state.speed",
        ),
        ("state.tilt > 20", "KYB212", "an angle needs a unit", "20"),
        ("behavior == 3", "KYB212", "`behavior` is a name, but `3` is a quantity", "3"),
        ("elapsed > 1e999 s", "KYB212", "`1e999 s` is not finite", "1e999 s"),
        ("1 s < 2 s", "KYB212", "both sides are written out: this never changes", "1 s"),
        (
            "max(elapsed) > 1 s",
            "KYB213",
            "`max(...)` covers the whole run, but a condition is checked in every tick",
            "max",
        ),
        ("elapsed > 1 s s", "KYB210", "found `s` where `and`, `or` or the end should be", "s"),
        ("elapsed; 3", "KYB210", "found `;` where a comparison such as `<` should be", ";"),
    ],
)
def test_mistakes(words: str, code: str, message: str, marked: str) -> None:
    assert (code, message, marked) == first_error(words)


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ("a.elapsed < 3 s", "KYB213", "this expectation does not say when it should hold"),
        (
            "max(a.elapsed) < 3 s and min(a.elapsed) < 3 s",
            "KYB213",
            "statistics can't be joined with `and`, `or` or `not`",
        ),
        ("max(a.behavior) < 3", "KYB212", "there is no statistic of `a.behavior`"),
        (
            "always separation(a) > 1 m",
            "KYB212",
            "a separation needs two vehicles, or a vehicle and an obstacle",
        ),
        (
            "min(separation(all) in eight) > 1 m",
            "KYB212",
            "`separation(all)` belongs to no one vehicle that could be in `eight`",
        ),
        ("finished", "KYB210", "found the end where `within` should be"),
    ],
)
def test_mistakes_in_expectations(words: str, code: str, message: str) -> None:
    assert (code, message) == first_error(words, EXPECTATION)[:2]


def test_all_mistakes_are_found_at_once() -> None:
    _, findings = parse(text("state.tilt > 20 and c in landed and elapsed > 1 m"), CONDITION)
    assert [f.code for f in findings] == ["KYB212", "KYB211", "KYB212"]


def test_the_nearest_name_is_offered() -> None:
    _, findings = parse(text("batery.remaining < 20 %"), CONDITION)
    assert [f.help for f in findings] == ["did you mean `battery.remaining`?"]


def test_a_comma_is_answered_with_how_to_write_it() -> None:
    _, findings = parse(text("distance(a, b) < 1 m"), CONDITION)
    assert "the language has no comma" in findings[0].help
    _, findings = parse(text("distance(a"), CONDITION)
    assert "YAML ends a value at a comma" in findings[0].help


@pytest.mark.parametrize("words", ["(" * 500, "not " * 400, "(" * 32 + "elapsed > 1 s" + ")" * 32])
def test_depth_is_bounded(words: str) -> None:
    assert first_error(words)[0] == "KYB214"


def test_length_is_bounded() -> None:
    assert first_error(" or ".join(["elapsed > 1 s"] * 200))[0] == "KYB214"


def test_text_that_was_put_together_is_marked_as_a_whole() -> None:
    span = Span("m.yaml", 3, 11, 3, 20)
    _, findings = parse(Text("elapsed > 1 m", span, verbatim=False), CONDITION)
    assert [span] == [f.span for f in findings]


@pytest.mark.parametrize(
    "words",
    [
        "battery.remaining < 20 %",
        "(b in up or b in landed) and not (elapsed > 50 ms)",
        "distance(a to [1 2 1.2]) < 80 cm",
        "distance(start to b.start) > 2 m",
        "b.behavior == up",
        "state.tilt > 20 deg",
    ],
)
def test_describing_gives_the_text_back(words: str) -> None:
    assert words == describe(read(words))


@pytest.mark.parametrize(
    "words",
    [
        "mean(a.position_error in eight) < 3.4 cm",
        "always separation(a and b) > 60 cm",
        "eventually b in landed within 90 s",
        "finally distance(a to a.start) < 10 cm",
        "finished within 60 s",
    ],
)
def test_describing_an_expectation_gives_the_text_back(words: str) -> None:
    assert words == describe(read(words, EXPECTATION))


def test_angles_are_described_in_degrees() -> None:
    assert describe(Compare("<", Read("a", "state.tilt"), Quantity(0.5, ANGLE))).endswith(
        "28.65 deg"
    )


WORDS = st.sampled_from(
    re.findall(
        r"\S+",
        "a b a.start elapsed state.tilt behavior up 3 1m 20deg ( ) [ ] and or not in to within < =="
        " always finished distance max separation all time 1e999 , é \x00 - $x .",
    )
)


@pytest.mark.parametrize(
    "words",
    ["max(bar.yaw in a.up) < 3 deg", "always distance(bar.left to bar) < 1 m", "mean(bar.x) < 1 m"],
)
def test_what_is_written_about_objects_is_given_back(words: str) -> None:
    objects = {"bar": ObjectNames(("x", "yaw"), ("left",))}
    scope = Scope("expectation", VEHICLES, objects=objects)
    assert words == describe(read(words, scope))


@given(st.lists(WORDS, max_size=30).map(" ".join), st.sampled_from([CONDITION, EXPECTATION]))
def test_no_text_raises(words: str, scope: Scope) -> None:
    expression, findings = parse(text(words), scope)
    assert (expression is None) == bool(findings)
    if expression is not None:
        assert expression == parse(text(describe(expression)), scope)[0]


def test_all_and_any_of_a_group() -> None:
    assert read("all pair in hover", FLOW) == GroupInState("all", "pair", ("a", "b"), "hover")
    assert read("not any pair in up", FLOW) == Not(GroupInState("any", "pair", ("a", "b"), "up"))


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
    expression = read(words, FLOW)
    assert read(describe(expression), FLOW) == expression


def test_a_separation_of_groups_is_that_of_their_vehicles() -> None:
    assert read("separation(swarm) > 1 m", FLOW).left == Separation(("a", "b", "c", "d"))
    assert read("separation(pair and d) > 1 m", FLOW).left == Separation(("a", "b", "d"))


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
