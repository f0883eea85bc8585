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
from toolchain import SHIPPED, with_library

NOT_YAML = {"KYB004", "KYB007"}


@pytest.fixture(scope="module")
def missions() -> list[Mission]:
    return [Mission(path) for path in SHIPPED]


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


def told_of(verdicts: list[Verdict]) -> list[tuple[str, str, str]]:
    told = [(v.mutant, v.findings[0].message) for v in verdicts if v.told]
    return [(mutant.operator.name, mutant.mission, message) for mutant, message in told]


@pytest.mark.parametrize("nth", [6, pytest.param(3, marks=pytest.mark.thorough)])
def test_nothing_is_said_of_sensible_variants(
    missions: list[Mission], nth: int, tmp_path: Path
) -> None:
    """In every run of the tests, those of every sixth mission."""
    assert told_of(judged(missions[::nth], VALID, tmp_path, 1)) == []


every = pytest.mark.parametrize(
    "nth",
    [pytest.param(24, marks=pytest.mark.thorough), pytest.param(1, marks=pytest.mark.slow)],
)


@every
def test_nothing_is_said_in_a_rehearsal_either(
    missions: list[Mission], nth: int, tmp_path: Path
) -> None:
    """It is asked of up to eight vehicles: of sixteen it takes seconds."""
    missions = missions[1::nth] if nth > 1 else missions
    large = [m for m in missions if len(m.plan.vehicles) > 8]
    assert told_of(judged(large, VALID, tmp_path, 1)) == []
    small = [m for m in missions if m not in large]
    assert told_of(judged(small, VALID, tmp_path, len(JUDGES))) == []


@every
def test_what_is_wrong_is_still_yaml(missions: list[Mission], nth: int, tmp_path: Path) -> None:
    others = tuple(op for op in OPERATORS if not hasattr(slips_of_the_keyboard, op.name))
    found = judged(missions[::nth], others, tmp_path)
    broken = [v for v in found if NOT_YAML & {finding.code for finding in v.findings}]
    assert {v.mutant.operator.name for v in broken} == set()
