"""`kybflow library`, `new` and `show`: what is shipped, begun from it and shown of it."""

from __future__ import annotations

from pathlib import Path

import pytest
from installed_package import package
from toolchain import ROOT, compiled, printed

from kybflow.api.flight import RunRequest, fly
from kybflow.api.library import SCHEMA, libraries, missions, scaffold
from kybflow.core.errors import KybflowError

SURVEY = str(ROOT / "missions" / "survey.yaml")


def test_library_lists_what_is_at_hand() -> None:
    code, text = printed("library")
    assert code == 0
    for name in ("kybflow/airframes", "nano_plus", "indoor_safety", "flight_lab", "figure_eight"):
        assert name in text
    assert "line(first, last, speed = 50 cm/s, hold = 1 s)" in text


def test_library_shows_a_file_a_mission_and_an_entry() -> None:
    assert "summary: Rooms to fly in." in printed("library", "kybflow/worlds")[1]
    assert "mission: survey" in printed("library", "survey")[1]
    code, text = printed("library", "line")
    assert code == 0
    assert text.startswith("# chain of kybflow/chains\nline:\n")
    assert text.rstrip().endswith("wait:  {do: hover, for_time: $hold}")


def test_library_of_an_unknown_name_ends_with_2() -> None:
    code, text = printed("library", "flight_lap")
    assert code == 2
    assert "flight_lab" in text


def test_a_package_ships_libraries_and_missions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package(tmp_path, "kybshelf", "library: quads\nsummary: Theirs.\n")
    (tmp_path / "kybshelf" / "missions" / "hop.yaml").write_text("kybflow: 1\nmission: hop\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert "kybshelf/quads" in [one.name for one in libraries()]
    assert "kybshelf/hop" in [one.name for one in missions()]


def test_a_package_without_its_files_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package(tmp_path, "kybhollow", None)
    monkeypatch.syspath_prepend(tmp_path)
    assert "kybhollow: installed without its YAML files" in printed("library")[1]


@pytest.mark.thorough
@pytest.mark.parametrize("origin", [one.name for one in missions()])
def test_a_new_mission_is_valid_in_an_empty_folder(origin: str, tmp_path: Path) -> None:
    scaffold("mine", origin, tmp_path)
    mission = tmp_path / "mine.yaml"
    plan = compiled(mission)
    assert plan.mission == "mine"
    assert (tmp_path / SCHEMA).is_file()
    assert f"$schema={SCHEMA}" in mission.read_text().splitlines()[0]


def test_a_new_mission_flies(tmp_path: Path) -> None:
    scaffold("hop", "first_flight", tmp_path)
    plan = compiled(tmp_path / "hop.yaml")
    assert fly(plan, RunRequest(out=tmp_path / "run")).summary["outcome"] == "succeeded"


def test_a_new_mission_brings_the_files_that_it_names(tmp_path: Path) -> None:
    written = scaffold("mine", "trajectory", tmp_path)
    brought = tmp_path / "trajectories" / "clover.csv"
    assert written == (brought, tmp_path / "mine.yaml", tmp_path / SCHEMA)
    assert scaffold("other", "trajectory", tmp_path) == (tmp_path / "other.yaml",)
    brought.write_text("mine")
    with pytest.raises(KybflowError, match="already exists"):
        scaffold("third", "trajectory", tmp_path)
    assert not (tmp_path / "third.yaml").exists()


def test_new_overwrites_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert printed("new", "hop") == (
        0,
        f"wrote hop.yaml\nwrote {SCHEMA}\nfly it: kybflow run hop.yaml\n",
    )
    Path("hop.yaml").write_text("mine")
    Path(SCHEMA).write_text("{}")
    code, text = printed("new", "hop", "--from", "survey")
    assert code == 2
    assert "`hop.yaml` already exists" in text
    assert printed("new", "skip") == (0, "wrote skip.yaml\nfly it: kybflow run skip.yaml\n")
    assert (Path("hop.yaml").read_text(), Path(SCHEMA).read_text()) == ("mine", "{}")


@pytest.mark.parametrize(
    ("name", "origin", "said"),
    [
        ("7up", "survey", "can't be the name"),
        ("../up", "survey", "can't be the name"),
        ("up", "survay", "did you mean `survey`?"),
    ],
)
def test_new_says_what_is_wrong(name: str, origin: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(KybflowError) as refused:
        scaffold(name, origin, tmp_path)
    assert said in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_show_tells_what_a_mission_does() -> None:
    code, text = printed("show", SURVEY, "--set", "cruise=50cm/s")
    assert code == 0
    assert "cruise  0.5 m/s" in text
    assert "scout (0.23 kg, 0.19 m across)" in text
    assert "lines not done within 60 s: home" in text


def test_show_resolved_gives_each_line_its_origin() -> None:
    code, text = printed("show", SURVEY, "--resolved")
    assert code == 0
    assert all("  # " in line for line in text.splitlines() if line)
    assert "chains.yaml:13" in next(x for x in text.splitlines() if "lines.there.reach:" in x)


def test_show_of_a_bad_mission_reports(tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text("kybflow: 1\nmission: m\nvehicels: {}\n")
    code, text = printed("show", str(path))
    assert code == 2
    assert "KYB101" in text


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
