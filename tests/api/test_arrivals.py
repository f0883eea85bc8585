"""What a rehearsal finds of vehicles that a phase asks at once is resolved by `arrive`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from short_flights import named
from toolchain import compiled, flight_of, result_of

from kybflow.api.rehearsal.findings import Arrival, StraightWay, arrival
from kybflow.api.rehearsal.rehearse import Rehearsal, rehearse
from kybflow.cli.printing.mission import show_mission
from kybflow.core.signals import NS
from kybflow.dsl.compiler import Result
from kybflow.dsl.plan import PhasePlan, Request

MISSION = """\
kybflow: 1
mission: pair
import: {std: kybflow/airframes}
world: {fence: {from: [-4, -4, 0], to: [4, 4, 3]}}
groups: {pair: [a, b]}
vehicles:
  a:
    like: std.nano_plus
    start: {at: [-2, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: hover, within: 15 s}
      move: {do: fly_to, position: [1, 0, 1], then: hover}
      down: {do: land}
  b: {like: a, start: {at: %s}, behaviors: {move: {position: %s, speed: %s}}}
flows:
  team:
    phases:
      launch: {run: {pair: up}, next: [{when: all pair in hover, go: move}], within: 20 s,
               otherwise: land}
      move:   {%s, next: [{when: all pair in hover, go: land}], within: 40 s, otherwise: land}
      land:   {run: {pair: down}}
expect:
  - always separation(pair) > 60 cm
  - finally all pair in landed
"""
CROSSING = ("[-0.5, -1.5, 0]", "[-0.5, 1.5, 1]", "1 m/s")
FOLLOWING = ("[-1, 0, 0]", "[2, 0, 1]", "30 cm/s")
AT_ONCE = "run: {pair: move}"
IN_TURNS, TOGETHER = f"{AT_ONCE}, arrive: in_turns", f"{AT_ONCE}, arrive: together"


def checked(tmp_path: Path, ways: tuple[str, ...], run: str) -> Result:
    return result_of(tmp_path / "pair.yaml", MISSION % (*ways, run))


def rehearsed(tmp_path: Path, ways: tuple[str, ...], run: str) -> Rehearsal:
    result = checked(tmp_path, ways, run)
    assert result.plan is not None, result.diagnostics
    return rehearse(result.plan, texts=result.texts)


@pytest.mark.parametrize(
    ("ways", "said"),
    [
        (CROSSING, "let the phase `move` say `arrive: in_turns`, or move the bound"),
        (
            FOLLOWING,
            "let the phase `move` say `arrive: together` or `arrive: in_turns` "
            "with `b` before `a`, or move the bound",
        ),
    ],
)
def test_a_conflict_of_two_that_a_phase_asks_at_once_names_the_way_out(
    ways: tuple[str, ...], said: str, tmp_path: Path
) -> None:
    found = rehearsed(tmp_path, ways, AT_ONCE).diagnostics
    assert [d.help for d in found if d.code == "KYB474"] == [said, said]


@pytest.mark.parametrize(
    ("ways", "run", "least"),
    [
        (CROSSING, IN_TURNS, 1.4),
        (FOLLOWING, TOGETHER, 0.99),
        (FOLLOWING, "run: {b: move, a: move}, arrive: in_turns", 0.9),
    ],
)
def test_what_it_names_resolves_it(
    ways: tuple[str, ...], run: str, least: float, tmp_path: Path
) -> None:
    rehearsal = rehearsed(tmp_path, ways, run)
    assert rehearsal.diagnostics == ()
    assert rehearsal.separation is not None
    assert rehearsal.separation.metres > least


def test_together_does_not_help_where_ways_cross_in_their_middle(tmp_path: Path) -> None:
    found = rehearsed(tmp_path, CROSSING, TOGETHER).diagnostics
    hints = [d.help for d in found if d.code == "KYB474"]
    assert hints == ["let the phase `move` say `arrive: in_turns`, or move the bound"] * 2


@pytest.mark.parametrize(
    ("ways", "run", "apart"),
    [
        pytest.param(CROSSING, IN_TURNS, 6.0, marks=pytest.mark.thorough),
        pytest.param(FOLLOWING, TOGETHER, 0.01, marks=pytest.mark.thorough),
    ],
)
def test_flown(ways: tuple[str, ...], run: str, apart: float, tmp_path: Path) -> None:
    """apart: the seconds between the two arrivals."""
    plan = checked(tmp_path, ways, run).plan
    assert plan is not None

    done, told = flight_of(plan, tmp_path / "run")

    assert done.exit_code == 0
    over = [e for e in named(told, "behavior_ended") if e.fields["behavior"] == "move"]
    first, second = (event.time / NS for event in over)
    assert second - first == pytest.approx(apart, abs=1.0 if apart > 1.0 else 0.3)


def test_who_reads_the_mission_sees_it_and_the_resolved_one_has_it(tmp_path: Path) -> None:
    plan = checked(tmp_path, CROSSING, IN_TURNS).plan
    assert plan is not None
    assert "pair: move; arrive in_turns (all" in show_mission(plan, {})
    again = compiled(tmp_path / "resolved.yaml", plan.resolved)
    arrivals = [phase.arrive for phase in again.flows[0].phases.values()]
    assert arrivals == [None, "in_turns", None]


ORIGIN, EAST, NORTH, FAR = (0.0, 0.0, 1.0), (2.0, 0.0, 1.0), (0.0, 2.0, 1.0), (0.0, 4.0, 1.0)
PHASE = PhasePlan(
    name="over", run={"a": Request("x"), "b": Request("x")}, give={}, options=(), transitions=()
)


def test_where_nobody_knows_the_ways_turns_may_help() -> None:
    one, other = StraightWay("a", ORIGIN, None, True), StraightWay("b", NORTH, EAST, True)
    assert arrival(PHASE, one, other, 1.0) == Arrival("over", ("in_turns",))


def test_where_two_swap_their_places_nothing_helps() -> None:
    one, other = StraightWay("a", ORIGIN, EAST, True), StraightWay("b", EAST, ORIGIN, True)
    assert arrival(PHASE, one, other, 0.5) is None


def test_where_one_flies_otherwise_they_keep_no_pace() -> None:
    one, other = StraightWay("a", ORIGIN, EAST, True), StraightWay("b", NORTH, FAR, False)
    assert arrival(PHASE, one, other, 0.5) == Arrival("over", ("in_turns",))


def test_what_comes_in_turns_already_is_not_told_to() -> None:
    one, other = StraightWay("a", ORIGIN, EAST, True), StraightWay("b", NORTH, FAR, True)
    assert arrival(replace(PHASE, arrive="in_turns"), one, other, 0.5) is None
