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
from toolchain import ROOT

import kybflow
from kybflow.core.params import RESERVED, fields_of
from kybflow.dsl.language.records import PartOf
from kybflow.dsl.language.tables import records


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
        file="dsl/plan.py", before="    home: Position | None = key(",
        line='spares: int = key("Batteries at hand.", default=1, at_least=0, at_most=9)',
        record="vehicle",
        said="Batteries at hand. Default: 1. At least 0 and at most 9.",
        facts={"minimum": 0, "maximum": 9}, offered=["1"],
        row="| `spares` | Batteries at hand. | integer, at least 0 and at most 9 | `1` |",
        written="4", value=4, text="4", wrong="12", code="KYB105",
    ),
    "input": Key(
        file="dsl/plan.py", before="    dead_man: str | None = key(",
        line='hand: Literal["left", "right"] = key("The hand that holds it.", default="right")',
        record="input", said="The hand that holds it. Default: right.",
        facts={"enum": ["left", "right"]}, offered=["left", "right"],
        row="| `hand` | The hand that holds it. | left \\| right | `right` |",
        written="left", value="left", text="left", wrong="both", code="KYB109",
    ),
    "phase": Key(
        file="dsl/plan.py", before="    arrive: Arrive | None = key(",
        line='lull: Duration | None = key("How long it rests.", default=None, above=0.0)',
        record="phase", said="How long it rests. Above 0 s.",
        facts={"exclusiveMinimum": 0.0, "x-dimension": "duration"}, offered=["300 ms"],
        row="| `lull` | How long it rests. | duration [s], above 0 s |  |",
        written="1.5 s", value=1.5, text="1.5 s", wrong="1.5 m", code="KYB104",
    ),
    "target": Key(
        file="dsl/plan.py",
        before='    driver: Annotated[PartPlan | None, part_of("drivers")] = key(',
        line='reach: Length = key("How far it is heard.", default=50.0, above=0.0, at_most=500.0)',
        record="vehicle's target",
        said="How far it is heard. Default: 50 m. Above 0 m and at most 500 m.",
        facts={"exclusiveMinimum": 0.0, "maximum": 500.0, "x-dimension": "length"},
        offered=["50 m"],
        row="| `reach` | How far it is heard. | length [m], above 0 m and at most 500 m | `50 m` |",
        written="80 cm", value=0.8, text="0.8 m", wrong="2 km", code="KYB105",
    ),
    "option": Key(
        file="runtime/behaviors/hover.py", before="    for_time: Duration | None = param(",
        line="stiffness: Matrix[Literal[2], Literal[2], Length] = "
        'param("How it gives way.", default=((1.0, 0.0), (0.0, 1.0)), at_least=0.0)',
        record="",
        said="How it gives way. Default: [[1 m, 0 m], [0 m, 1 m]]. At least 0 m.",
        facts={"minimum": 0.0, "minItems": 2, "maxItems": 2, "x-dimension": "length"},
        offered=["[[1 m, 0 m], [0 m, 1 m]]"],
        row="| `stiffness` | 2 x 2 matrix of length [m] | [[1 m, 0 m], [0 m, 1 m]] | at least 0 m |"
        "  | How it gives way. |",
        written="[[2 m, 0], [50 cm, 1]]", value=[[2.0, 0.0], [0.5, 1.0]],
        text="[[2 m, 0 m], [0.5 m, 1 m]]", wrong="[[2 m, 0], [-1 m, 1]]", code="KYB105",
    ),
}  # fmt: skip
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
      launch: {run: {a: up}, PHASE, next: [{when: a in landed, go: end}], within: 60 s,
               otherwise: end}
targets:
  sim: {a: {driver: sim, TARGET}}
