"""Expectations judged as a run goes."""

from __future__ import annotations

from math import pi, radians, sqrt

import pytest
from fake_view import FakeView

from kybflow.core.geometry import from_heading
from kybflow.dsl.diagnostics import Span, Text
from kybflow.dsl.expressions import Scope, parse
from kybflow.dsl.plan import ExpectationPlan
from kybflow.runtime.expectations import Judge, Verdict

VEHICLES = {"a": ("up", "eight", "landed"), "b": ("up", "landed")}


class Run:
    """Two vehicles, a clock and a judge."""

    def __init__(self, *words: str) -> None:
        self.a, self.b = FakeView(), FakeView(position=(9.0, 0.0, 0.0))
        self.now = 0.0
        views = {"a": self.a, "b": self.b}
        self.judge = Judge([_plan(w) for w in words], views, lambda: self.now, 1.0)

    def tick(self, error: float | None = None, behavior: str = "eight") -> None:
        """A second in which `a` is `error` metres from where it should be."""
        self.now += 1.0
        self.a.behavior = behavior
        self.a.wanted_position = None if error is None else (error, 0.0, 0.0)
        self.judge.sample()

    def verdict(self, finished_at: float | None = None) -> Verdict:
        return self.judge.verdicts(finished_at)[0]


def _plan(words: str) -> ExpectationPlan:
    text = Text(words, Span("m.yaml", 7, 1, 7, 1 + len(words)))
    expression, findings = parse(text, Scope("expectation", VEHICLES))
    assert findings == []
    assert expression is not None
    return ExpectationPlan(words, expression, text.span.at)


@pytest.mark.parametrize(
    ("function", "expected"),
    [("mean", 0.02), ("max", 0.03), ("min", 0.01), ("rms", sqrt((0.01**2 + 0.03**2) / 2))],
)
def test_statistics_over_the_ticks_in_a_state(function: str, expected: float) -> None:
    run = Run(f"{function}(a.position_error in eight) < 3.5 cm")
    run.tick(9.0, "up")
    run.tick(0.01)
    run.tick(0.03)
    run.tick(9.0, "landed")
    verdict = run.verdict()
    assert verdict.held
    assert expected == pytest.approx(verdict.value)
    assert 0.035 - expected == pytest.approx(verdict.margin)
    assert (verdict.unit, verdict.at) == ("m", "m.yaml:7")


def test_a_statistic_that_breaks_its_bound_has_a_negative_margin() -> None:
    run = Run("max(a.position_error) < 2 cm")
    run.tick(0.03)
    verdict = run.verdict()
    assert not verdict.held
    assert pytest.approx(verdict.margin) == -0.01


def test_statistics_may_be_compared_with_each_other() -> None:
    run = Run("max(a.position_error in eight) < max(a.position_error in up)")
    run.tick(0.03)
    assert run.verdict() == Verdict(run.verdict().text, False, None, None, "m", "m.yaml:7")
    run.tick(0.05, "up")
    assert run.verdict().held


def test_what_was_never_sampled_does_not_hold() -> None:
    run = Run("mean(a.position_error in eight) < 9 m")
    run.tick(0.01, "up")
    run.tick(None, "eight")
    assert run.verdict()[1:4] == (False, None, None)


def test_expectations_of_one_value_share_its_reading() -> None:
    run = Run("mean(a.position_error in eight) < 1 m", "max(a.position_error in eight) < 1 m")
    run.tick(0.5)
    assert run.a.asked == ["state"]
    assert [v.value for v in run.judge.verdicts(None)] == [0.5, 0.5]


def test_always_reports_the_worst_value() -> None:
    run = Run("always separation(all) > 60 cm")
    for x in (2.0, 0.5, 3.0):
        run.b.position = (x, 0.0, 0.0)
        run.tick()
    verdict = run.verdict()
    assert not verdict.held
    assert (0.5, pytest.approx(-0.1)) == (verdict.value, verdict.margin)


def test_always_at_the_bound_itself() -> None:
    run = Run("always a.elapsed < 2 s", "always a.elapsed <= 2 s")
    run.a.elapsed = 2.0
    run.tick()
    assert [v.held for v in run.judge.verdicts(None)] == [False, True]


