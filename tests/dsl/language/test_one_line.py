"""A plain key of the language is one line: in a copy of the package in which several records have
one more, the schema, the docs, completion, the plan and its text have it, and a wrong value is
found."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import kybflow

ROOT = Path(__file__).parents[3]


class Key(NamedTuple):
    """A key that is added, and what must follow from its line.

    after: what the line goes before, in `file`. record: whose table has it; empty for a part. said:
    its description. facts: what judges it in the schema. offered: what an editor inserts. row: its
    row in the docs. A mission writes `written`, which is `value` in the plan and `text` where that
    is written out; `wrong` is found with `code`.
    """

    file: str
    before: str
    line: str
    record: str
    said: str
    facts: dict[str, Any]
    offered: list[Any]
    row: str
    written: str
    value: Any
    text: str
    wrong: str
    code: str

    @property
    def name(self) -> str:
        return self.line.partition(":")[0]


KEYS = {
    "vehicle": Key(
        file="dsl/plan.py",
        before="    home: Position | None = key(",
        line='spares: int = key("Batteries at hand.", default=1, at_least=0, at_most=9)',
        record="vehicle",
        said="Batteries at hand. Default: 1. At least 0 and at most 9.",
        facts={"minimum": 0, "maximum": 9},
        offered=["1"],
        row="| `spares` | Batteries at hand. | integer, at least 0 and at most 9 | `1` |",
        written="4",
        value=4,
        text="4",
        wrong="12",
        code="KYB105",
    ),
    "input": Key(
        file="dsl/plan.py",
        before="    dead_man: str | None = key(",
        line='hand: Literal["left", "right"] = key("The hand that holds it.", default="right")',
        record="input",
        said="The hand that holds it. Default: right.",
        facts={"enum": ["left", "right"]},
        offered=["left", "right"],
        row="| `hand` | The hand that holds it. | left \\| right | `right` |",
        written="left",
        value="left",
        text="left",
        wrong="both",
        code="KYB109",
    ),
    "phase": Key(
        file="dsl/plan.py",
        before="    arrive: Arrive | None = key(",
        line='lull: Duration | None = key("How long it rests.", default=None, above=0.0)',
        record="phase",
        said="How long it rests. Above 0 s.",
        facts={"exclusiveMinimum": 0.0, "x-dimension": "duration"},
        offered=["300 ms"],
        row="| `lull` | How long it rests. | duration [s], above 0 s |  |",
        written="1.5 s",
        value=1.5,
        text="1.5 s",
        wrong="1.5 m",
        code="KYB104",
    ),
    "target": Key(
        file="dsl/plan.py",
        before='    driver: Annotated[PartPlan | None, part_of("drivers")] = key(',
        line='reach: Length = key("How far it is heard.", default=50.0, above=0.0, at_most=500.0)',
        record="vehicle's target",
        said="How far it is heard. Default: 50 m. Above 0 m and at most 500 m.",
        facts={"exclusiveMinimum": 0.0, "maximum": 500.0, "x-dimension": "length"},
        offered=["1.2 m"],
        row="| `reach` | How far it is heard. | length [m], above 0 m and at most 500 m | `50 m` |",
        written="80 cm",
        value=0.8,
        text="0.8 m",
        wrong="2 km",
        code="KYB105",
    ),
    "option": Key(
        file="runtime/behaviors/hover.py",
        before="    for_time: Duration | None = param(",
        line="stiffness: Annotated[Matrix, Rows(2, 2, LENGTH)] = "
        'param("How it gives way.", default=((1.0, 0.0), (0.0, 1.0)), at_least=0.0)',
        record="",
        said="How it gives way. Default: [[1 m, 0 m], [0 m, 1 m]]. At least 0 m.",
        facts={"minimum": 0.0, "minItems": 2, "maxItems": 2, "x-dimension": "length"},
        offered=["[[1 m, 0 m], [0 m, 1 m]]"],
        row="| `stiffness` | 2 x 2 matrix of length [m] | [[1 m, 0 m], [0 m, 1 m]] | at least 0 m |"
        "  | How it gives way. |",
        written="[[2 m, 0], [50 cm, 1]]",
        value=[[2.0, 0.0], [0.5, 1.0]],
        text="[[2 m, 0 m], [0.5 m, 1 m]]",
        wrong="[[2 m, 0], [-1 m, 1]]",
        code="KYB105",
    ),
}
MISSION = """\
kybflow: 1
mission: one_line
import: {std: library/airframes.yaml}
world: {fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
inputs:
  stick: {use: keyboard, INPUT}
vehicles:
  a:
    like: std.nano_plus
    VEHICLE
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: stay, within: 15 s}
      stay: {do: hover, OPTION, next: [{event: stick.enter, go: down}], within: 9 s}
      down: {do: land}
