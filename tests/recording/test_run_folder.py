"""The folder of a run: where it is, what is in it, what it never overwrites, and what others do to
its growing files."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest
from plans import part
from recorded_run import STARTED, make_plan

from kybflow.api.flight import RunRequest
from kybflow.core.signals import NS, Event
from kybflow.dsl.plan import EstimatorPlan, SensorPlan
from kybflow.recording.run_folder import GrowingFile, RunFolderError, create_run_folder, provenance

PLAN = make_plan("mk")


def test_a_run_gets_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runs = [create_run_folder(PLAN, None, STARTED) for _ in range(3)]
    for run in runs:
        run.close()
    assert [run.path for run in runs] == [
        Path("runs/figure_eight-20260102-030405"),
        Path("runs/figure_eight-20260102-030405-2"),
        Path("runs/figure_eight-20260102-030405-3"),
    ]


def test_an_earlier_run_is_never_replaced(tmp_path):
    run = create_run_folder(PLAN, tmp_path / "out", STARTED)
    assert run.finish({"outcome": "succeeded"})
    with pytest.raises(RunFolderError, match="contains an earlier run; name another folder"):
        create_run_folder(PLAN, tmp_path / "out", STARTED)
    assert json.loads((run.path / "summary.json").read_text()) == {"outcome": "succeeded"}


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (["thesis.tex"], "`thesis.tex`"),
        (["events.jsonl", "a.txt", "b.txt"], "`a.txt` and 1 more"),
        (["report.html"], "`report.html`"),
    ],
)
def test_a_folder_with_something_else_in_it_is_left_alone(tmp_path, names, told):
    for name in names:
        (tmp_path / name).write_text("precious", encoding="utf-8")
    with pytest.raises(RunFolderError) as error:
        create_run_folder(PLAN, tmp_path, STARTED)
    assert (
        str(error.value)
        == f"`{tmp_path}` contains files that are not of a run ({told}); name another folder"
    )
    assert {p.read_text(encoding="utf-8") for p in tmp_path.iterdir()} == {"precious"}


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(RunFolderError, match="can't be written"):
        create_run_folder(PLAN, tmp_path / "file" / "out", STARTED)


def test_events_are_in_the_file_as_soon_as_they_are_told(tmp_path):
    run = create_run_folder(PLAN, tmp_path, STARTED)
    run.event(Event(NS // 2, "landed", "mk", {"where": "nüremberg", "ok": True}, "m.yaml:3"))
    run.event(Event(NS, "run_ended", "", {}))
    lines = (tmp_path / "events.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line) for line in lines] == [
        {
            "t_s": 0.5,
            "event": "landed",
            "vehicle": "mk",
            "at": "m.yaml:3",
            "fields": {"where": "nüremberg", "ok": True},
        },
        {"t_s": 1.0, "event": "run_ended", "vehicle": "", "at": "", "fields": {}},
    ]
    run.finish({})


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_stops_the_events_and_nothing_else(tmp_path, monkeypatch):
    (tmp_path / "events.jsonl").symlink_to("/dev/full")
    monkeypatch.setattr("kybflow.recording.run_folder._check_empty", lambda path: None)
    run = create_run_folder(PLAN, tmp_path, STARTED)
    for _ in range(2):
        run.event(Event(0, "landed", "mk", {}))
    run.finish({})
    assert run.failed == "the list of events stopped: No space left on device"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_summary_that_cannot_be_written_is_no_summary(tmp_path):
    run = create_run_folder(PLAN, tmp_path, STARTED)
    (tmp_path / f".summary.json.{os.getpid()}").symlink_to("/dev/full")
    assert not run.finish({"outcome": "succeeded"})
    assert run.failed == f"`{tmp_path}/summary.json` can't be written: No space left on device"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["events.jsonl"]


@pytest.mark.parametrize(
    ("kind", "name", "params", "package"),
    [
        ("sensors", "simulated_camera", {}, "opencv-contrib-python-headless"),
        ("estimators", "tag_camera", {}, "opencv-contrib-python-headless"),
        ("sensors", "motion_capture", {"system": "vicon", "host": "lab"}, "motioncapture"),
    ],
)
def test_provenance_tells_the_versions_that_the_parts_need(tmp_path, kind, name, params, package):
    try:
        installed = version(package)
    except PackageNotFoundError:
        pytest.skip(f"{package} is not installed")
    used = part(kind, name, **params)
    if kind == "sensors":
        asked = {"sensors": (SensorPlan(used, ("tags",)),)}
    else:
        asked = {"estimators": (EstimatorPlan(used, recover_after=1.0),)}
    vehicles = tuple(replace(vehicle, **asked) for vehicle in PLAN.vehicles)
    plan = replace(PLAN, vehicles=vehicles)
    found = provenance(plan, {}, STARTED, ())["versions"]
    assert found[package] == installed
    assert package not in provenance(PLAN, {}, STARTED, ())["versions"]


def test_provenance_says_what_the_run_was_made_of(tmp_path):
    run = create_run_folder(PLAN, tmp_path, STARTED)
    changes = (("mk.processors.fence.margin", "30 cm"),)
    request = RunRequest(7, None, 2.0, changes, ((0.1, "operator.go"),), ("lap=8 s",))
    run.describe(PLAN, request.record(), STARTED)
    run.finish({"kybflow": 1})

    found = json.loads((tmp_path / "provenance.json").read_text(encoding="utf-8"))
    assert found["sources"] == [{"path": "missions/figure_eight.yaml", "sha256": "0" * 64}]
    assert (found["seed"], found["target"], found["speed"]) == (7, "sim", 2.0)
    assert found["set"] == ["lap=8 s"]
    assert found["option"] == ["mk.processors.fence.margin=30 cm"]
    assert found["emit"] == ["operator.go@0.1s"]
    assert found["started"] == "2026-01-02T03:04:05+00:00"
    assert {"python", "kybflow", "mujoco", "foxglove-sdk", "numpy"} <= set(found["versions"])
    assert found["machine"]["cores"] >= 1
    resolved = (tmp_path / "mission.resolved.yaml").read_text(encoding="utf-8")
    assert resolved == PLAN.resolved
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8")) == {"kybflow": 1}


def put_another(path: Path) -> None:
    path.unlink()
    path.write_bytes(b"onetwo")


def shorten(path: Path) -> None:
    with path.open("wb"):
        pass


def test_what_nobody_touches_is_whole(tmp_path: Path) -> None:
    file = GrowingFile(tmp_path / "log", "recording")
    assert [file.write(b"one"), file.write(b"two"), file.seek(0)] == [3, 3, 6]
    file.check()
    file.close()
    file.close()
    assert (file.failed, (tmp_path / "log").read_bytes()) == (None, b"onetwo")


@pytest.mark.parametrize("notices", [GrowingFile.check, GrowingFile.close])
@pytest.mark.parametrize(
    ("loses", "words"),
    [
        (Path.unlink, "was removed or moved"),
        (lambda path: path.rename(path.with_name("moved")), "was removed or moved"),
        (put_another, "was replaced"),
        (shorten, "has 3 bytes, but 6 were written"),
    ],
)
def test_what_is_lost_is_told(
    tmp_path: Path,
    loses: Callable[[Path], object],
    words: str,
    notices: Callable[[GrowingFile], None],
) -> None:
    path = tmp_path / "log"
    file = GrowingFile(path, "recording")
    file.write(b"one")
    loses(path)
    file.write(b"two")
    notices(file)
    assert file.failed == f"the recording stopped: `{path}` {words}"
    file.close()
