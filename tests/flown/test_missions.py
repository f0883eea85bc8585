"""Every mission in `missions/` is flown, is judged by its own expectations, and rehearses without a
finding and in the time that it takes in the simulator.

In every run of the tests most are flown once, the longest in the thorough ones, and each with
twenty seeds in the slow. Those with `mass_guess` fly with a belief too low and, in the thorough
tests, with one too high. The tests of a worker share flights and rehearsals.
"""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from typing import Any

import pytest
from toolchain import SHIPPED, compiled, flight_of, result_of

from kybflow.api.flight import RunRequest, fly
from kybflow.api.rehearsal.rehearse import Rehearsal, rehearse
from kybflow.dsl.plan import Plan

LONG = frozenset(
    {
        *("courier", "courier_hard", "formation", "swarm_teleoperation", "follow_leader"),
        *("waypoint_swarm", "cross_traffic", "corridor", "joystick", "push_cart", "rubble"),
        *("squad", "survey", "three_ardrones", "two_lives", "push_bar", "windy", "trajectory"),
    }
)
"""Flown and rehearsed in the thorough tests only: each takes longer than several of the others
together, but for `joystick`, which flies what `teleoperation` does."""
GUESSES = ("80 %", "120 %")
TIMED = frozenset({"first_flight", "sidestep"})
"""Their rehearsal's time is compared in every run of the tests."""
TIMED_SLOWLY = frozenset({"courier_hard", "swarm_teleoperation"})
"""Long, and flown once more for the comparison, without their faults."""
OFF = 0.03
"""How far the mission time of a rehearsal may be off that of a flight without faults."""
SYMMETRIC = frozenset({"cross_traffic"})
"""Ideal vehicles meet in one instant there, real ones one after the other: their ways round each
other take as long as they take (docs/rehearsal.md)."""
PUSHED = frozenset({"push_cart"})
"""How long a push takes hangs on forces, which a rehearsal leaves out."""


def variants(path: Path) -> tuple[tuple[str, ...], ...]:
    guesses = "mass_guess:" in path.read_text(encoding="utf-8")
    return tuple((f"mass_guess={g}",) for g in GUESSES) if guesses else ((),)


def flights():
    for path in SHIPPED:
        for number, sets in enumerate(variants(path)):
            for seed in range(20):
                marks = []
                if seed:
                    marks = [pytest.mark.slow]
                elif number or path.stem in LONG:
                    marks = [pytest.mark.thorough]
                name = "-".join([path.stem, *sets, str(seed)])
                yield pytest.param(path, sets, seed, marks=marks, id=name)


def missions(
    quick: frozenset[str],
    slow: frozenset[str] = frozenset(),
    left_out: frozenset[str] = frozenset(),
):
    """Every mission but those left out; one that is neither quick nor slow is thorough."""
    found = []
    for path in SHIPPED:
        name = path.stem
        if name not in left_out:
            mark = (
                () if name in quick else pytest.mark.slow if name in slow else pytest.mark.thorough
            )
            found.append(pytest.param(path, id=name, marks=mark))
    return found


NAMES = frozenset(path.stem for path in SHIPPED)


@pytest.fixture(scope="module")
def summary_of(tmp_path_factory: pytest.TempPathFactory):
    """The summary of a mission's flight."""

    @functools.cache
    def summary_of(path: Path, sets: tuple[str, ...], seed: int) -> dict[str, Any]:
        flown, _ = flight_of(
            compiled(path, sets=sets), tmp_path_factory.mktemp(path.stem) / "run", seed=seed
        )
        return flown.summary

    return summary_of


@pytest.mark.parametrize(("path", "sets", "seed"), list(flights()))
def test_mission_meets_its_expectations(
    path: Path, sets: tuple[str, ...], seed: int, summary_of
) -> None:
    summary = summary_of(path, sets, seed)
    assert [e for e in summary["expectations"] if not e["held"]] == []
    assert summary["outcome"] == "succeeded", summary
    assert len(summary["expectations"]) > 0


@functools.cache
def rehearsed(path: Path) -> tuple[Plan, Rehearsal]:
    result = result_of(path)
    assert result.plan is not None
    return result.plan, rehearse(result.plan, texts=result.texts)


@pytest.mark.parametrize("path", missions(NAMES - LONG))
def test_a_shipped_mission_rehearses_without_a_finding(path: Path) -> None:
    _, rehearsal = rehearsed(path)

    assert rehearsal.diagnostics == ()


@pytest.mark.parametrize("path", missions(TIMED, TIMED_SLOWLY, SYMMETRIC | PUSHED))
def test_its_time_is_that_of_the_simulator(path: Path, tmp_path: Path, summary_of) -> None:
    plan, rehearsal = rehearsed(path)

    if plan.faults or variants(path) != ((),):
        summary = fly(dataclasses.replace(plan, faults=()), RunRequest(out=tmp_path)).summary
    else:
        summary = summary_of(path, (), 0)

    assert rehearsal.duration == pytest.approx(summary["sim_time_s"], rel=OFF)


def test_a_mission_may_name_ideal_vehicles(tmp_path: Path) -> None:
    text = SHIPPED[0].with_name("first_flight.yaml").read_text(encoding="utf-8")
    text = text.replace("library/airframes.yaml", "kybflow/airframes")
    text += "\ntargets:\n  ideal: {all: {driver: {use: kinematic}}}\n"
    plan = compiled(tmp_path / "mine.yaml", text, target="ideal", warns=True)

    summary = fly(plan, RunRequest(out=tmp_path / "run")).summary

    assert summary["outcome"] == "succeeded"
    assert summary["sim_time_s"] == pytest.approx(12.4, rel=OFF)


def test_there_are_missions() -> None:
    known = {"first_flight", "figure_eight", "sidestep", "windy", "mass_pickup"}
    assert known <= NAMES
