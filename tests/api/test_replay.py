"""A record is flown again: every decision and every byte is the same, from the measurements alone;
an edited mission is the same until its first different decision."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.records import Channel
from mcap.stream_reader import StreamReader
from mcap.writer import Writer
from toolchain import MISSIONS, SHIPPED, compiled, flight_of, with_library
from typer.testing import CliRunner

import kybflow
from kybflow.api.replay.replay import Replayed, replay
from kybflow.cli.app import app
from kybflow.core.signals import NS
from kybflow.recording.messages import TICK, read_recording
from kybflow.recording.run_folder import RunFolderError

MARKS = dict.fromkeys(
    ("courier_hard", "push_cart", "corridor", "mass_pickup", "two_lives", "follow_leader"),
    pytest.mark.thorough,
)
"""One mission of each kind: with cameras, objects, moving obstacles, a payload, inputs, and a fleet
that talks; the others have no other kind of device."""
OUTSIDE = {"sensor_failed", "measurement_refused", "tags_lost", "tags_found", "run_interrupted"}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Fly a mission once; return its folder."""
    folders: dict[tuple[str, str], Path] = {}

    def fly(name: str, target: str = "sim") -> Path:
        if (name, target) not in folders:
            out = tmp_path_factory.mktemp(name) / "run"
            plan = compiled(MISSIONS / f"{name}.yaml", target=target)
            flight_of(plan, out)
            folders[name, target] = out
        return folders[name, target]

    return fly


def is_same(replayed: Replayed) -> bool:
    return replayed.difference is None and replayed.is_whole and replayed.transitions > 0


@pytest.mark.parametrize(
    ("name", "target"),
    [
        ("first_flight", "sim"),
        ("first_flight", "emulated_px4"),
        ("fallback", "sim"),
        pytest.param("joystick", "sim", marks=pytest.mark.thorough),
        pytest.param("first_flight", "emulated_ardupilot", marks=pytest.mark.thorough),
        pytest.param("three_ardrones", "sim", marks=pytest.mark.thorough),
    ],
)
def test_a_replay_writes_the_same_bytes(
    name: str, target: str, tmp_path: Path, flown: Callable[..., Path]
) -> None:
    replayed = replay(flown(name, target), out=tmp_path / "again")

    assert is_same(replayed), replayed
    recorded = flown(name, target) / "log.mcap"
    assert (tmp_path / "again" / "log.mcap").read_bytes() == recorded.read_bytes()


@pytest.mark.parametrize(
    "path",
    [pytest.param(p, id=p.stem, marks=MARKS.get(p.stem, pytest.mark.slow)) for p in SHIPPED],
)
def test_every_shipped_mission_is_decided_as_it_was_flown(
    path: Path, tmp_path: Path, flown: Callable[..., Path]
) -> None:
    replayed = replay(flown(path.stem), out=tmp_path / "again")

    assert is_same(replayed), replayed
    if not any(vehicle.cameras for vehicle in compiled(path).vehicles):
        recorded = flown(path.stem) / "log.mcap"
        assert (tmp_path / "again" / "log.mcap").read_bytes() == recorded.read_bytes()


def blinded(run: Path, out: Path) -> Path:
    """A copy of a run without what it estimated, decided, and did."""
    shutil.copytree(run, out)
    channels: dict[int, tuple[str, int]] = {}
    schemas: dict[int, int] = {}
    with (run / "log.mcap").open("rb") as source, (out / "log.mcap").open("wb") as target:
        writer = Writer(target)
        writer.start()
        for record in StreamReader(source).records:
            match record:
                case Channel():
                    if record.id not in channels:
                        number = writer.register_channel(
                            record.topic, record.message_encoding, schemas[record.schema_id]
                        )
                        channels[record.id] = record.topic, number
                case _ if type(record).__name__ == "Schema":
                    schemas[record.id] = writer.register_schema(
                        record.name, record.encoding, record.data
                    )
                case _ if type(record).__name__ == "Metadata":
                    writer.add_metadata(record.name, record.metadata)
                case _ if type(record).__name__ == "Message":
                    topic, number = channels[record.channel_id]
                    data = kept(topic, record.data)
                    if data is not None:
                        writer.add_message(number, record.log_time, data, record.publish_time)
        writer.finish()
    return out


