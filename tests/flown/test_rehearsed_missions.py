"""Every mission in `missions/` rehearses without a finding, and in the time that it takes in the
simulator: a few in every run of the tests, all in the thorough ones."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from toolchain import SHIPPED, compiled, result_of

from kybflow.api.flight import RunRequest, fly
from kybflow.api.rehearsal.rehearse import Rehearsal, rehearse
from kybflow.dsl.plan import Plan

QUICK = frozenset({"first_flight", "mass_pickup", "sidestep"})
OFF = 0.03
"""How far the mission time of a rehearsal may be off that of a flight without faults."""
SYMMETRIC = frozenset({"cross_traffic"})
"""Ideal vehicles meet in one instant there, real ones one after the other: their ways round each
other take as long as they take (docs/rehearsal.md)."""
PUSHED = {"push_cart"}
"""How long a push takes hangs on forces, which a rehearsal leaves out."""


def rehearsed(path: Path) -> tuple[Plan, Rehearsal]:
    result = result_of(path)
    assert result.plan is not None
    return result.plan, rehearse(result.plan, texts=result.texts)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_mission_rehearses_without_a_finding(path: Path) -> None:
    _, rehearsal = rehearsed(path)

    assert rehearsal.diagnostics == ()


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(p, id=p.stem, marks=() if p.stem in QUICK else pytest.mark.thorough)
        for p in SHIPPED
        if p.stem not in SYMMETRIC | PUSHED
    ],
)
def test_its_time_is_that_of_the_simulator(path: Path, tmp_path: Path) -> None:
    plan, rehearsal = rehearsed(path)

    flown = fly(dataclasses.replace(plan, faults=()), RunRequest(out=tmp_path))

    assert rehearsal.duration == pytest.approx(flown.summary["sim_time_s"], rel=OFF)


def test_a_mission_may_name_ideal_vehicles(tmp_path: Path) -> None:
    text = SHIPPED[0].with_name("first_flight.yaml").read_text(encoding="utf-8")
    text = text.replace("library/airframes.yaml", "kybflow/airframes")
    text += "\ntargets:\n  ideal: {all: {driver: {use: kinematic}}}\n"
    plan = compiled(tmp_path / "mine.yaml", text, target="ideal", warns=True)

    summary = fly(plan, RunRequest(out=tmp_path / "run")).summary

    assert summary["outcome"] == "succeeded"
    assert summary["sim_time_s"] == pytest.approx(12.4, rel=OFF)