def test_always_passes_over_what_cannot_be_known() -> None:
    run = Run("always a.battery.remaining > 20 %")
    run.tick()
    assert not run.verdict().held
    run.a.remaining = 0.5
    run.tick()
    assert (True, 0.5, pytest.approx(0.3)) == run.verdict()[1:4]


@pytest.mark.parametrize(
    ("words", "airborne", "unknown"),
    [
        ("always a.position_error < 1 m", True, 2.0),
        ("max(a.position_error in eight) < 1 m", True, 2.0),
        ("max(a.position_error in up) < 1 m", True, 0.0),
        ("always a.position_error < 1 m", False, 0.0),
        ("always distance(a to b) > 1 cm", True, 0.0),
    ],
)
def test_the_time_in_flight_without_a_value_is_counted(words, airborne, unknown) -> None:
    run = Run(words)
    run.a.airborne = airborne
    run.tick(0.1, "up")
    for _ in range(2):
        run.tick(None)
    assert run.verdict().unknown == unknown


@pytest.mark.parametrize("signs", [(1.0, -1.0), (-1.0, 1.0)])
def test_the_mean_of_headings_is_their_direction(signs) -> None:
    run = Run("mean(a.state.heading) < 100 deg", "mean(a.state.heading) > -100 deg")
    for sign in signs:
        run.a.attitude = from_heading(sign * radians(175.0))
        run.tick(0.0)
    verdicts = run.judge.verdicts(None)
    assert [abs(verdict.value or 0.0) for verdict in verdicts] == [pytest.approx(pi)] * 2
    assert not all(verdict.held for verdict in verdicts)


def test_always_with_a_condition_of_names() -> None:
    run = Run("always a in eight or a in up")
    assert not run.verdict().held
    run.tick(0.0, "up")
    assert run.verdict().held
    run.tick(0.0, "landed")
    run.tick(0.0, "up")
    assert not run.verdict().held


def test_eventually_tells_when() -> None:
    run = Run("eventually a in landed within 3 s", "eventually a in landed within 1 s")
    run.tick(0.0, "up")
    run.tick(0.0, "landed")
    run.tick(0.0, "up")
    held, missed = run.judge.verdicts(None)
    assert held[1:5] == (True, 2.0, 1.0, "s")
    assert missed[1:5] == (False, 2.0, -1.0, "s")


def test_eventually_that_never_held_tells_how_near_it_came_and_when() -> None:
    run = Run("eventually a.position_error < 2 cm")
    for error in (0.5, 0.03, None, 0.1):
        run.tick(error)
    verdict = run.verdict()
    assert not verdict.held
    assert (verdict.value, verdict.unit, verdict.when) == (0.03, "m", 2.0)
    assert pytest.approx(verdict.margin) == -0.01
    run.tick(0.01)
    run.tick(0.5)
    assert run.verdict()[1:5] == (True, 5.0, None, "s")
    assert run.verdict().when is None


def test_always_that_did_not_hold_tells_the_worst_value_and_when() -> None:
    run = Run("always a.position_error < 20 cm")
    run.tick(0.1)
    assert run.verdict().when is None
    for error in (0.3, 0.5, 0.4):
        run.tick(error)
    assert (run.verdict().held, run.verdict().value, run.verdict().when) == (False, 0.5, 3.0)


def test_eventually_that_never_came() -> None:
    run = Run("eventually b in landed")
    run.tick()
    assert run.verdict()[1:4] == (False, None, None)


def test_finally_looks_at_the_end_only() -> None:
    run = Run("finally distance(a to a.start) < 10 cm", "finally a in landed")
    run.a.position = (5.0, 0.0, 0.0)
    run.tick()
    run.a.position, run.a.behavior = (0.04, 0.0, 0.0), "landed"
    near, landed = run.judge.verdicts(None)
    assert (True, 0.04, pytest.approx(0.06), "m") == near[1:5]
    assert landed[1:4] == (True, None, None)


def test_finished_needs_an_end() -> None:
    run = Run("finished within 60 s")
    assert run.verdict(None)[1:5] == (False, None, None, "s")
    assert run.verdict(41.0)[1:5] == (True, 41.0, 19.0, "s")
    assert run.verdict(61.0)[1:5] == (False, 61.0, -1.0, "s")
