"""The examples of the language page about worlds, chains and libraries are valid."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pages import page
from toolchain import compiled

PAGE = page("docs/mission-language.md")
LAB = "library: lab\nimport: {std: kybflow/airframes}\nvehicles: {bee: {like: std.nano_plus}}\n"
VEHICLES = """vehicles:
  a:
    like: std.nano_plus
    start: {at: world.points.pad}
    home: world.points.dock
    behaviors: {up: {do: take_off, height: 1 m}}
"""
FENCE = "fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}"
"""The room of the examples that show something else."""
IMPORTS = {
    "The world": "import: {std: kybflow/airframes, rooms: kybflow/worlds}\n",
    "A vehicle": "import: {std: kybflow/airframes}\n",
    "Chains": "import: {std: kybflow/airframes}\n",
    "Libraries": "",
}


COURIER = """vehicles:
  courier:
    like: std.courier_quad
    airframe: courier
    estimators: [{use: tag_camera, healthy: age < 300 ms}, {use: inertial, for_at_most: 2 s}]
    behaviors: {up: {do: take_off, height: 1 m, estimators: [tag_camera]}}
"""
CALIBRATION = """image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [457, 0, 319.5, 0, 457, 239.5, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}
"""
TABLE = "family, id, size, x, y, z, heading [deg]\n36h11, 200, 0.1, 3, 3, 0, 90\n"
SEEN = ("Printed tags", "Cameras", "Targets and sensors")


def example(title: str) -> str:
    found = re.search(rf"^###? {title}\n.*?^```yaml\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    assert found is not None
    return found[1]


@pytest.mark.parametrize("target", ["sim", "lab", "replay"])
def test_what_is_seen_and_by_what_is_valid_together(target: str, tmp_path: Path) -> None:
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "front.yaml").write_text(CALIBRATION)
    (tmp_path / "lab" / "tags.csv").write_text(TABLE)
    (tmp_path / "standing.avi").write_text("frames")
    texts = "".join(map(example, SEEN))
    head = "kybflow: 1\nmission: example\nimport: {std: kybflow/airframes}\n"
    texts = texts.replace("world:\n", f"world:\n  {FENCE}\n", 1)
    plan = compiled(tmp_path / "mission.yaml", head + texts + COURIER, target=target)
    assert len(plan.tags) == 96 + 16 + 1 + 1


@pytest.mark.parametrize("title", IMPORTS)
def test_the_example_is_valid(title: str, tmp_path: Path) -> None:
    text = example(title)
    if title == "Libraries":
        flies = ", behaviors: {up: {do: take_off, height: 1 m}}}\n"
        text = text.replace("safety}]}\n", f"safety}}]{flies}").replace("0]}}\n", f"0]}}{flies}")
    elif "vehicles:" not in text:
        text += VEHICLES
    if "world:" not in text:
        text += f"world: {{{FENCE}}}\n"
    (tmp_path / "library").mkdir()
    (tmp_path / "library" / "lab.yaml").write_text(LAB)
    compiled(tmp_path / "mission.yaml", f"kybflow: 1\nmission: example\n{IMPORTS[title]}{text}")
