"""No input gives a traceback or takes long: a few of those that `bench/hostile.py` draws, and those
that once did."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from studies.hostile_answers import answer
from studies.hostile_inputs import FILES, LASTING, Hostile, drawn, lay_out

FEW = 25
LONG = 5.0
"""Seconds; an input takes 20 ms, and machines are busy."""
HEAD = b"""kybflow: 1
mission: bad
import: {std: kybflow/airframes}
parameters: {goal: {type: position, default: [1, 0, 1]}}
world: {points: {pad: [1, 0, 0]}, fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  a:
    like: std.mk_quadro
    behaviors: {up: {do: take_off, height: 1 m, then: down}, down: {do: land}}
"""
FAULT = b"faults: [{at: 3 s, on: %s, inject: gust, velocity: [1, 0, 0], for: 1 s}]\n"
ONCE = {
    "a point as the vehicle of a fault": HEAD + FAULT % b"world.points.pad",
    "a parameter's point as the vehicle of a fault": HEAD + FAULT % b"$goal",
    "a point as an event": HEAD + b"on: [{event: world.points.pad, do: [{log: x}]}]\n",
    "a point as a goal": HEAD.replace(b"then: down", b"next: [{after: 1 s, go: $goal}]"),
}


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    lay_out(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_drawn_inputs_are_answered(place: Path) -> None:
    inputs = [one for one in map(drawn, range(2 * FEW)) if one.arguments[0] not in LASTING][:FEW]
    assert len(inputs) == FEW
    wrong = [(one.arguments, found) for one in inputs if (found := answer(one, place, LONG)).wrong]
    assert wrong == []


@pytest.mark.parametrize("name", ONCE)
def test_a_point_where_a_name_is_needed_is_refused(name: str, place: Path) -> None:
    found = answer(Hostile("", {"m.yaml": ONCE[name]}, ("validate", "m.yaml")), place, LONG)
    assert found.wrong == ""
    assert "must be a name, but this is a point" in found.text


@pytest.mark.parametrize(
    "arguments",
    [
        ("validate", "a" * 5000),
        ("test", "a" * 5000),
        ("validate", "loop"),
        ("calibrate", "m.yaml", "--frames", "loop", "--poses", "loop"),
        ("run", "m.yaml", "--speed", "inf"),
        ("run", "m.yaml", "--speed", "nan"),
        ("run", "m.yaml", "--option", f"a.supervisors.{'a' * 100_000}=1"),
        ("run", "m.yaml", "--emit", f"{'a' * 100_000}@2s"),
    ],
    ids=lambda words: " ".join(word[:20] for word in words),
)
def test_an_odd_command_line_is_refused(arguments: tuple[str, ...], place: Path) -> None:
    found = answer(Hostile("", {"m.yaml": HEAD}, arguments), place, LONG, lasts=LONG)
    assert found.wrong == ""
    assert found.code == 2


def test_a_calibration_without_anything_is_refused(place: Path) -> None:
    files = {name: text.encode() for name, text in FILES.items()} | {"cam.yaml": b"# nothing\n"}
    found = answer(Hostile("", files, ("validate", "mission.yaml")), place, LONG)
    assert found.wrong == ""
    assert "KYB371" in found.text


def test_thousands_of_findings_are_answered_in_time(place: Path) -> None:
    mission = FILES["mission.yaml"].encode() * 2000
    found = answer(Hostile("", {"m.yaml": mission}, ("validate", "m.yaml")), place, LONG)
    assert found.wrong == ""
    assert "KYB007" in found.text
