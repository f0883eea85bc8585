"""An event of the engine is one class and its emission, as CONTRIBUTING says: in a copy of the
package the checks, the schema, the reference and a flight know it."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from pages import blocks, page
from toolchain import ROOT, program

import kybflow

TEXT = page("CONTRIBUTING.md").partition("## Add an event")[2]
CLASS, EMISSION = blocks(TEXT, "python")[:2]
MISSION = """\
kybflow: 1
mission: gusty
import: {std: library/airframes.yaml}
world: {fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  nano:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: stay, within: 15 s}
      stay: {do: hover, next: [{event: gust_felt, go: down}], within: 9 s}
      down: {do: land}
on:
  - {event: any.gust_felt, seen_by: none, do: [{log: "off by {off}"}]}
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package in which every vehicle that enters a behavior emits the event."""
    copy = tmp_path_factory.mktemp("copy")
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(kybflow.__file__).parent, copy / "kybflow", ignore=ignored)
    shutil.copytree(ROOT / "missions" / "library", copy / "missions" / "library")
    (copy / "missions" / "gusty.yaml").write_text(MISSION, encoding="utf-8")
    events = copy / "kybflow" / "parts" / "events.py"
    text = events.read_text(encoding="utf-8").replace(
        "ENGINE_EVENTS:", f"{CLASS}\n\nENGINE_EVENTS:"
    )
    events.write_text(text, encoding="utf-8")
    emitter = copy / "kybflow" / "runtime" / "vehicle" / "behavior_runner.py"
    text = emitter.read_text(encoding="utf-8")
    after = "self._events.emit(began, self._name, state.at)\n"
    assert after in text
    emission = EMISSION.strip().replace("at)", "state.at)")
    text = text.replace(after, f"{after}        {emission}\n")
    text = text.replace(
        "import (\n    BehaviorEnded,", "import (\n    GustFelt,\n    BehaviorEnded,"
    )
    emitter.write_text(text, encoding="utf-8")
    return copy


def says(copy: Path, *arguments: str) -> tuple[int, str]:
    """The exit code and the output of `kybflow` from the copy."""
    done = program(*arguments, cwd=copy, path=[copy], COLUMNS="100")
    return done.returncode, done.stdout + done.stderr


def offered(schema: dict[str, Any]) -> set[str]:
    """What an editor offers where this schema holds."""
    return {snippet["body"] for snippet in schema["defaultSnippets"]}


def test_the_reference_and_the_schema_have_it(copy: Path) -> None:
    assert says(copy, "parts", "--write", "parts.md")[0] == 0
    row = (
        "| `gust_felt` | a vehicle | A gust pushed the vehicle from where it should be. |"
        " `off` [m], `seen_by` | yes |"
    )
    assert row in (copy / "parts.md").read_text(encoding="utf-8").splitlines()
    assert says(copy, "schema", "--write", "schema.json")[0] == 0
    schema = json.loads((copy / "schema.json").read_text(encoding="utf-8"))
    callback = schema["properties"]["on"]["items"]["properties"]
    assert "any.gust_felt" in offered(callback["event"])
    assert {"off", "seen_by"} <= callback.keys()
    ways_out = schema["$defs"]["behaviors"]["properties"]["next"]["items"]
    assert "gust_felt" in offered(ways_out["properties"]["event"])


def test_the_compiler_knows_it_and_its_fields(copy: Path) -> None:
    assert says(copy, "validate", "missions/gusty.yaml")[0] == 0
    (copy / "missions" / "typo.yaml").write_text(
        MISSION.replace("event: gust_felt", "event: gust_fell").replace("seen_by:", "reason:"),
        encoding="utf-8",
    )
    code, report = says(copy, "validate", "missions/typo.yaml")
    assert code != 0
    assert "did you mean `gust_felt`" in report
    assert "`any.gust_felt` has no field `reason`" in report


@pytest.mark.thorough
def test_it_is_recorded_and_answered_in_flight(copy: Path) -> None:
    code, output = says(
        copy, "run", "missions/gusty.yaml", "--out", "run", "--no-report", "--plain"
    )
    assert code == 0, output
    lines = (copy / "run" / "events.jsonl").read_text(encoding="utf-8").splitlines()
    events = [json.loads(line) for line in lines]
    gusts = [event for event in events if event["event"] == "gust_felt"]
    assert {(e["vehicle"], e["at"]) for e in gusts} >= {("nano", "missions/gusty.yaml:11")}
    assert all(event["fields"] == {"off": 0.3} for event in gusts)
    logged = [event["fields"]["text"] for event in events if event["event"] == "logged"]
    assert logged == ["off by 0.3"] * len(gusts)
    began = [e["fields"]["behavior"] for e in events if e["event"] == "behavior_started"]
    assert began == ["up", "stay", "down", "landed"]
