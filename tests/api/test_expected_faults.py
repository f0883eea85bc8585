"""An ending in `fault` that the mission expects is no failure."""

from __future__ import annotations

import pytest
from recorded_run import make_plan

from kybflow.api.flight import expected_faults
from kybflow.dsl.expressions import (
    And,
    Compare,
    Eventually,
    Expression,
    Finally,
    Finished,
    GroupInState,
    InState,
    Not,
    Or,
    Read,
    Word,
)
from kybflow.dsl.plan import ExpectationPlan
from kybflow.recording.outcome import Ending, decide
from kybflow.runtime.scores import Score

SICK, WELL = InState("sick", "fault"), InState("well", "landed")


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (Finally(SICK), {"sick"}),
        (Eventually(SICK, 30.0), {"sick"}),
        (Finally(And((SICK, WELL))), {"sick"}),
        (Finally(Or((SICK, InState("sick", "landed")))), {"sick"}),
        (Finally(Compare("==", Read("sick", "behavior"), Word("fault"))), {"sick"}),
        (Finally(GroupInState("any", "all_of_them", ("a", "b"), "fault")), {"a", "b"}),
        (Finally(Not(SICK)), set()),
        (Finally(Compare("!=", Read("sick", "behavior"), Word("fault"))), set()),
        (Finally(WELL), set()),
        (Finished(30.0), set()),
    ],
)
def test_who_may_end_in_fault(expression: Expression, expected: set[str]) -> None:
    assert expected_faults([ExpectationPlan("as written", expression, "m.yaml:9")]) == expected


@pytest.mark.parametrize(
    ("foreseen", "outcome"),
    [((), ("failed", "mk ended in `fault`")), (("mk",), ("succeeded", None))],
)
def test_the_outcome_of_an_ending_in_fault(foreseen: tuple[str, ...], outcome: object) -> None:
    score = Score(make_plan("mk"))
    score.vehicle("mk").entered("fault", "wait_on_ground", 1.0)
    assert decide(score, [], Ending(expected_faults=foreseen)) == outcome
