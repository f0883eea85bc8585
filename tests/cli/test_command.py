"""`kybflow command` to a run that `kybflow run` started, from other processes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from toolchain import invoke
from waiting import until
from waiting_mission import MISSION

from kybflow.cli.commands.command import described
from kybflow.command_server.client import CommandRefused, connect

SPEED = "8"


def told(*words: str) -> tuple[int, str, str]:
    """The exit code of `kybflow command`, its output and what it says of errors."""
    done = invoke("command", *words)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return 2, "", str(done.exception)
    return done.exit_code, done.stdout, done.stderr


@pytest.fixture
def flying(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[subprocess.Popen[str]]:
    """A run in the folder `run` that waits for a person."""
    monkeypatch.chdir(tmp_path)
    Path("mission.yaml").write_text(MISSION, encoding="utf-8")
    words = ["run", "mission.yaml", "--speed", SPEED, "--plain", "--no-report", "--out", "run-a"]
    program = [sys.executable, "-m", "kybflow", *words]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as run:
        try:
            until(lambda: Path("run-a/control.json").exists() or run.poll() is not None, "the run")
            yield run
        finally:
            run.kill()


def situation() -> dict[str, Any]:
    with connect("run-a") as watcher:
        return watcher.state()


def state() -> dict[str, Any]:
    [vehicle] = situation()["vehicles"]
    return vehicle


def is_in(name: str) -> None:
    """Wait until the preflight is over and the vehicle in this state."""
    until(lambda: situation()["flying"] and state()["state"] == name, name)


@pytest.mark.thorough
def test_a_person_commands_a_run(flying: subprocess.Popen[str]) -> None:
    is_in("idle")
    with connect("run-a", "watcher") as client:
        watcher = client.watch()
    assert told("run", "emit", "operator.go") == (0, "accepted\n", "")
    is_in("hold")
    with connect("run-a", "ben") as ben:
        with pytest.raises(CommandRefused, match=r"in session \d+` commands this run; take"):
            ben.switch("nano", "down")
        assert ben.pause().accepted
        until(lambda: state()["holders"] == ["pause"], "the pause")
        shown = told("run-a", "state")[1]
        assert "nano   hold (hover) for" in shown
        assert "held by pause" in shown
        assert ben.resume(take=True).accepted
        code, _, error = told("run-a", "switch", "nano", "down")
        assert (code, error.partition(";")[0]) == (1, "refused: `ben` commands this run")
    assert json.loads(told("run-a", "state", "--json")[1])["mission"] == "waiting"
    assert told("run-a", "stop", "enough", "for", "today") == (0, "accepted\n", "")
    heard = [one["event"] for one in watcher]
    assert (heard[0], heard[-1]) == ("operator.go", "run_ended")
    assert flying.wait() == 0
    assert json.loads(Path("run-a/summary.json").read_text())["outcome"] == "succeeded"
    assert not Path("run-a/control.json").exists()
    code, _, error = told("run-a", "land")
    assert (code, error) == (2, "no run that accepts commands flies in `run-a`")


@pytest.mark.thorough
def test_a_killed_run_is_told_and_its_socket_removed(flying: subprocess.Popen[str]) -> None:
    is_in("idle")
    address = Path(json.loads(Path("run-a/control.json").read_text())["socket"])
    os.kill(flying.pid, signal.SIGKILL)
    flying.wait()
    assert address.exists()
    assert "was killed" in told("run-a", "land")[2]
    stopped = ("--emit", "operator.stop@1s")
    done = invoke("run", "mission.yaml", "--no-report", *stopped, "--out", "run-b")
    assert done.exit_code == 0
    assert not address.exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["swich", "mk", "hold"], "there is no command `mk`"),
        (["switch", "mk"], "`switch` is written `switch VEHICLE STATE"),
        (["eight"], "`eight` is not a command, or is a run without a command"),
        (["eight", "state", "now"], "there is no command `state`"),
        ([], "Missing argument"),
    ],
)
def test_a_command_that_can_not_be_read_is_told_before_a_run_is_looked_for(
    words: list[str], said: str
) -> None:
    code, _, error = told(*words)
    assert code == 2
    assert said in error


def test_a_vehicle_in_trouble_says_so() -> None:
    vehicle = {
        "name": "mk", "state": "hold", "behavior": "hover", "flight": "air", "elapsed": 2.0,
        "holders": ["brake"], "braking": "geofence", "latched": "land", "override": "a pilot",
        "retired": "a person landed it", "driver": "swarm", "battery": 0.5, "estimate": None,
        "setpoint": None, "waits_for": ["operator.go"],
        "enter": {"up": "no", "down": None, "away": "no"},
        "pause": None, "resume": "it isn't held", "reset": "it is in the air", "land": None,
    }  # fmt: skip
    flow = {
        "name": "swarm", "phase": None, "elapsed": 0.0, "vehicles": ["mk"], "waits_for": [],
        "enter": {"gather": None},
    }  # fmt: skip
    situation = {
        "mission": "eight", "time": 3.0, "flying": True, "holder": "anna", "vehicles": [vehicle],
        "flows": [flow], "emit": {"operator.go": True, "operator.on": False},
    }  # fmt: skip
    assert list(described(situation)) == [
        "eight   3.0 s, commanded by anna",
        "mk   hold (hover) for 2.0 s, air, battery 50%",
        "  held by brake",
        "  braking: geofence",
        "  failsafe until a reset: land",
        "  under other control: a pilot",
        "  landing for the rest of the run: a person landed it",
        "  driven by the flow swarm",
        "  may enter down",
        "  not `up`, `away`: no",
        "  waits for operator.go",
        "  legal: pause, land",
        "  not `resume`: it isn't held",
        "  not `reset`: it is in the air",
        "swarm   in no phase, drives mk",
        "  may enter phase gather",
        "events to emit: operator.go, operator.on (nothing waits for it now)",
    ]
