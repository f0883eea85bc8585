"""What a run says of itself is what its recording shows: a few flights of `bench/verdicts.py`."""

from __future__ import annotations

from pathlib import Path

import pytest
from studies.verdict_cases import draw
from verdicts import study

AT_THE_LIMIT, TRUNCATED, BY_A_PERSON = 1, 10, 46


@pytest.mark.parametrize(
    "seed",
    [
        AT_THE_LIMIT,
        *(pytest.param(s, marks=pytest.mark.thorough) for s in (TRUNCATED, BY_A_PERSON)),
    ],
)
def test_a_run_says_what_its_recording_shows(seed: int, tmp_path: Path) -> None:
    found = study(draw(seed, tmp_path), tmp_path / "run")
    assert found.found == []
    assert found.facts > 20
