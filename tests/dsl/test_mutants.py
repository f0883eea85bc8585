"""The mutation study in small, and in full where slow tests run: what breaks a mission is refused
at the right line, and nothing gives a traceback."""

from __future__ import annotations

from pathlib import Path

import pytest
from studies.mutation_study import AIR, BROKEN, MOVED, judged, tracebacks
from toolchain import SHIPPED, with_library


def share_found(folder: Path, every: int) -> float:
    """The share of the mutants that are wrong and found."""
    every_one = [one for path in SHIPPED for one in judged(path, with_library(folder), every)]
    assert {one.why for one in every_one} <= {"", BROKEN, AIR, MOVED}
    wrong = [one for one in every_one if one.why]
    return sum(one.is_found for one in wrong) / len(wrong)


@pytest.mark.parametrize("every", [223, pytest.param(67, marks=pytest.mark.thorough)])
def test_a_sample_of_mutants_is_refused_at_the_right_line(every: int, tmp_path: Path) -> None:
    assert share_found(tmp_path, every) > 0.95


def test_a_sample_of_random_mutants_gives_no_traceback() -> None:
    assert tracebacks((0, 60)) == []


@pytest.mark.slow
def test_mutants_are_refused_at_the_right_line(tmp_path: Path) -> None:
    assert share_found(tmp_path, 1) > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_random_mutants_give_no_traceback(seed: int) -> None:
    assert tracebacks((seed, 2000)) == []