def kept(topic: str, data: bytes) -> bytes | None:
    last = topic.rpartition("/")[2]
    if last == "tick":
        tick = np.frombuffer(data, TICK).copy()
        for decided in ("estimate", "setpoint", "command"):
            tick[decided] = np.zeros((), TICK[decided])
        return tick.tobytes()
    if topic == "/events" and json.loads(data)["event"] not in OUTSIDE | {"preflight_passed"}:
        return None
    return None if last in ("wanted", "command") or "/estimator/" in topic else data


@pytest.mark.parametrize("target", ["sim", "emulated_px4"])
def test_it_decides_on_measurements_and_answers_alone(
    target: str, tmp_path: Path, flown: Callable[..., Path]
) -> None:
    name = "fallback" if target == "sim" else "first_flight"
    run = flown(name, target)
    copy = blinded(run, tmp_path / "blind")
    assert not read_recording(copy / "log.mcap").ticks("nano").values["estimate"]["present"].any()

    replay(copy, out=tmp_path / "again")  # which differs from the nothing that the copy shows

    assert (tmp_path / "again" / "log.mcap").read_bytes() == (run / "log.mcap").read_bytes()


def edited(name: str, folder: Path, before: str, after: str) -> Path:
    with_library(folder)
    text = (MISSIONS / f"{name}.yaml").read_text(encoding="utf-8")
    assert before in text
    path = folder / "edited.yaml"
    path.write_text(text.replace(before, after), encoding="utf-8")
    return path


def began(run: Path, behavior: str) -> float:
    events = kybflow.Run.load(run).events
    found = (e for e in events if e.name == "behavior_started")
    return next(e.time / NS for e in found if e.fields["behavior"] == behavior)


def first_difference(run: Path, mission: Path) -> tuple[float, str, str]:
    difference = replay(run, mission=mission).difference
    assert difference is not None
    recorded, replayed = (event.name if event else "" for event in difference)
    return difference.time, recorded, replayed


def test_an_edited_health_condition(tmp_path: Path, flown: Callable[..., Path]) -> None:
    run = flown("fallback")
    mission = edited("fallback", tmp_path, "age < 250 ms", "age < 100 ms")
    mocap = kybflow.Run.load(run).vehicle("nano").sensor("estimator/mocap")
    old = mocap.time[np.argmax(mocap["age"] > 0.1)]

    time, _, replayed = first_difference(run, mission)

    assert (time, replayed) == (pytest.approx(old, abs=0.021), "estimator_changed")


def test_an_edited_duration(tmp_path: Path, flown: Callable[..., Path]) -> None:
    run = flown("first_flight")
    mission = edited("first_flight", tmp_path, "for_time: 3 s", "for_time: 2 s")

    time, _, replayed = first_difference(run, mission)

    assert time == pytest.approx(began(run, "hold") + 2.0, abs=0.02)
    assert replayed == "behavior_ended"


@pytest.mark.thorough
def test_an_edited_transition(tmp_path: Path, flown: Callable[..., Path]) -> None:
    run = flown("joystick")
    mission = edited("joystick", tmp_path, "event: stick.give", "event: stick.right_shoulder")

    time, _, replayed = first_difference(run, mission)

    pressed = [e.time / NS for e in kybflow.Run.load(run).events if "shoulder" in e.name]
    assert time == pytest.approx(next(t for t in pressed if t > began(run, "hand")), abs=0.02)
    assert replayed == "behavior_ended"


def test_what_the_edit_leaves_out_is_a_difference_too(
    tmp_path: Path, flown: Callable[..., Path]
) -> None:
    run = flown("first_flight")
    mission = edited("first_flight", tmp_path, "for_time: 3 s", "for_time: 4 s")

    time, recorded, replayed = first_difference(run, mission)

    assert time == pytest.approx(began(run, "hold") + 3.0, abs=0.02)
    assert (recorded, replayed) == ("behavior_ended", "")


