"""The examples of the language page about worlds, chains and libraries are valid."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from kybflow.catalog import load_catalog
from kybflow.dsl.compiler import compile_mission

PAGE = (Path(__file__).parents[2] / "docs" / "mission-language.md").read_text(encoding="utf-8")
LAB = "library: lab\nimport: {std: kybflow/airframes}\nvehicles: {bee: {like: std.nano_plus}}\n"
VEHICLES = "vehicles: {a: {like: std.nano_plus, behaviors: {up: {do: take_off, height: 1 m}}}}\n"
IMPORTS = {
    "The world": "import: {std: kybflow/airframes, rooms: kybflow/worlds}\n",
    "Chains": "import: {std: kybflow/airframes}\n",
    "Libraries": "",
}


@pytest.mark.parametrize("title", IMPORTS)
def test_the_example_is_valid(title: str, tmp_path: Path) -> None:
    found = re.search(rf"^## {title}\n.*?^```yaml\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    assert found is not None
    text = found[1]
    if title == "Libraries":
        flies = ", behaviors: {up: {do: take_off, height: 1 m}}}\n"
        text = text.replace("safety}]}\n", f"safety}}]{flies}").replace("0]}}\n", f"0]}}{flies}")
    elif "vehicles:" not in text:
        text += VEHICLES
    (tmp_path / "library").mkdir()
    (tmp_path / "library" / "lab.yaml").write_text(LAB)
    mission = tmp_path / "mission.yaml"
    mission.write_text(f"kybflow: 1\nmission: example\n{IMPORTS[title]}{text}")
    result = compile_mission(mission, catalog=load_catalog())
    assert [d.message for d in result.diagnostics] == []
