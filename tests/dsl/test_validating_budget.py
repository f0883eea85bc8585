"""What validating one mission after others may cost, in bytecodes, pass by pass.

A change that adds more than 3 % to a pass raises the budget below in the same commit and says why.
"""

from __future__ import annotations

import gc
from collections import Counter

import pytest
from bytecodes import Bytecodes, needs_repeatable_counts, off_budget
from toolchain import MISSIONS

from kybflow.api.validation import validate_paths

PASSES = (
    ("dsl/reading/reader", "read"),
    ("dsl/language/judge", "judge"),
    ("dsl/resolving/", "resolve"),
    ("dsl/expanding/", "expand"),
    ("dsl/expressions/", "expressions"),
    ("dsl/checks/", "check"),
    ("dsl/compiler", "compiler"),
)
BUDGET = {
    "figure_eight": {
        "check": 94600,
        "expand": 48061,
        "expressions": 36253,
        "resolve": 26038,
        "read": 25943,
        "judge": 12111,
        "compiler": 614,
    },
    "survey": {
        "check": 141700,
        "resolve": 83991,
        "expand": 80351,
        "expressions": 37700,
        "read": 29945,
        "judge": 9474,
        "compiler": 638,
    },
}
"""Bytecodes, by mission: two vehicles that fly alike; chains, a stack and obstacles. `UseMarker`
copies the nodes of chains as it does those of `like`: 5,000 more than a copier for chains alone. Of
the checks, 8,500 judge whether expectations contradict each other, waits that outlast the mission,
and limits of drivers."""


@needs_repeatable_counts
@pytest.mark.parametrize("mission", BUDGET)
def test_validating_stays_within_its_budget(mission: str) -> None:
    paths, bytecodes = [MISSIONS / f"{mission}.yaml"], Bytecodes(PASSES, "compiler")
    list(validate_paths(paths, None, ()))  # imports the parts, reads the libraries

    bytecodes.start()
    result = list(validate_paths(paths, None, ()))
    bytecodes.stop()
    assert [file.valid for file in result] == [True]

    lines = off_budget(bytecodes.counts, BUDGET[mission])
    assert not lines, "\n".join(["", *lines])


@needs_repeatable_counts
def test_what_listens_to_the_garbage_collector_is_not_counted() -> None:
    def counted() -> Counter[str]:
        bytecodes = Bytecodes((), "all")
        bytecodes.start()
        kept = [[] for _ in range(10_000)]
        bytecodes.stop()
        assert len(kept) == 10_000
        return bytecodes.counts

    alone = counted()
    gc.callbacks.append(lambda phase, found: None)
    try:
        assert counted() == alone
    finally:
        gc.callbacks.pop()
