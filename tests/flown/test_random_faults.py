"""Random flights with faults: what is drawn, what the judge sees in a truth, and a few flights.
`bench/faults.py` flies as many as one likes."""

from __future__ import annotations

import random
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fault_study import plan_of
from flight_judge import Finding, Track, found, judge, lift_of
from plans import FENCE, NANO
from short_flights import hovers
from studies.random_faults import SCENARIOS, draw
from toolchain import with_library

from kybflow.api.flight import RunRequest, fly
from kybflow.core.signals import NS
from kybflow.parts import ActiveFaults, Effect
from kybflow.parts.catalog import load_catalog
from kybflow.recording.layout import HAS_POSITION
from kybflow.recording.messages import TICK

RATE = 250
NANO_PLAN = hovers(1.0)


def flight(
    seconds: float, heights: Any, armed: Any, setpoint: float = 1.0, x: float = 0.0
) -> Track:
    """The track of a vehicle that stays level; `heights` and `armed` are functions of the time."""
    time = np.arange(0.0, seconds, 1.0 / RATE)
    ticks = np.zeros(len(time), TICK)
    high = np.array([heights(t) for t in time])
    ticks["truth"]["position"][:, 2], ticks["truth"]["position"][:, 0] = high, x
    ticks["truth"]["velocity"][:, 2] = np.gradient(high, 1.0 / RATE)
    ticks["truth"]["attitude"][:, 0] = 1.0
    ticks["setpoint"]["present"] = HAS_POSITION
    ticks["setpoint"]["position"][:, 2] = setpoint
    ticks["command"]["armed"] = [armed(t) for t in time]
    return Track(NANO_PLAN, np.rint(time * NS).astype(np.int64), ticks)


def kinds(track: Track, *told: float, final: str = "ground") -> list[str]:
    events = [{"event": "landed", "t_s": at} for at in told]
    return [one.kind for one in found(FENCE, NANO_PLAN, track, events, final)]


def test_a_flight_that_ends_as_it_should_has_no_finding() -> None:
    calm = flight(6.0, lambda t: max(0.0, min(1.0, 3.0 - t)), lambda t: t < 4.0)
    assert kinds(calm, 4.0) == []


def test_rotors_that_stop_in_the_air_are_found_and_so_is_the_fall() -> None:
    fall = flight(6.0, lambda t: max(0.0, 1.0 - 4.9 * max(0.0, t - 2.0) ** 2), lambda t: t < 2.0)
    assert kinds(fall) == ["landed_in_air", "hard"]


def test_a_vehicle_that_was_told_to_be_down_hangs_in_the_air() -> None:
    hanging = flight(4.0, lambda t: 0.14, lambda t: True)
    assert kinds(hanging, 3.0) == ["ended_in_air", "untrue", "landed_in_air"]
    assert kinds(hanging, final="air") == ["ended_in_air"]


def test_what_rests_on_something_without_rotors_is_down() -> None:
    assert kinds(flight(4.0, lambda t: 0.8, lambda t: False)) == []


@pytest.mark.parametrize(("lasts", "expected"), [(0.9, []), (1.2, ["climbed"])])
def test_a_climb_counts_after_a_second(lasts: float, expected: list[str]) -> None:
    high = flight(
        6.0, lambda t: 1.6 if t < lasts else max(0.0, 1.6 - (t - lasts)), lambda t: t < 4.0
    )
    assert kinds(high) == expected


def test_half_a_metre_beyond_the_fence_is_outside() -> None:
    assert kinds(flight(2.0, lambda t: 0.0, lambda t: False, x=2.4)) == []
    beyond = flight(2.0, lambda t: 0.0, lambda t: False, x=-2.6)
    [one] = found(FENCE, NANO_PLAN, beyond, [], "ground")
    assert one == Finding("outside", "a", 0.0, pytest.approx(0.6))


def test_a_vehicle_on_its_back_is_not_under_the_floor() -> None:
    track = flight(1.0, lambda t: -0.05, lambda t: False)
    upright = track.height[0]
    ticks = np.zeros(1, TICK)
    ticks["truth"]["attitude"][0] = (0.0, 1.0, 0.0, 0.0)
    turned = Track(NANO_PLAN, np.zeros(1, np.int64), ticks)
    assert upright == pytest.approx(-0.05)
    assert turned.height[0] == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("effect", "lift"),
    [
        (Effect(), 4.0 * 1.3 / (0.23 * 9.81)),
        (Effect(mass=2.0), 2.0 * 1.3 / (0.23 * 9.81)),
        (Effect(rotors=(0.5, 1.0, 1.0, 1.0)), 3.0 * 1.3 / (0.23 * 9.81)),
        (Effect(rotors=(0.0, 1.0, 1.0, 1.0)), 0.0),
    ],
)
def test_the_lift_that_faults_leave(effect: Effect, lift: float) -> None:
    rig = ActiveFaults("a")
    rig.begin(effect, 0)
    full = replace(NANO_PLAN, airframe=replace(NANO, voltage_spread=0.0))
    assert lift_of(full, rig, 0.0) == pytest.approx(lift, rel=1e-3)


def test_a_fault_that_never_comes_takes_no_lift(tmp_path: Path) -> None:
    plan = replace(plan_of("first_flight"), faults=())
    run = fly(plan, RunRequest(out=tmp_path / "run"))
    assert judge(plan, run.folder, run.summary) == ((), np.inf)


def test_a_number_is_always_the_same_flight(tmp_path: Path) -> None:
    first, again = (draw(7, with_library(tmp_path / name)) for name in ("a", "b"))
    assert first.path.read_bytes() == again.path.read_bytes()
    assert first.faults


def test_each_fault_has_a_line_of_its_own_by_which_events_name_it(tmp_path: Path) -> None:
    faults = draw(200070, with_library(tmp_path)).plan.faults
    assert len({fault.at for fault in faults}) == len(faults) > 2


HARDLY_DRAWN = {"camera_swapped"}
"""Not drawn in 700 flights: it takes two vehicles with cameras."""


@pytest.mark.slow  # it compiles hundreds of missions, of a study that CI doesn't run
def test_every_fault_of_the_catalog_and_every_scenario_is_drawn(tmp_path: Path) -> None:
    folder = with_library(tmp_path)
    missing = {*SCENARIOS, *load_catalog().names("faults")} - HARDLY_DRAWN
    for seed in range(700):
        drawn = draw(seed, folder)
        missing -= {drawn.scenario, *(fault.part.name for fault in drawn.plan.faults)}
        if not missing:
            break
    assert missing == set()


@pytest.mark.slow
@pytest.mark.parametrize("seed", random.Random(15).sample(range(1, 10_000), 8))
def test_what_breaks_comes_down(seed: int) -> None:
    with tempfile.TemporaryDirectory() as name:
        drawn = draw(seed, with_library(Path(name)))
        run = fly(drawn.plan, RunRequest(seed=seed, out=Path(name) / "run"))
        judgement = judge(drawn.plan, run.folder, run.summary)
    if judgement.doomed:
        assert {finding.kind for finding in judgement.findings}.isdisjoint({"succeeded", "untrue"})
    else:
        assert [*map(str, judgement.findings)] == []
