"""What scripts do: validate, rehearse, fly, and look at a run as arrays."""

from __future__ import annotations

import csv
import math
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from toolchain import with_library

import kybflow
from kybflow.recording.run_folder import RunFolderError
from kybflow.recording.signals import fields_of

MISSION = """\
kybflow: 1
mission: up
import: {std: library/airframes.yaml}
parameters: {height: {type: length, default: 1 m, help: Height.}}
vehicles:
  a:
    like: std.nano_plus
    behaviors:
      up: {do: take_off, height: $height, then: hold}
      hold: {do: hover, for_time: 2 s, then: down}
      down: {do: land}
expect: [finally a in landed]
"""
FIRST = 15
"""The most names that scripts have to know."""


@pytest.fixture(scope="module")
def mission(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = with_library(tmp_path_factory.mktemp("experiment")) / "up.yaml"
    path.write_text(MISSION)
    return path


@pytest.fixture(scope="module")
def flown(mission: Path) -> kybflow.Run:
    told: list[kybflow.Event] = []
    run = kybflow.run(
        mission, seed=3, set={"height": "60 cm"}, out=mission.parent / "run", on_event=told.append
    )
    assert [event.name for event in told] == [event.name for event in run.events]
    return run


def test_the_names_are_few_and_loading_them_is_lazy() -> None:
    script = "import sys, kybflow; print(*(m in sys.modules for m in ('numpy', 'yaml', 'mcap')))"
    said = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert said.stdout.split() == ["False", "False", "False"]
    assert len(dir(kybflow)) <= FIRST
    assert all(hasattr(kybflow, name) for name in dir(kybflow))
    with pytest.raises(AttributeError, match="no attribute 'fly'"):
        _ = kybflow.fly  # type: ignore[attr-defined]


def test_findings_are_returned_with_the_text_of_the_command_line(tmp_path: Path) -> None:
    path = with_library(tmp_path) / "wrong.yaml"
    path.write_text(MISSION.replace("do: land", "do: lend"))
    found = kybflow.validate(path)
    assert not found.valid
    assert len(found) == 1
    assert f"{path}:11:18 error" in str(found)
    assert "did you mean `land`" in str(found)
    with pytest.raises(kybflow.MissionInvalid) as raised:
        kybflow.run(path)
    assert str(raised.value) == str(found)
    assert [one.code for one in raised.value.findings] == [one.code for one in found]


def test_a_rehearsal_finds_what_validation_cannot(mission: Path) -> None:
    assert kybflow.validate(mission).valid
    assert len(kybflow.rehearse(mission)) == 0
    higher = mission.with_name("higher.yaml")
    higher.write_text(MISSION.replace("finally a in landed", "max(a.state.altitude) > 3 m"))
    assert not kybflow.rehearse(higher).valid


def test_a_run_tells_what_happened(flown: kybflow.Run) -> None:
    assert flown.succeeded
    assert flown.reason == ""
    assert [one["text"] for one in flown.expectations] == ["finally a in landed"]
    assert flown.summary["seed"] == 3
    assert flown.findings.valid
    assert "up, seed 3, succeeded" in repr(flown)
    assert "<td>succeeded</td>" in flown._repr_html_()


def test_signals_are_arrays_with_time_units_and_states(flown: kybflow.Run) -> None:
    a = flown.vehicle("a")
    assert flown.vehicles == ("a",)
    assert a.position.shape == (len(a.time), 3)
    assert a.units["setpoint.velocity"] == "m/s"
    assert np.all(np.diff(a.time) > 0.0)
    assert 0.55 < np.nanmax(a["truth.position"][:, 2]) < 0.65
    peak = np.nanargmax(a.error)
    assert a.state[peak] == "hold"
    assert a.state[-1] == "landed"
    hold = flown.summary["vehicles"]["a"]["behaviors"][1]
    held = a.time[a.state == "hold"]
    assert (held[0], held[-1]) == pytest.approx((hold["start_s"], hold["end_s"]), abs=0.01)
    assert np.nanmax(a.error) == pytest.approx(hold["position_error_m"]["max"], rel=0.02)
    imu = a.sensor("imu")
    assert imu["specific_force"].shape == (len(imu.time), 3)
    assert imu.units["specific_force"] == "m/s^2"


@pytest.mark.parametrize(
    ("ask", "answer"),
    [
        (lambda run: run.vehicle("b"), "`run` has no vehicle `b`"),
        (lambda run: run.vehicle("a")["estimate.positon"], "did you mean `estimate.position`?"),
        (lambda run: run.vehicle("a").sensor("imo"), "did you mean `imu`?"),
    ],
)
def test_what_is_unknown_is_named(flown: kybflow.Run, ask, answer: str) -> None:
    with pytest.raises(kybflow.KybflowError, match="no ") as raised:
        ask(flown)
    assert answer in str(raised.value)


def test_a_killed_run_is_read_as_far_as_it_goes(flown: kybflow.Run, tmp_path: Path) -> None:
    cut = tmp_path / "cut"
    cut.mkdir()
    for name in ("events.jsonl", "log.mcap"):
        content = (flown.folder / name).read_bytes()
        (cut / name).write_bytes(content[: len(content) * 2 // 3])
    killed = kybflow.Run.load(cut)
    assert killed.outcome == "killed"
    assert killed.expectations == []
    assert 10 < len(killed.vehicle("a").time) < len(flown.vehicle("a").time)
    with pytest.raises(RunFolderError, match="is not a readable run"):
        kybflow.Run.load(tmp_path)


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_frames_have_a_row_a_tick_and_units_in_names(flown: kybflow.Run, library) -> None:
    frame, a = flown.frame(library), flown.vehicle("a")
    assert len(frame) == len(a.time)
    assert type(frame).__module__.startswith(library)
    assert [*frame.columns[:4]] == ["time_s", "vehicle", "state", "estimate_present"]
    assert np.asarray(frame["truth_velocity_z_m_s"]) == pytest.approx(a["truth.velocity"][:, 2])


def exported(flown: kybflow.Run, format: str, out: Path) -> None:
    words = ["-m", "kybflow", "export", str(flown.folder), f"--{format}", "--out", str(out)]
    said = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stderr


def test_tables_hold_every_signal(flown: kybflow.Run, tmp_path: Path) -> None:
    import polars

    a = flown.vehicle("a")
    for kind in ("csv", "npz", "parquet"):
        exported(flown, kind, tmp_path / kind)
    with (tmp_path / "csv" / "a.csv").open(newline="") as file:
        rows = [*csv.DictReader(file)]
    packed = np.load(tmp_path / "npz" / "a.npz")
    frame = polars.read_parquet(tmp_path / "parquet" / "a.parquet")
    for name, values in a.columns().items():
        if values.dtype.kind in "fiu":
            assert np.array_equal(packed[name], values, equal_nan=True)
            assert np.array_equal(frame[name].to_numpy(), values, equal_nan=True)
            assert [float(row[name]) for row in rows] == pytest.approx(values, nan_ok=True)
    assert frame["state"].to_list() == packed["state"].tolist() == [row["state"] for row in rows]
    assert {path.stem for path in (tmp_path / "csv").iterdir()} >= {"a", "a.imu", "a.pose"}


def test_a_bag_has_odometry_and_setpoints(flown: kybflow.Run, tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    exported(flown, "rosbag2", tmp_path / "bag")
    a, store = flown.vehicle("a"), get_typestore(Stores.ROS2_HUMBLE)
    with AnyReader([tmp_path / "bag"], default_typestore=store) as reader:
        read = [
            (time, reader.deserialize(data, connection.msgtype))
            for connection, time, data in reader.messages()
            if connection.topic == "/a/odom"
        ]
    (time, odometry), row = read[100], 100 + int(np.isnan(a.position[:, 0]).sum())
    assert time == round(a.time[row] * 1e9)
    at = odometry.pose.pose.position
    assert (at.x, at.y, at.z) == pytest.approx(a.position[row])
    assert odometry.child_frame_id == "a"
    speed = odometry.twist.twist.linear
    assert math.hypot(speed.x, speed.y, speed.z) == pytest.approx(np.linalg.norm(a.velocity[row]))


def test_an_export_never_writes_over_what_is_there(flown: kybflow.Run, tmp_path: Path) -> None:
    words = ["-m", "kybflow", "export", str(flown.folder), "--out", str(tmp_path)]
    said = subprocess.run([sys.executable, *words], capture_output=True, text=True, check=False)
    assert said.returncode == 1
    assert said.stderr == f"error: `{tmp_path}` exists; name a new one by --out\n"


def test_a_definition_that_lacks_a_message_is_refused() -> None:
    with pytest.raises(ValueError, match="doesn't define `Vector`"):
        fields_of("Vector position  # m\n")


def test_connect_reaches_a_run_that_flies(mission: Path) -> None:
    out, threads = mission.parent / "connected", list[threading.Thread]()

    def steer() -> None:
        with kybflow.connect(out, name="me") as client:
            assert client.switch("a", "down").accepted

    def on_event(event: kybflow.Event) -> None:
        if event.name == "took_off":
            threads.append(threading.Thread(target=steer))
            threads[0].start()

    run = kybflow.run(mission, out=out, speed=2.0, on_event=on_event, commands=True)
    threads[0].join()
    given = [event.fields for event in run.events if event.name == "command_given"]
    assert [(one["by"], one["command"]) for one in given if one["accepted"]] == [
        ("me", "switch a down"), ("me", "release"),
    ]  # fmt: skip
    with pytest.raises(kybflow.KybflowError, match="no run that accepts commands flies"):
        kybflow.connect(out)