"""
IN_EACH = """\
kybflow: 1
mission: in_each
spare_plan: V
import: {std: library/airframes.yaml}
world:
  spare_world: V
  fence: {from: [-5, -5, 0], to: [5, 5, 4], spare_corners: V}
  obstacles:
    post: {cylinder: {at: [4, 4, 0], radius: 10 cm, height: 1 m, spare_cylinderparams: V}}
    ball: {sphere: {at: [4, -4, 1], radius: 10 cm, spare_sphereparams: V}, spare_obstacle: V}
    wall: {plane: {at: [0, -4.9, 0], facing: [0, 1, 0], spare_planeparams: V}}
  tags:
    floor: {grid: {family: 36h11, count: [2, 2], size: 10 cm, spacing: 2 cm, spare_gridparams: V}}
    one: {tag: {family: 36h11, id: 9, size: 5 cm, at: [2, 2, 0], spare_tagparams: V}, spare_tags: V}
airframes:
  quad:
    like: std.mk_quadro
    spare_body: V
    cameras:
      down: {at: [0, 0, 0], width: 640, height: 480, field_of_view: 70 deg, spare_cameraplan: V}
chains: {pause: {behaviors: {wait: {do: hover, for_time: 1 s}}}}
inputs: {stick: {use: keyboard, spare_inputplan: V}}
vehicles:
  a:
    airframe: quad
    spare_vehicleplan: V
    start: {at: [0, 0, 0], spare_start: V}
    estimators: [{use: mocap, spare_estimatorplan: V}]
    behaviors:
      up:   {do: take_off, height: 1 m, then: stay, within: 15 s, spare_stateplan: V}
      stay: {do: chain.pause, then: down, spare_chainplan: V}
      down: {do: land}
flows:
  team:
    spare_flowplan: V
    phases:
      go: {run: {a: up}, spare_phaseplan: V, next: [{after: 9 s, go: end, spare_transitionplan: V}]}
on: [{event: a.landed, do: [{log: down}], spare_callbackplan: V}]
faults: [{at: 5 s, on: a, inject: gust, velocity: [0.1, 0, 0], spare_faultplan: V}]
targets: {sim: {a: {driver: sim, spare_place: V}}}
"""
"""A mission with a key more in each record that a plan is made of."""
NAMES = re.findall(r"spare_\w+", IN_EACH)
COMPILING = """\
import json, sys
from dataclasses import fields, is_dataclass
from pathlib import Path

from kybflow.dsl.compiler import compile_mission
from kybflow.parts.catalog import load_catalog

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


def judged(name, keys):
    "What a mission is as it is written, and as it is written out."
    plan, found = compiled(name)
    told = {"found": found}
    if plan is not None:
        told |= {"resolved": plan.resolved, "values": {k: [*values(plan, k)] for k in keys}}
        Path("missions/again.yaml").write_text(plan.resolved, encoding="utf-8")
        again, told["found_again"] = compiled("again")
        told["resolved_again"] = again and again.resolved
    return plan, told


"""
"""Python of the copy, run beside it."""
PROBE = """\
from kybflow.cli.printing.reference import page
from kybflow.dsl.language.published import mission_schema
from kybflow.dsl.language.schema import Schemas, record_schema
from kybflow.dsl.language.tables import records, with_tables
from kybflow.runtime.options import check_options


def options(plan, wanted):
    try:
        check_options(plan, wanted)
    except Exception as error:
        return str(error)


docs, names = Path("language.md"), dict(json.loads(sys.argv[1]))
docs.write_text("".join(f"<!-- keys: {t} -->\\n<!-- end -->\\n" for t in records()))
plan, told = judged("right", names.values())
told |= {
    "published": mission_schema(catalog),
    "records": {title: record_schema(cls)["properties"] for title, cls in records().items()},
    "tables": with_tables(docs),
    "part": Schemas().properties(catalog.get("behaviors", "hover").fields),
    "page": page(),
    "wrong": {kind: compiled(f"wrong_{kind}")[1] for kind in names},
}
if plan is not None:
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


