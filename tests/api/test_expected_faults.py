"""An ending in `fault` that the mission expects is no failure."""

from __future__ import annotations

import pytest
from recorded_run import make_plan

from kybflow.api.flight import expected_faults
from kybflow.dsl import expressions as ex
from kybflow.dsl.plan import ExpectationPlan
from kybflow.recording.outcome import Ending, decide
from kybflow.runtime.scores import Score

SICK, WELL = ex.InState("sick", "fault"), ex.InState("well", "landed")


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (ex.Finally(SICK), {"sick"}),
        (ex.Eventually(SICK, 30.0), {"sick"}),
        (ex.Finally(ex.And((SICK, WELL))), {"sick"}),
        (ex.Finally(ex.Or((SICK, ex.InState("sick", "landed")))), {"sick"}),
        (ex.Finally(ex.Compare("==", ex.Read("sick", "behavior"), ex.Word("fault"))), {"sick"}),
        (ex.Finally(ex.GroupInState("any", "all_of_them", ("a", "b"), "fault")), {"a", "b"}),
        (ex.Finally(ex.Not(SICK)), set()),
        (ex.Finally(ex.Compare("!=", ex.Read("sick", "behavior"), ex.Word("fault"))), set()),
        (ex.Finally(WELL), set()),
        (ex.Finished(30.0), set()),
    ],
)
def test_who_may_end_in_fault(expression: ex.Expression, expected: set[str]) -> None:
    assert expected_faults([ExpectationPlan("as written", expression, "m.yaml:9")]) == expected


@pytest.mark.parametrize(
    ("foreseen", "outcome"),
    [((), ("failed", "mk ended in `fault`")), (("mk",), ("succeeded", None))],
)
def test_the_outcome_of_an_ending_in_fault(foreseen: tuple[str, ...], outcome: object) -> None:
    score = Score(make_plan("mk"))
    score.vehicle("mk").entered("fault", "wait_on_ground", 1.0)
    assert decide(score, [], Ending(expected_faults=foreseen)) == outcome