flows:
  team:
    phases:
      launch: {run: {a: up}, PHASE, next: [{when: a in landed, go: end}], within: 60 s, otherwise: end}
targets:
  sim: {a: {driver: sim, TARGET}}
"""
PROBE = """\
import json, sys
from dataclasses import fields, is_dataclass
from pathlib import Path

from kybflow.cli.printing.parts import page
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.language.published import mission_schema
from kybflow.dsl.language.schema import params_schema, record_schema
from kybflow.dsl.language.tables import records, with_tables
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.options import check_options

catalog = load_catalog()


def compiled(name):
    result = compile_mission(f"missions/{name}.yaml", catalog=catalog)
    errors = [(d.code, d.span.at, d.span.column) for d in result.diagnostics
              if d.severity.value == "error"]
    return result.plan, errors


def values(value, key):
    "The values of every field of a plan that is called `key`."
    if is_dataclass(value):
        if hasattr(value, key):
            yield getattr(value, key)
        for field in fields(value):
            if field.name != "source":
                yield from values(getattr(value, field.name), key)
    elif isinstance(value, dict | tuple):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from values(inner, key)


def options(plan, wanted):
    try:
        check_options(plan, wanted)
    except Exception as error:
        return str(error)


docs, names = Path("language.md"), dict(json.loads(sys.argv[1]))
docs.write_text("".join(f"<!-- keys: {t} -->\\n<!-- end -->\\n" for t in records()))
plan, found = compiled("right")
told = {
    "found": found,
    "published": mission_schema(catalog),
    "records": {title: record_schema(cls)["properties"] for title, cls in records().items()},
    "tables": with_tables(docs),
    "part": params_schema(catalog.get("behaviors", "hover").fields, "hover")["properties"],
    "page": page(),
    "wrong": {kind: compiled(f"wrong_{kind}")[1] for kind in names},
}
if plan is not None:
    told["resolved"] = plan.resolved
    told["values"] = {key: [*values(plan, key)] for key in names.values()}
    Path("missions/again.yaml").write_text(plan.resolved, encoding="utf-8")
    again, told["found_again"] = compiled("again")
    if again is not None:
        told["resolved_again"] = again.resolved
    told["options"] = [
        options(plan, [("a.behaviors.stay.stiffness", "[[3 m, 0], [0, 40 cm]]")]),
        options(plan, [("a.behaviors.stay.stiffness", "[[3 m, 0], [0, -4 cm]]")]),
    ]