@pytest.mark.parametrize(
    ("before", "after", "differs"),
    [
        ("like: std.nano_plus", "like: std.nano_plus\n    tracker: cascade", "command"),
        ("radius: 60 cm", "radius: 62 cm", "setpoint"),
    ],
)
def test_what_flies_otherwise_is_a_difference_without_any_event(
    before: str, after: str, differs: str, tmp_path: Path, flown: Callable[..., Path]
) -> None:
    run = flown("fallback")
    mission = edited("fallback", tmp_path, before, after)

    time, recorded, replayed = first_difference(run, mission)

    assert recorded == replayed == differs
    begins = {"command": 0.0, "setpoint": began(run, "round")}[differs]
    assert begins <= time < begins + 1.0


def test_the_command_line_shows_both_lines_of_the_mission(
    tmp_path: Path, flown: Callable[..., Path]
) -> None:
    run = flown("first_flight")
    mission = edited("first_flight", tmp_path, "for_time: 3 s", "for_time: 2 s")

    result = CliRunner().invoke(app, ["replay", str(run), "--mission", str(mission)])

    assert result.exit_code == 1
    assert "for_time: 3 s" in result.output or "in the run: " in result.output
    assert "for_time: 2 s, then: down}" in result.output
    assert result.output.endswith("The record doesn't show what would have happened then.\n")


def test_a_run_that_was_interrupted_is_interrupted_again(tmp_path: Path) -> None:
    def interrupt(engine) -> None:
        if engine.seconds() > 5.0 and not engine.interrupts:
            engine.interrupts, engine.interrupted_by = 1, "a test"

    flown, events = flight_of(compiled(MISSIONS / "first_flight.yaml"), tmp_path / "run", interrupt)
    assert flown.summary["outcome"] == "interrupted"
    assert "run_interrupted" in [event.name for event in events]

    replayed = replay(tmp_path / "run", out=tmp_path / "again")

    assert is_same(replayed)
    assert replayed.until == pytest.approx(flown.summary["sim_time_s"], abs=0.02)


def test_a_killed_run_is_flown_as_far_as_it_goes(
    tmp_path: Path, flown: Callable[..., Path]
) -> None:
    run = tmp_path / "killed"
    shutil.copytree(flown("first_flight"), run)
    whole = (run / "log.mcap").read_bytes()
    (run / "log.mcap").write_bytes(whole[: len(whole) // 2])
    summary = run / "summary.json"
    summary.unlink()

    replayed = replay(run)
    summary.write_bytes((flown("first_flight") / "summary.json").read_bytes())
    told_whole = replay(run)

    assert replayed.difference is None
    assert not replayed.is_whole
    assert not told_whole.is_whole
    assert 3.0 < replayed.until < 9.0


def test_it_says_what_can_not_be_replayed(tmp_path: Path, flown: Callable[..., Path]) -> None:
    run = flown("first_flight")
    other = edited("first_flight", tmp_path, "nano", "mini")
    other.write_text(other.read_text().replace("std.mini_plus", "std.nano_plus"))
    with pytest.raises(RunFolderError, match="no vehicle `mini`"):
        replay(run, mission=other)
    with pytest.raises(RunFolderError, match="not a readable run"):
        replay(tmp_path)
    damaged = tmp_path / "damaged"
    shutil.copytree(run, damaged)
    data = bytearray((run / "log.mcap").read_bytes())
    data[len(data) // 2] ^= 0xFF
    (damaged / "log.mcap").write_bytes(data)
    with pytest.raises(RunFolderError, match=r"`log.mcap` is damaged"):
        replay(damaged)
    (damaged / "events.jsonl").unlink()
    with pytest.raises(RunFolderError, match=r"no `events.jsonl`"):
        replay(damaged)
