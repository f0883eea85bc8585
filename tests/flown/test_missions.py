"""Every mission in `missions/` is flown and judged by its own expectations: once in every run of
the tests, with a second seed in the thorough ones, and with twenty in the slow; the longest are
flown first in the thorough ones. Those with `mass_guess` fly with a belief too low and, in the
thorough tests, with one too high."""

from pathlib import Path

import pytest
from toolchain import SHIPPED, compiled, succeeds

LONG = frozenset(
    {
        *("courier", "courier_hard", "formation", "swarm_teleoperation", "follow_leader"),
        *("waypoint_swarm", "cross_traffic", "corridor", "joystick"),
    }
)
"""Flown in the thorough tests only, and with a second seed in the slow: each takes longer than ten
of the others together, but for `joystick`, which flies what `teleoperation` does."""
GUESSES = ("80 %", "120 %")


def variants(path: Path) -> tuple[tuple[str, ...], ...]:
    guesses = "mass_guess:" in path.read_text(encoding="utf-8")
    return tuple((f"mass_guess={g}",) for g in GUESSES) if guesses else ((),)


def flights():
    for path in SHIPPED:
        for number, sets in enumerate(variants(path)):
            for seed in range(20):
                marks = []
                if seed >= (1 if path.stem in LONG else 2):
                    marks = [pytest.mark.slow]
                elif seed or number or path.stem in LONG:
                    marks = [pytest.mark.thorough]
                name = "-".join([path.stem, *sets, str(seed)])
                yield pytest.param(path, sets, seed, marks=marks, id=name)


@pytest.mark.parametrize(("path", "sets", "seed"), list(flights()))
def test_mission_meets_its_expectations(
    path: Path, sets: tuple[str, ...], seed: int, tmp_path: Path
):
    flown, _ = succeeds(compiled(path, sets=sets), tmp_path, seed=seed)
    assert len(flown.summary["expectations"]) > 0


def test_there_are_missions():
    known = {"first_flight", "figure_eight", "sidestep", "windy", "mass_pickup"}
    assert {p.stem for p in SHIPPED} >= known
