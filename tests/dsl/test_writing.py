"""The resolved mission reads back as the same plan."""

from __future__ import annotations

import dataclasses
import math
import shutil
from pathlib import Path

import hypothesis
import pytest
from toolchain import SHIPPED, compiled

from kybflow.core.units import (
    ANGLE,
    ANGULAR_RATE,
    DIMENSIONS,
    LENGTH,
    SPEED,
    Dimension,
    parse_quantity,
)
from kybflow.dsl.expressions.tree import Unparsed
from kybflow.dsl.language.text import quantity
from kybflow.dsl.plan import ExpectationPlan, Place, Plan
from kybflow.dsl.reading.nodes import Mapping, Scalar, Sequence, to_json

AS_WRITTEN = {
    Plan: {"sources", "resolved", "control", "target_text", "values"},
    Place: {"driver"},
    ExpectationPlan: {"text"},
}
"""What says how a mission was written: files and its own text, what it may leave out (`control`,
the target and its drivers, which its vehicles have), its parameters, an expectation with
`$name`."""


def without_places(value: object) -> object:
    """All that a plan says, without where it says it and `AS_WRITTEN`; what is not decoded is
    text."""
    if isinstance(value, Unparsed):
        return value.text.text
    if isinstance(value, Mapping | Sequence | Scalar):
        return to_json(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        passed = {"source", *AS_WRITTEN.get(type(value), ())}
        passed |= {"at"} if isinstance(getattr(value, "at", None), str) else set()
        return {
            f.name: without_places(getattr(value, f.name))
            for f in dataclasses.fields(value)
            if f.name not in passed
        }
    if isinstance(value, dict):
        return {k: without_places(v) for k, v in value.items()}
    return [without_places(v) for v in value] if isinstance(value, list | tuple) else value


@pytest.mark.parametrize("path", SHIPPED, ids=[p.stem for p in SHIPPED])
def test_it_reads_back_as_the_same_plan(path: Path, tmp_path: Path) -> None:
    first = compiled(path)
    copy = tmp_path / "resolved.yaml"
    copy.write_text(first.resolved)
    shutil.copytree(path.parent / "trajectories", tmp_path / "trajectories")
    for source in (Path(s.path) for s in first.sources if not s.path.endswith(".yaml")):
        beside = tmp_path / source.relative_to(path.parent)
        beside.parent.mkdir(exist_ok=True)
        beside.write_bytes(source.read_bytes())
    plan = compiled(copy)
    assert without_places(plan) == without_places(first)


def test_each_line_says_where_it_came_from() -> None:
    plan = compiled(SHIPPED[0])
    for line in filter(None, plan.resolved.splitlines()):
        origin = line.rsplit("  # ", 1)[1]
        assert origin == "default" or ".yaml:" in origin


LAB = """library: lab
import: {std: kybflow/airframes}
parameters: {slow: {type: speed}, lean: {type: angle, default: 15 deg}}
vehicles:
  bee:
    like: std.mk_quadro
    processors: [{use: limit_speed, speed: $slow}, fence]
    tracker: {use: geometric, tilt: $lean}
"""
BEE = """kybflow: 1
mission: bee
import: {lab: {from: lab.yaml, with: {slow: $cruise}}}
parameters: {wait: {type: duration, default: 20 s}, pad: {type: position, default: [1, 0, 0]},
  cruise: {type: speed, default: 40 cm/s}}
world: {fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  bee:
    like: lab.bee
    start: {at: $pad}
    behaviors:
      up: {do: take_off, height: 1 m, within: $wait}
"""


Lines = dict[str, tuple[str, str]]


@pytest.fixture
def lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Lines:
    """Each line of the resolved mission and its origin, by what it begins with."""
    (tmp_path / "lab.yaml").write_text(LAB)
    (tmp_path / "bee.yaml").write_text(BEE)
    monkeypatch.chdir(tmp_path)
    plan = compiled("bee.yaml", sets=["wait=9s"])
    pairs = [line.rsplit("  # ", 1) for line in plan.resolved.splitlines() if line]
    return {text.strip().partition(",")[0]: (text.strip(), origin) for text, origin in pairs}


def test_a_value_that_took_the_place_of_a_parameter_says_where_it_stands(
    lines: Lines,
) -> None:
    assert lines["- {use: limit_speed"][1] == "lab.yaml:7, speed from bee.yaml:5"
    assert lines["tracker: {use: geometric"][1] == "lab.yaml:8, tilt from lab.yaml:3"
    assert lines["start: {at: [1 m"][1] == "bee.yaml:10, at from bee.yaml:4"
    assert lines["up: {do: take_off"][1] == "bee.yaml:12, within from --set:1"


def test_angles_and_shares_are_written_as_an_author_does(lines: Lines) -> None:
    assert ", tilt: 15 deg, " in lines["tracker: {use: geometric"][0]
    assert "warn_below: 30 %" in lines["- {use: battery"][0]


def test_the_standard_library_is_called_by_its_package(lines: Lines) -> None:
    origin = lines["mass: 1.05 kg"][1]
    assert origin.startswith("kybflow/missions/library/airframes.yaml:")


def test_a_value_that_no_degree_is_exact_for_stays_in_radians() -> None:
    assert quantity(0.349, ANGLE) == "0.349 rad"
    assert quantity(math.radians(20), ANGLE) == "20 deg"
    assert quantity(0.0, ANGULAR_RATE) == "0 deg/s"


@pytest.mark.parametrize(
    ("text", "dimension"),
    [
        ("18 mm", LENGTH),
        ("7 cm", LENGTH),
        ("5 km/h", SPEED),
        ("0.6 m", LENGTH),
        ("7.3 mm/s", SPEED),
    ],
)
def test_a_value_is_written_in_the_unit_in_which_it_is_short(
    text: str, dimension: Dimension
) -> None:
    value = parse_quantity(text, dimension)
    written = quantity(value, dimension)
    assert parse_quantity(written, dimension) == value
    assert len(written) <= len("0.0073 m/s")


@pytest.mark.parametrize("dimension", DIMENSIONS.values(), ids=DIMENSIONS)
@hypothesis.given(value=hypothesis.strategies.floats(-1e9, 1e9))
def test_a_value_is_written_exactly(dimension: Dimension, value: float) -> None:
    assert parse_quantity(quantity(value, dimension), dimension) == value


def test_millimetres_are_written_as_such() -> None:
    assert quantity(parse_quantity("18 mm", LENGTH), LENGTH) == "18 mm"
