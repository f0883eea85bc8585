"""The published schema is current, is a schema, and says about missions what the compiler says."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from kybflow.core.units import DIMENSIONS
from kybflow.dsl.diagnostics import Collector
from kybflow.dsl.language.published import schema_text
from kybflow.dsl.language.schema import Schemas
from kybflow.dsl.reading.nodes import to_json
from kybflow.dsl.reading.reader import compose, read
from kybflow.parts.catalog import BASES, load_catalog

REPO = Path(__file__).parents[2]
SCHEMA = json.loads(schema_text(load_catalog()))
VALIDATOR = Draft202012Validator(SCHEMA)
MISSIONS = sorted((REPO / "missions").glob("*.yaml"))


def test_the_committed_schema_is_current() -> None:
    file = "schemas/mission.schema.json"
    mend = f"mend it with: kybflow schema --write {file}"
    assert (REPO / file).read_text(encoding="utf-8") == schema_text(load_catalog()), mend


def test_it_is_a_schema() -> None:
    Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize("path", MISSIONS, ids=[p.stem for p in MISSIONS])
def test_it_accepts_every_mission(path: Path) -> None:
    root = read(path, path.name).root
    assert root is not None
    tree = to_json(root)  # as YAML 1.2 reads it: `on` is no boolean
    assert list(VALIDATOR.iter_errors(tree)) == []


@pytest.mark.parametrize(
    "state",
    [
        {"do": "take_off", "hieght": 1},
        {"do": "take_of", "height": 1},
        {"do": "take_off", "height": "1 s"},
        {"do": "take_off", "height": 1, "next": [{"when": "elapsed > 1 s"}]},
        {"do": "take_off", "height": 1, "within": "soon"},
        {"do": "circle", "center": [0, 1], "radius": 1},
        {"do": "circle", "center": [0, 1, 1], "radius": -1},
    ],
)
def test_it_refuses_what_the_compiler_refuses(state: dict[str, object]) -> None:
    tree = {"kybflow": 1, "mission": "m", "vehicles": {"a": {"behaviors": {"s": state}}}}
    assert list(VALIDATOR.iter_errors(tree)) != []


@pytest.mark.parametrize(
    ("key", "value", "is_right"),
    [
        ("tracker", "cascade", True),
        ("tracker", None, True),
        ("tracker", "casacde", False),
        ("processors", ["fence", {"use": "fence", "margin": "20 cm"}], True),
        ("processors", ["fense"], False),
        ("supervisors", [{"use": "fence", "reaction": "land"}], True),
        ("supervisors", [{"use": "fence", "reaction": "$reaction"}], True),
        ("supervisors", [{"use": "fence", "reaction": None}], True),
        ("supervisors", [{"use": "fence", "reaction": "lnad"}], False),
    ],
)
def test_a_part_by_its_name_and_a_choice(key: str, value: object, is_right: bool) -> None:
    tree = {"kybflow": 1, "mission": "m", "vehicles": {"a": {key: value}}}
    assert VALIDATOR.is_valid(tree) is is_right


def keys_of(schema: object, path: str) -> Iterator[tuple[str, dict[str, object]]]:
    """Every key that a schema describes, with where it is."""
    if isinstance(schema, list):
        for index, item in enumerate(schema):
            yield from keys_of(item, f"{path}/{index}")
    elif isinstance(schema, dict):
        own = schema.get("properties", {}) if not path.endswith("/if") else {}
        for key, value in own.items():
            if isinstance(value, dict) and "$ref" not in value:
                yield f"{path}/{key}", value
        for key, value in schema.items():
            yield from keys_of(value, f"{path}/{key}")


def test_everything_that_can_be_written_is_described() -> None:
    catalog = load_catalog()
    for kind in BASES:
        for name in catalog.names(kind):
            for key, value in Schemas().properties(catalog.get(kind, name).fields).items():
                assert value["description"], f"{kind}.{name}.{key}"
    undescribed = [path for path, value in keys_of(SCHEMA, "") if not value.get("description")]
    assert undescribed == []


@pytest.mark.parametrize(
    ("action", "count"),
    [({"log": "hello"}, 0), ({"lgo": "hello"}, 1), ({"log": "hello", "emit": "x"}, 1), ({}, 1)],
)
def test_it_refuses_an_unknown_action_and_two_in_one(action: dict[str, str], count: int) -> None:
    vehicles = {"a": {"behaviors": {"s": {"do": "land"}}}}
    tree = {
        "kybflow": 1, "mission": "m", "vehicles": vehicles,
        "on": [{"event": "a.landed", "behavior": "s", "do": [action]}],
    }  # fmt: skip
    assert len(list(VALIDATOR.iter_errors(tree))) == count


def schemas_in(schema: object, path: str = "") -> Iterator[tuple[str, dict[str, object]]]:
    """Every schema inside of a schema, with where it is."""
    if isinstance(schema, list):
        for index, item in enumerate(schema):
            yield from schemas_in(item, f"{path}/{index}")
    elif isinstance(schema, dict):
        yield path, schema
        for key, value in schema.items():
            yield from schemas_in(value, f"{path}/{key}")


def test_what_an_editor_inserts_is_right() -> None:
    dimensions = set()
    for path, schema in schemas_in(SCHEMA):
        judged = schema.get("else")
        for snippet in schema.get("defaultSnippets", ()) if isinstance(judged, dict) else ():
            if snippet["label"] == "NAME":
                continue  # its value is the author's
            found = Collector()
            node = compose(snippet["body"], "editor", found)
            assert node is not None
            assert not found.all
            whole = {**judged, "$defs": SCHEMA["$defs"]}
            assert list(Draft202012Validator(whole).iter_errors(to_json(node))) == [], path
            dimensions.update(re.findall(r"#/\$defs/(\w+)", json.dumps(judged)))
    declared = {name.replace(" ", "_") for name in DIMENSIONS} & SCHEMA["$defs"].keys()
    assert declared <= dimensions
    assert {"length", "mass", "inertia", "force", "rate_constant", "angle"} <= dimensions


def test_an_editor_shows_no_regular_expression() -> None:
    words = {"errorMessage", "patternErrorMessage"}
    shown = ((path, schema) for path, schema in schemas_in(SCHEMA) if _is_shown(path, schema))
    silent = [path for path, schema in shown if not words & schema.keys()]
    assert silent == []


def _is_shown(path: str, schema: dict[str, object]) -> bool:
    """Whether a pattern's failure is a report: one of several, as of `chain.NAME`, and a question
    are not."""
    asks = "/anyOf/" in path or "/if/" in path
    return isinstance(schema.get("pattern"), str) and not asks
