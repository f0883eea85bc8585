"""What is certain of a condition, and what is not."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core.units import LENGTH
from kybflow.dsl.diagnostics import Span, Text
from kybflow.dsl.expressions import (
    And,
    Compare,
    Condition,
    InState,
    Not,
    Or,
    Quantity,
    Read,
    Scope,
    parse,
)
from kybflow.dsl.expressions.reasoning import (
    Envelopes,
    always_holds,
    implies,
    never_holds,
    physical_bounds,
)
from kybflow.dsl.expressions.tree import Aggregate, ComparisonOperator, Function
from kybflow.parts.observables import Envelope

SCOPE = Scope("condition", {"a": ("up", "down", "hover"), "b": ("up", "hover")}, "a")
NATURE = physical_bounds(600.0)


def meant(text: str) -> Condition:
    expression, found = parse(Text(text, Span("m", 1, 1, 1, 1 + len(text))), SCOPE)
    assert found == []
    return expression


@pytest.mark.parametrize(
    "text",
    [
        "state.speed < 0 m/s",
        "0 m/s > state.speed",
        "state.altitude > 2 m and state.altitude < 1 m",
        "state.altitude > 1 m and state.altitude <= 1 m",
        "elapsed > 601 s",
        "time > 11 min",
        "state.tilt > 190 deg",
        "battery.remaining > 100 %",
        "a in up and a in down",
        "b.behavior == up and b.behavior == hover",
        "b in up and not (b in up)",
        "(state.speed < 0 m/s or time > 11 min) and a in up",
        "distance(a to b) < 0 m",
    ],
)
def test_it_can_never_hold(text: str) -> None:
    assert never_holds(meant(text), NATURE)
    assert always_holds(meant(f"not ({text})"), NATURE)


@pytest.mark.parametrize(
    "text",
    [
        "state.speed <= 0 m/s",
        "state.climb < -1 m/s",
        "state.altitude > 1 m and state.altitude < 2 m",
        "state.altitude > 2 m or state.altitude < 1 m",
        "elapsed >= 600 s",
        "a in up and b in up",
        "a in up or a in down",
        "state.altitude >= 1 m and state.altitude <= 1 m",
        "state.altitude > 2 m and b.state.altitude < 1 m",
    ],
)
def test_it_can_hold_and_fail(text: str) -> None:
    assert not never_holds(meant(text), NATURE)
    assert not always_holds(meant(text), NATURE)


@pytest.mark.parametrize(
    ("narrow", "wide"),
    [
        ("state.speed < 1 m/s", "state.speed < 2 m/s"),
        ("state.speed < 1 m/s", "state.speed <= 1 m/s"),
        ("state.speed < 1 m/s and a in up", "a in up or time > 3 s"),
        ("a in up", "not (a in down)"),
        ("state.altitude == 1 m", "state.altitude < 2 m"),
        ("a in up and state.speed > 2 m/s", "state.speed > 1 m/s and not (a in hover)"),
    ],
)
def test_one_follows_from_the_other_alone(narrow: str, wide: str) -> None:
    assert implies(meant(narrow), meant(wide))
    assert not implies(meant(wide), meant(narrow))


def test_what_may_be_unknown_follows_from_nothing_negative() -> None:
    """A comparison with a value that is not known is false, its `not` true."""
    assert not implies(meant("not (state.speed < 1 m/s)"), meant("state.speed >= 1 m/s"))
    assert implies(meant("state.speed >= 1 m/s"), meant("not (state.speed < 1 m/s)"))


def test_a_vehicle_in_a_state_of_a_chain_is_in_the_chain() -> None:
    inside, chain = InState("a", "tour.go"), InState("a", "tour")
    assert never_holds(And((inside, Not(chain))), NATURE)
    assert not never_holds(And((chain, Not(inside))), NATURE)


def test_what_is_too_long_to_tell_is_not_told() -> None:
    text = " and ".join(f"(time > {i} s or elapsed > {i} s)" for i in range(1, 9))
    assert not never_holds(meant(f"({text}) and state.speed < 0 m/s"), NATURE)


OPERATORS: list[ComparisonOperator] = ["<", "<=", ">", ">=", "==", "!="]
compares = st.builds(
    lambda name, operator, bound: Compare(operator, Read(None, name), Quantity(bound, LENGTH)),
    st.sampled_from(["state.x", "state.y"]),
    st.sampled_from(OPERATORS),
    st.integers(-2, 2).map(float),
)
conditions = st.recursive(
    compares,
    lambda inner: st.one_of(
        st.builds(lambda *p: And(p), inner, inner),
        st.builds(lambda *p: Or(p), inner, inner),
        st.builds(Not, inner),
    ),
    max_leaves=6,
)
values = st.sampled_from([i / 2 for i in range(-6, 7)])


def holds(condition: Condition, x: float, y: float) -> bool:
    match condition:
        case Not(part):
            return not holds(part, x, y)
        case And(parts):
            return all(holds(part, x, y) for part in parts)
        case Or(parts):
            return any(holds(part, x, y) for part in parts)
    value, bound = (x if condition.left.name == "state.x" else y), condition.right.value
    return {
        "<": value < bound, "<=": value <= bound, ">": value > bound,
        ">=": value >= bound, "==": value == bound, "!=": value != bound,
    }[condition.operator]  # fmt: skip


@given(conditions, conditions, values, values)
def test_what_is_certain_is_so_for_every_value(a, b, x, y) -> None:
    assert not (never_holds(a, NATURE) and holds(a, x, y))
    assert not (always_holds(a, NATURE) and not holds(a, x, y))
    assert not (implies(a, b) and holds(a, x, y) and not holds(b, x, y))


AT = Envelope((0.0, 0.0, 0.0), (-3.0, -3.0, 0.0), (3.0, 3.0, 2.5), 4.0, 1.5, 9.0, 8.0, 10.0, 1e-4)
NEAR = Envelope((0.0, 2.0, 0.0), (-3.0, 1.0, 0.0), (3.0, 3.0, 2.5), 4.0)
STANDS = Envelope(AT.start, AT.start, AT.start, 0.0, 0.0)
HERE = Envelopes({"a": AT, "b": NEAR}, "a")


@pytest.mark.parametrize(
    "text",
    [
        "state.altitude > 2.6 m",
        "a.state.x < -3.1 m",
        "state.speed > 5 m/s",
        "state.climb < -5 m/s",
        "state.tilt > 90 deg",
        "position_error > 10 m",
        "distance(a to b) > 9 m",
        "distance(b to start) < 90 cm",
        "estimate.age > 11 s",
        "estimate.spread < 0.01 mm",
    ],
)
def test_envelopes_bound_it(text: str) -> None:
    assert never_holds(meant(text), physical_bounds(600.0, HERE))
    assert not never_holds(meant(text), NATURE)


def test_a_vehicle_that_is_not_known_may_be_anywhere() -> None:
    bounds = physical_bounds(600.0, Envelopes({"a": AT}, "a"))

    assert not never_holds(meant("distance(a to b) > 900 m"), bounds)


@pytest.mark.parametrize(
    ("function", "state", "expected"),
    [("min", None, (0.0, 0.0)), ("max", None, (0.0, 2.5)), ("min", "up", (0.0, 2.5))],
)
def test_the_extremes_of_a_run_know_its_first_tick(
    function: Function, state: str | None, expected: tuple[float, float]
) -> None:
    first = physical_bounds(600.0, Envelopes({"a": STANDS}))
    value = Aggregate(function, Read("a", "state.altitude"), "a", state)

    assert physical_bounds(600.0, HERE, first)(value) == expected
