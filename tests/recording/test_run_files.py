"""The files that a mission names are in its run folder, and the folder is enough to fly again."""

from __future__ import annotations

import hashlib
import json
import shutil
from codecs import BOM_UTF8
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from toolchain import compiled

from kybflow.api.flight import Flown, RunRequest, fly
from kybflow.core.files import File
from kybflow.recording.layout import EVENTS_TOPIC
from kybflow.recording.run_folder import FILES, RunFolderError, contents, copies
from kybflow.recording.viewers.channels import LOG_TOPIC

MISSION = """kybflow: 1
mission: way
import: {std: kybflow/airframes}
parameters:
  height: {type: length, default: 60 cm}
vehicles:
  a:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: $height, then: way}
      way:  {do: follow_trajectory, file: ways/way.csv, then: down}
      down: {do: land}
"""
TABLE = BOM_UTF8 + b"t, x, y, z\r\n0, 0, 0, 1\r\n2, 0.5, 0, 1\r\n"
REQUEST = RunRequest(
    seed=3,
    options=(("a.processors.fence.margin", "30 cm"),),
    emitted=((3.0, "operator.pause"), (4.0, "operator.resume")),
)


def flight_from(
    mission: Path, out: Path, request: RunRequest = REQUEST, sets: tuple[str, ...] = ()
) -> Flown:
    plan = compiled(mission, sets=sets, warns=True)
    return fly(plan, RunRequest(request.seed, out, None, request.options, request.emitted, sets))


def recorded(folder: Path) -> list[tuple[str, int, Any]]:
    """Every message of the recording; events without the line that asked for them, which viewers'
    lines of the log have too."""
    with (folder / "log.mcap").open("rb") as file:
        messages = [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(file).iter_messages()
            if channel.topic != LOG_TOPIC
        ]
    return [
        (topic, time, data if topic != EVENTS_TOPIC else {**json.loads(data), "at": ""})
        for topic, time, data in messages
    ]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "missions/ways").mkdir(parents=True)
    (tmp_path / "missions/ways/way.csv").write_bytes(TABLE)
    (tmp_path / "missions/mission.yaml").write_text(MISSION)
    return tmp_path


def test_the_run_folder_is_enough_to_fly_again(folder: Path) -> None:
    first = flight_from(folder / "missions/mission.yaml", folder / "first", sets=("height=80 cm",))
    shutil.rmtree(folder / "missions")
    assert (first.folder / "ways/way.csv").read_bytes() == TABLE

    again = flight_from(first.folder / "mission.resolved.yaml", folder / "again")
    assert first.summary["outcome"] == again.summary["outcome"] == "succeeded"
    messages = recorded(first.folder)
    assert len(messages) > 1000
    assert messages == recorded(again.folder)


@pytest.mark.thorough
def test_an_earlier_run_that_holds_copies_is_an_earlier_run(folder: Path) -> None:
    mission, out = folder / "missions/mission.yaml", folder / "out"
    flight_from(mission, out)
    found = json.loads((out / "provenance.json").read_text())
    assert found["files"] == ["ways/way.csv"]
    assert hashlib.sha256(TABLE).hexdigest() in {s["sha256"] for s in found["sources"]}
    with pytest.raises(RunFolderError, match="contains an earlier run"):
        flight_from(mission, out)
    (out / "thesis.tex").write_text("precious")
    with pytest.raises(RunFolderError, match=r"files that are not of a run \(`thesis.tex`\)"):
        flight_from(mission, out)


def file(name: str, text: str = "t") -> File:
    return File(name, hashlib.sha256(text.encode()).hexdigest(), text)


@pytest.mark.parametrize(
    ("files", "placed"),
    [
        ([file("a.csv"), file("w/a.csv")], ["a.csv", "w/a.csv"]),
        ([file("./w/../a.csv"), file("a.csv")], ["a.csv"]),
        ([file("a.csv"), file("a.csv", "another")], []),
        ([file("w"), file("w/a.csv")], ["w/a.csv"]),
        ([file("log.mcap"), file("summary.json/a"), file("a.csv")], ["a.csv"]),
    ],
)
def test_a_file_is_copied_when_its_place_is_its_own(files: list[File], placed: list[str]) -> None:
    assert list(copies(files, FILES)) == placed


def test_a_copy_has_the_bytes_that_were_read() -> None:
    marked = BOM_UTF8 + b"t"
    assert contents(file("a.csv")) == b"t"
    assert contents(File("a.csv", hashlib.sha256(marked).hexdigest(), "t")) == marked
