"""Which files of a folder are taken for missions and libraries."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from kybflow.api.validation import validate_paths
from kybflow.campaigns.cases import missions_under
from kybflow.dsl.reading.reader import mission_files

MISSION = "kybflow: 1\nmission: m\n"


def put(folder: Path, name: str, text: str | bytes) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_hidden_folders_and_those_of_runs_are_left_out(tmp_path: Path):
    mine = [put(tmp_path, name, MISSION) for name in ("deep/er/b.yml", "z.yaml")]
    put(tmp_path, ".github/ci.yaml", MISSION)
    put(tmp_path, ".venv/lib/shared.yaml", MISSION)
    put(tmp_path, "runs/one/provenance.json", "{}")
    put(tmp_path, "runs/one/mission.resolved.yaml", MISSION)
    put(tmp_path, "runs/one/files/way.yaml", MISSION)
    put(tmp_path, "runs/cut short/mission.resolved.yaml", MISSION)
    assert mission_files(tmp_path) == mine
    assert list(missions_under([tmp_path])) == mine
    assert [one.path for one in validate_paths([tmp_path], None, ())] == [str(p) for p in mine]


def test_a_hidden_folder_or_one_of_a_run_is_looked_into_when_it_is_named(tmp_path: Path):
    hidden = put(tmp_path, ".mine/a.yaml", MISSION)
    put(tmp_path, "run/provenance.json", "{}")
    flown = put(tmp_path, "run/mission.resolved.yaml", MISSION)
    assert mission_files(hidden.parent) == [hidden]
    assert mission_files(flown.parent) == [flown]
    assert list(missions_under([flown.parent])) == []


@pytest.mark.parametrize(
    "text",
    [
        "mission: m\n",
        "# a comment\n\n---\nlibrary: l\n",
        "{kybflow: 1, mission: m}\n",
        '{\n  "kybflow": 1\n}\n',
        "\ufeff'mission' : m\n",
        "  kybflow: 1\n  mission: m\n",
        "vehicles: [\nkybflow:1\n",
        "vehicles: {a: ]}\r\nmission: m\r\n",
        b"mission: caf\xe9\n",
        MISSION.encode("utf-16"),
    ],
)
def test_what_has_a_key_of_a_mission_is_one_even_when_it_is_broken(
    tmp_path: Path, text: str | bytes
):
    path = put(tmp_path, "a.yaml", text)
    assert mission_files(tmp_path) == [path]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "# mission: m\n",
        "image_width: 640\nimage_height: 480\n",
        "on: push\njobs:\n  mission: {runs-on: linux}\n",
        "- mission: m\n",
        "missions: [a]\nkybflow_version: 2\n",
    ],
)
def test_what_has_none_is_none_unless_it_is_named(tmp_path: Path, text: str):
    path = put(tmp_path, "a.yaml", text)
    assert mission_files(tmp_path) == []
    (one,) = validate_paths([path], None, ())
    assert not one.valid


def test_what_cannot_be_opened_is_reported(tmp_path: Path):
    lost = tmp_path / "lost.yaml"
    lost.symlink_to(tmp_path / "nowhere.yaml")
    (one,) = validate_paths([tmp_path], None, ())
    assert [found.code for found in one.result.diagnostics] == ["KYB001"]


def test_finding_files_is_light():
    code = "import sys, kybflow.dsl.reading.reader; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
