"""A matrix in a mission: decoded, resolved, shown, and as editors know it. Wrong ones:
`literate/matrices.md`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from toolchain import compiled

from kybflow.cli.printing.mission import show_mission
from kybflow.cli.printing.reference import show_part
from kybflow.core.params import Field, Numbers
from kybflow.core.units import ANGLE
from kybflow.dsl.diagnostics import Collector
from kybflow.dsl.language.published import Editor
from kybflow.dsl.language.schema import Schemas
from kybflow.dsl.plan import Plan
from kybflow.dsl.reading.reader import compose
from kybflow.dsl.reading.values import decode_value
from kybflow.parts.catalog import load_catalog

MISSION = """
kybflow: 1
mission: soft
import: {{std: kybflow/airframes}}
parameters: {{k: {{type: number, default: 2.5, help: How soft across.}}}}
vehicles:
  a:
    like: std.mk_quadro
    tracker: {{use: cascade, position_gain: {gain}}}
    behaviors: {{up: {{do: take_off, height: 1 m, then: down}}, down: {{do: land}}}}
"""
OWN = "[[4.0625, 0.1, 0], [1e-1, $k, 0], [0, 0, 9]]"
VALUE = ((4.0625, 0.1, 0.0), (0.1, 2.5, 0.0), (0.0, 0.0, 9.0))
GAIN = next(f for f in load_catalog().get("trackers", "cascade").fields if f.shape == "matrix")
TURN = Field("How far.", name="turn", type=Numbers("matrix", False, ANGLE, (2, 3)), key="turn")


def with_gain(place: Path, gain: str) -> Plan:
    return compiled(place, MISSION.format(gain=gain), warns=True)


def gain_of(plan: Plan) -> Any:
    return plan.vehicles[0].tracker.params.position_gain


def test_rows_become_tuples_and_a_parameter_may_be_one_of_the_numbers(tmp_path: Path) -> None:
    assert gain_of(with_gain(tmp_path / "m.yaml", OWN)) == VALUE


@pytest.mark.parametrize(
    "gain", [OWN, "[[4.1, 0.01, 0], [0.01, 5.3, 0], [0, 0, 7.123456789012345]]"]
)
def test_the_resolved_mission_reads_back_to_the_last_digit(tmp_path: Path, gain: str) -> None:
    first = with_gain(tmp_path / "m.yaml", gain)
    second = compiled(tmp_path / "again.yaml", first.resolved, warns=True)
    assert gain_of(second) == gain_of(first)


@pytest.mark.parametrize(
    ("gain", "gains", "is_estimated"),
    [
        ("null", "proportional 9, derivative", False),
        ("[[5, 0, 0], [0, 5, 0], [0, 0, 5]]", "proportional 5, derivative", False),
        ("[[5, 3, 0], [3, 5, 0], [0, 0, 4]]", "proportional 2 to 8, derivative", False),
        ("[[5, 0, 3], [0, 6, 0], [3, 0, 5]]", "proportional 2 to 8, derivative", True),
    ],
)
def test_show_says_how_stiff_it_is_and_when_margins_are_estimated(
    tmp_path: Path, gain: str, gains: str, is_estimated: bool
) -> None:
    shown = show_mission(with_gain(tmp_path / "m.yaml", gain), {})
    assert gains in shown
    assert (", estimated: the height is coupled with x and y" in shown) is is_estimated


def test_kybflow_parts_shows_its_size() -> None:
    shown = show_part(load_catalog(), "cascade")
    assert "positive definite 3 x 3 matrix of number" in shown
    assert "at least -100 and at most 100" in shown


@pytest.mark.parametrize(
    ("value", "count"),
    [
        ([[4, 0, 0], [0, "2.5", 0], [0, 0, "$k"]], 0),
        ("$gain", 0),
        ([[4, 0, 0], "$row", [0, 0, 4]], 0),
        ([[4, 0, 0], [0, 4, 0]], 1),
        ([[4, 0], [0, 4, 0], [0, 0, 4]], 1),
        ([[4, 0, 0], [0, 4, 0], [0, 0, "4 m"]], 1),
        ([[4, 0, 0], [0, 4, 0], [0, 0, 400]], 1),
        ([[4, 0, 0], [0, 4, 0], "world.points.p"], 1),
        (4, 1),
    ],
)
def test_the_schema_judges_size_and_numbers(value: object, count: int) -> None:
    editor = Editor(load_catalog())
    published = {**editor.schemas.value(GAIN, may_lack=True), "$defs": editor.shared}
    for schema in (Schemas().value(GAIN), published):
        assert len(list(Draft202012Validator(schema).iter_errors(value))) == count


@pytest.mark.parametrize(
    ("field", "inserted"),
    [
        (GAIN, "[[2, 0, 0], [0, 2, 0], [0, 0, 2]]"),
        (TURN, "[[20 deg, 0 deg, 0 deg], [0 deg, 20 deg, 0 deg]]"),
    ],
)
def test_an_editor_inserts_a_right_one(field: Field, inserted: str) -> None:
    schema = Schemas().value(field)
    assert schema["defaultSnippets"] == [{"label": inserted, "body": inserted}]
    found = Collector()
    node = compose(inserted, "editor", found)
    assert node is not None
    assert decode_value(node, field, found) is not None
    assert not found.all


def test_an_editor_says_in_words_what_is_needed() -> None:
    gain, turn = Schemas().value(GAIN), Schemas().value(TURN)
    words = [one["errorMessage"] for whole in (gain, turn) for one in (whole, whole["items"])]
    assert words == [
        "`[[...], ...]` is needed, 3 rows of 3, each a number, like `2`.",
        "A row of 3 is needed, `[...]`, each a number, like `2`.",
        "`[[...], ...]` is needed, 2 rows of 3, each an angle, like `20 deg`.",
        "A row of 3 is needed, `[...]`, each an angle, like `20 deg`.",
    ]
    assert [one["items"]["items"]["errorMessage"] for one in (gain, turn)] == [
        "A number, like `2`, is needed.",
        "An angle, like `20 deg`, is needed; its units are deg, rad.",
    ]
    assert "world" not in json.dumps([gain["pattern"], gain["items"], turn["items"]])