def copied(copy: Path, missions: dict[str, str]) -> Path:
    """A copy of the package with missions beside it."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(kybflow.__file__).parent, copy / "kybflow", ignore=ignored)
    shutil.copytree(ROOT / "missions" / "library", copy / "missions" / "library")
    for name, text in missions.items():
        (copy / "missions" / f"{name}.yaml").write_text(text, encoding="utf-8")
    return copy


def told_by(copy: Path, program: str, given: Any) -> dict[str, Any]:
    """What a program in the copy prints."""
    done = subprocess.run(
        [sys.executable, "-c", f"{COMPILING}{program}", json.dumps(given)],
        env={**os.environ, "PYTHONPATH": str(copy)},
        cwd=copy, text=True, capture_output=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a copy of the package with these lines says of them."""
    missions = {"right": mission()}
    missions |= {f"wrong_{kind}": mission(**{kind: key.wrong}) for kind, key in KEYS.items()}
    copy = copied(tmp_path_factory.mktemp("copy"), missions)
    for key in KEYS.values():
        file = copy / "kybflow" / key.file
        text = file.read_text(encoding="utf-8")
        assert text.count(key.before) == 1, key.before
        text = text.replace(key.before, f"    {key.line}\n{key.before}")
        if key.file != "dsl/plan.py":
            names = "from typing import Literal\nfrom kybflow.core.units import Length, Matrix\n"
            text = text.replace("import annotations\n", f"import annotations\n{names}", 1)
        file.write_text(text.replace("import Angle,", "import Angle, Length,"), encoding="utf-8")
    return told_by(copy, PROBE, {kind: key.name for kind, key in KEYS.items()})


@pytest.fixture(scope="module")
def in_each(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a copy of the package says in which every record has a key more."""
    missions = {"right": IN_EACH.replace(" V", " 2 m"), "wrong": IN_EACH.replace(" V", " 9 m")}
    copy = copied(tmp_path_factory.mktemp("copy"), missions)
    for name in ("plan.py", "world.py"):
        file = copy / "kybflow" / "dsl" / name
        first = r"(@record\([^\n]*\)\nclass (\w+)\((?:(?!\n@).)*?\n)(    \w+: [^\n]* = key\()"
        head, mark, records = file.read_text(encoding="utf-8").partition("\n@record(")
        records = re.sub(first, with_a_key_more, f"{mark[1:]}{records}", flags=re.DOTALL)
        names = "from kybflow.core.units import Length\n"
        head = head.replace("import annotations\n", f"import annotations\n{names}", 1)
        file.write_text(f"{head}\n{records}", encoding="utf-8")
    program = (
        'told = judged("right", json.loads(sys.argv[1]))[1]\n'
        'print(json.dumps({**told, "wrong": compiled("wrong")[1]}))\n'
    )
    return told_by(copy, program, NAMES)


def with_a_key_more(match: re.Match[str]) -> str:
    line = 'Length = key("Not used.", default=1.0, above=0.0, at_most=5.0)'
    return f"{match[1]}    spare_{match[2].lower()}: {line}\n{match[3]}"


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
        shared = schema.get("$defs", {})
        for step in path:
            schema = schema["additionalProperties"] if step == "*" else schema["properties"][step]
            schema = shared[schema["$ref"].rpartition("/")[2]] if "$ref" in schema else schema
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
        None, "`a.behaviors.stay.stiffness` must be at least 0 m, not `-4 cm`; "
        "write it like `1.2 m`",
    ]  # fmt: skip


def test_one_line_is_enough_in_each_record_of_a_plan(in_each: dict[str, Any]) -> None:
    assert in_each["found"] == []
    assert [name for name in NAMES if 2.0 not in in_each["values"][name]] == []
    assert [name for name in NAMES if f"{name}: 2 m" not in in_each["resolved"]] == []
    assert in_each["found_again"] == []
    assert without_origins(in_each["resolved_again"]) == without_origins(in_each["resolved"])


def test_a_wrong_value_is_found_in_each_record_of_a_plan(in_each: dict[str, Any]) -> None:
    lines = [
        line for line, text in enumerate(IN_EACH.splitlines(), 1) for _ in text.split(" V")[1:]
    ]
    found = [(code, int(at.rpartition(":")[2])) for code, at, _ in in_each["wrong"]]
    assert found == [("KYB105", line) for line in lines]


@pytest.mark.parametrize("title", records())
def test_no_parameter_of_a_part_is_called_like_a_key_beside_it(title: str) -> None:
    """The one thing that is said in a second place, because `core` knows no record."""
    fields = fields_of(records()[title])
    if any(isinstance(f.type, PartOf) and f.type.word == f.key for f in fields):
        assert {field.key for field in fields} - RESERVED == set()