print(json.dumps(told))
"""


def mission(**wrong: str) -> str:
    """The mission with each key, some of them with the value that is wrong."""
    text = MISSION
    for kind, key in KEYS.items():
        text = text.replace(kind.upper(), f"{key.name}: {wrong.get(kind, key.written)}")
    return text


def place_of(value: str, text: str) -> tuple[int, int]:
    """The line and the column where a text stands, from 1."""
    [line] = (i for i, one in enumerate(text.splitlines(), 1) if value in one)
    return line, text.splitlines()[line - 1].index(value) + 1


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a copy of the package with these lines says of them."""
    copy = tmp_path_factory.mktemp("copy")
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(kybflow.__file__).parent, copy / "kybflow", ignore=ignored)
    shutil.copytree(ROOT / "missions" / "library", copy / "missions" / "library")
    for key in KEYS.values():
        file = copy / "kybflow" / key.file
        text = file.read_text(encoding="utf-8")
        assert text.count(key.before) == 1, key.before
        text = text.replace(key.before, f"    {key.line}\n{key.before}")
        if key.file != "dsl/plan.py":
            names = "from typing import Annotated\nfrom kybflow.core.units import LENGTH, Matrix, Rows\n"
            text = text.replace("import annotations\n", f"import annotations\n{names}", 1)
        file.write_text(text.replace("import Angle,", "import Angle, Length,"), encoding="utf-8")
    missions = {"right": mission()}
    missions |= {f"wrong_{kind}": mission(**{kind: key.wrong}) for kind, key in KEYS.items()}
    for name, text in missions.items():
        (copy / "missions" / f"{name}.yaml").write_text(text, encoding="utf-8")
    names = json.dumps({kind: key.name for kind, key in KEYS.items()})
    done = subprocess.run(
        [sys.executable, "-c", PROBE, names],
        env={**os.environ, "PYTHONPATH": str(copy)},
        cwd=copy, text=True, capture_output=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def everywhere(schema: Any) -> Iterator[tuple[str, Any]]:
    """Each keyword of a schema with its value, at any depth."""
    if isinstance(schema, dict):
        for keyword, value in schema.items():
            yield keyword, value
            yield from everywhere(value)
    elif isinstance(schema, list):
        for one in schema:
            yield from everywhere(one)


def published(schema: dict[str, Any], kind: str) -> dict[str, Any]:
    """The published schema of a key."""

    def of(schema: dict[str, Any], *path: str) -> dict[str, Any]:
        for step in path:
            schema = schema["additionalProperties"] if step == "*" else schema["properties"][step]
        return schema

    if kind == "option":
        state = of(schema, "vehicles", "*", "behaviors", "*")
        cases = (case for case in state["allOf"] if "properties" in case["if"])
        [hover] = (c for c in cases if c["if"]["properties"]["do"].get("const") == "hover")
        return of(hover["then"], "stiffness")
    paths = {
        "vehicle": ("vehicles", "*"), "input": ("inputs", "*"), "target": ("targets", "*", "*"),
        "phase": ("flows", "*", "phases", "*"),
    }  # fmt: skip
    return of(schema, *paths[kind], KEYS[kind].name)


def without_origins(resolved: str) -> str:
    return re.sub(r" +#.*", "", resolved)


@pytest.mark.parametrize("kind", KEYS)
def test_the_schema_has_it_with_help_default_and_bounds(told: dict[str, Any], kind: str) -> None:
    key = KEYS[kind]
    schema = (told["records"][key.record] if key.record else told["part"])[key.name]
    assert schema["description"].startswith(key.said)
    assert {name: dict(everywhere(schema)).get(name) for name in key.facts} == key.facts


@pytest.mark.parametrize("kind", KEYS)
def test_editors_complete_it(told: dict[str, Any], kind: str) -> None:
    schema = published(told["published"], kind)
    snippets = [snippet["body"] for snippet in schema.get("defaultSnippets", ())]
    assert schema["description"].startswith(KEYS[kind].said)
    assert schema.get("examples", snippets) == KEYS[kind].offered


@pytest.mark.parametrize("kind", KEYS)
def test_the_docs_have_its_row(told: dict[str, Any], kind: str) -> None:
    key = KEYS[kind]
    page = told["page"]
    if key.record:
        page = told["tables"].partition(f"<!-- keys: {key.record} -->")[2].partition("<!--")[0]
    assert key.row in page.splitlines()


@pytest.mark.parametrize("kind", KEYS)
def test_a_mission_that_writes_it_compiles_and_the_plan_has_its_value(
    told: dict[str, Any], kind: str
) -> None:
    assert told["found"] == []
    assert KEYS[kind].value in told["values"][KEYS[kind].name]


@pytest.mark.parametrize("kind", KEYS)
def test_the_resolved_mission_has_it_and_reads_back(told: dict[str, Any], kind: str) -> None:
    assert f"{KEYS[kind].name}: {KEYS[kind].text}" in told["resolved"]
    assert told["found_again"] == []
    assert without_origins(told["resolved_again"]) == without_origins(told["resolved"])


@pytest.mark.parametrize("kind", KEYS)
def test_a_wrong_value_is_found_at_its_place(told: dict[str, Any], kind: str) -> None:
    key = KEYS[kind]
    line, column = place_of(key.wrong, mission(**{kind: key.wrong}))
    [(code, at, where)] = told["wrong"][kind]
    assert (code, at) == (key.code, f"missions/wrong_{kind}.yaml:{line}")
    assert column <= where < column + len(key.wrong)


def test_an_option_of_a_part_is_set_by_a_person(told: dict[str, Any]) -> None:
    assert told["options"] == [
        None, "`a.behaviors.stay.stiffness` must be at least 0, not -0.04 m"
    ]  # fmt: skip
