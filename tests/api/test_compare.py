"""What differs between runs: parameters and code, errors and expectations, the first event."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from toolchain import with_library
from typer.testing import CliRunner

import kybflow
from kybflow.api.compare import ComparedRow, compare
from kybflow.cli.app import app

MISSION = """\
kybflow: 1
mission: up
import: {std: library/airframes.yaml}
parameters: {height: {type: length, default: 1 m, help: Height.}}
world: {fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  a:
    like: std.nano_plus
    behaviors:
      up: {do: take_off, height: $height, then: hold}
      hold: {do: hover, for_time: 1 s, then: down}
      down: {do: land}
expect: [finally a in landed, max(a.state.altitude) > 80 cm]
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Path]:
    folder = with_library(tmp_path_factory.mktemp("compared"))
    (folder / "up.yaml").write_text(MISSION)
    high = kybflow.run(folder / "up.yaml", out=folder / "high")
    low = kybflow.run(folder / "up.yaml", set={"height": "60 cm"}, out=folder / "low")
    again = folder / "again"
    shutil.copytree(high.folder, again)
    return high.folder, low.folder, again


def rows_of(*folders: Path) -> dict[tuple[str, str], ComparedRow]:
    found = compare([kybflow.Run.load(folder) for folder in folders])
    return {(row.section, row.name): row for row in found}


def test_what_differs_is_found(runs: tuple[Path, Path, Path]) -> None:
    high, low, _ = runs
    rows = rows_of(high, low)
    assert rows["run", "outcome"].values == ("succeeded", "failed")
    parameters = {name: row.values for (of, name), row in rows.items() if of == "parameter"}
    assert parameters == {
        "--set": ("", "height=60 cm"),
        "vehicles.a.behaviors.up.height": ("1 m", "0.6 m"),
    }
    held, failed = rows["expectation", "max(a.state.altitude) > 80 cm"].values
    assert held is not None
    assert failed is not None
    assert held.startswith("held (")
    assert failed.startswith("FAILED (")
    assert rows["error", "a.hold mean, max"].differs
    [_, first] = rows["events", "first difference"].values
    assert first is not None
    assert first.startswith(("1", "2", "3")), first
    assert " a " in first, first


def test_a_run_is_the_same_as_its_copy(runs: tuple[Path, Path, Path]) -> None:
    high, _, again = runs
    assert [row for row in rows_of(high, again).values() if row.differs] == []


def test_the_command_shows_tables_and_json(runs: tuple[Path, Path, Path]) -> None:
    high, low, again = runs
    said = CliRunner().invoke(app, ["compare", str(high), str(low)])
    assert said.exit_code == 0
    assert "vehicles.a.behaviors.up.height  1 m" in said.output
    told = CliRunner().invoke(app, ["compare", str(high), str(low), "--json"])
    rows = json.loads(told.output)["rows"]
    assert {"section": "run", "name": "outcome", "values": ["succeeded", "failed"]} in rows
    copied = CliRunner().invoke(app, ["compare", str(high), str(again)])
    assert "run" not in copied.output.split()
    missing = CliRunner().invoke(app, ["compare", str(high), "nowhere"])
    assert missing.exit_code == 1
    assert "`nowhere` is not a readable run" in missing.stderr


def test_the_page_needs_no_other_file_and_overlays_the_errors(
    runs: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    page = tmp_path / "comparison.html"
    said = CliRunner().invoke(app, ["compare", *map(str, runs), "--html", str(page)])
    assert said.stdout.split() == [str(page)]
    text = page.read_text()
    assert not re.search(r"<(script|link|img) [^>]*(src|href)=", text)
    [data] = re.findall(r'id="figures">(.*?)</script>', text)
    errors, *states = json.loads(data)
    assert [trace["name"] for trace in errors["traces"]] == ["high", "low", "again"]
    assert {str(one["layout"]["xaxis"]) for one in states} == {str(errors["layout"]["xaxis"])}
    assert len(states) == 3
    assert re.search(r"FAILED \(\S+ cm, margin -", text)
    assert "vehicles.a.behaviors.up.height" in text


def test_a_page_that_cannot_be_written_is_told(runs: tuple[Path, Path, Path]) -> None:
    said = CliRunner().invoke(app, ["compare", *map(str, runs), "--html", "/dev/null/page.html"])
    assert said.exit_code == 1
    assert "`/dev/null/page.html` can't be written: " in said.stderr
