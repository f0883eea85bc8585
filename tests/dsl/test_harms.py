"""The study of harmful changes holds what it says: each operator finds a place, what it makes is
wrong for its own reason and not as YAML, and nothing is said of a sensible variant."""

from __future__ import annotations

from pathlib import Path

import pytest
from harms.families import OPERATORS, VALID
from harms.families import slips as slips_of_the_keyboard
from harms.mission_text import Mission
from harms.operator import Operator
from harms.study import JUDGES, Verdict, verdicts
from mutation_study import MISSIONS, with_library

NOT_YAML = {"KYB004", "KYB007"}


@pytest.fixture(scope="module")
def missions() -> list[Mission]:
    return [Mission(path) for path in MISSIONS]


def judged(
    missions: list[Mission], operators: tuple[Operator, ...], folder: Path, judges: int = 1
) -> list[Verdict]:
    """What the compiler alone makes of the mutants, or the first `judges`."""
    whole, own = with_library(folder), JUDGES[:judges]
    return [v for mission in missions for _, v in verdicts(mission, whole, operators, own)]


def test_there_are_operators_of_every_label_in_both_halves() -> None:
    assert len(OPERATORS) >= 80
    assert len(VALID) >= 25
    assert len({op.name for op in (*OPERATORS, *VALID)}) == len(OPERATORS) + len(VALID)
    for label in ("dangerous", "senseless"):
        halves = [op.half for op in OPERATORS if op.label == label]
        assert min(halves.count("development"), halves.count("held-out")) >= 20
    assert all(op.why for op in (*OPERATORS, *VALID))


def test_every_operator_has_a_place_in_a_mission(missions: list[Mission]) -> None:
    operators = (*OPERATORS, *VALID)
    assert [op.name for op in operators if not any(list(op.make(m)) for m in missions)] == []


@pytest.mark.parametrize("judges", [1, pytest.param(len(JUDGES), marks=pytest.mark.thorough)])
def test_nothing_is_said_of_sensible_variants(
    missions: list[Mission], tmp_path: Path, judges: int
) -> None:
    """The rehearsal is asked of up to eight vehicles: of sixteen it takes seconds."""
    own = [m for m in missions if judges == 1 or len(m.plan.vehicles) <= 8]
    told = [v for v in judged(own, VALID, tmp_path, judges) if v.told]
    assert [(v.mutant.operator.name, v.mutant.mission, v.findings[0].message) for v in told] == []


@pytest.mark.thorough
def test_what_is_wrong_is_still_yaml(missions: list[Mission], tmp_path: Path) -> None:
    others = tuple(op for op in OPERATORS if not hasattr(slips_of_the_keyboard, op.name))
    found = judged(missions, others, tmp_path)
    broken = [v for v in found if NOT_YAML & {finding.code for finding in v.findings}]
    assert {v.mutant.operator.name for v in broken} == set()
