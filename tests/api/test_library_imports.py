"""`kybflow library` of a file and of an import's name; what `kybflow show` says of loosened
parts."""

from __future__ import annotations

from pathlib import Path

import pytest
from toolchain import printed

MISSION = """kybflow: 1
mission: hop
summary: Up and down.
import: {house: library/house.yaml, gone: library/gone.yaml}
vehicles:
  a:
    like: house.bee
    supervisors: [{use: tilt, limit: 80 deg}, {use: proximity, reaction: warn}, {use: battery, land_below: 25 %}]
    processors: [{use: fence, margin: 0 cm}]
    behaviors: {up: {do: take_off, height: 1 m}}
"""  # noqa: E501
HOUSE = """library: house
summary: What is ours.
import: {std: kybflow/airframes}
parameters: {slow: {type: speed, default: 40 cm/s}}
vehicles:
  bee: {like: std.nano_plus}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "library").mkdir()
    (tmp_path / "library" / "house.yaml").write_text(HOUSE)
    (tmp_path / "hop.yaml").write_text(MISSION)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_file_tells_what_it_has_and_what_it_imports(folder: Path) -> None:
    assert printed("library", "hop.yaml") == (
        0,
        "hop.yaml  Up and down.\n"
        "  vehicles   a\n"
        "\n"
        "import house, library/house.yaml  What is ours.\n"
        "  vehicles   bee\n"
        "  with       slow = 40 cm/s\n"
        "\n"
        "import gone, library/gone.yaml: no such library\n",
    )


def test_a_library_file_is_told_in_the_same_way(folder: Path) -> None:
    code, text = printed("library", "library/house.yaml")
    assert code == 0
    assert text.startswith("library/house.yaml  What is ours.\n  vehicles   bee\n")
    assert "import std, kybflow/airframes  Airframes and ready vehicles" in text


def test_the_name_of_an_import_is_that_of_the_mission_here(folder: Path) -> None:
    code, text = printed("library", "house")
    assert code == 0
    assert text.startswith("# `house` in hop.yaml\nlibrary/house.yaml  What is ours.\n")
    assert printed("library", "house.bee")[1].endswith("bee: {like: std.nano_plus}\n")


def test_the_name_of_an_import_is_else_that_of_the_shipped_missions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, text = printed("library", "std")
    assert code == 0
    assert "kybflow/airframes  Airframes and ready vehicles" in text
    assert printed("library", "std.nano_plus")[1].startswith("# airframe of kybflow/airframes\n")


def test_a_file_that_cannot_be_read_gets_its_report(folder: Path) -> None:
    (folder / "open.yaml").write_text("kybflow: 1\nvehicles: {a: 1\n")
    for name, report in {
        "hopp.yaml": "hopp.yaml:1:1 error[KYB001]",
        "open.yaml": "open.yaml:2:11 error[KYB004]: this `{` is never closed",
    }.items():
        code, text = printed("library", name)
        assert code == 2
        assert text.startswith(report)


def test_show_tells_what_is_looser_than_its_default(folder: Path) -> None:
    mission = folder / "hop.yaml"
    mission.write_text(MISSION.replace(", gone: library/gone.yaml", ""))
    code, text = printed("show", str(mission))
    assert code == 0
    told = [line.strip() for line in text.splitlines() if line.startswith("  loosened ")]
    assert told == [
        f"loosened   processors.fence.margin from 0.2 m to 0 m ({mission}:9)",
        f"loosened   supervisors.tilt.limit from 60 deg to 80 deg ({mission}:8)",
        f"loosened   supervisors.proximity.reaction from brake to warn ({mission}:8)",
    ]
