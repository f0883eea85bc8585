"""Signals to a real `kybflow run`, in every phase of a mission: it lands, it leaves a whole record,
and its exit code says what happened. Killed outright, it leaves all but the last second.

The run is told to give marks, `operator.resume` with nothing to resume; the test reads them from
its output, and so needs no clock of its own.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any, NamedTuple

import pytest
from mcap.exceptions import EndOfFile
from mcap.records import Footer, Message
from mcap.stream_reader import StreamReader

from kybflow.core.signals import NS

MISSION = """
kybflow: 1
mission: signalled
import: {std: kybflow/airframes}
vehicles:
  nano:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 60 cm, then: hold}
      hold: {do: hover, for_time: 3 s, then: go}
      go:   {do: fly_to, position: [1.5, 0, 0.6], then: down}
      down: {do: land}
"""
PHASES = {"up": 1.5, "hold": 4.0, "go": 7.5, "down": 11.3}
"""A time in the middle of each phase, seconds of the run."""
MARK = "operator.resume"
LATER = 1.8
"""When the second interrupt is sent, seconds of the run after the first."""


class Left(NamedTuple):
    """What a run left behind."""

    code: int
    summary: dict[str, Any]
    events: list[dict[str, Any]]
    recorded: float
    is_whole: bool

    @property
    def path(self) -> list[str]:
        return [e["fields"]["behavior"] for e in self.events if e["event"] == "behavior_started"]


def signalled(
    folder: Path, marks: Sequence[float], numbers: Sequence[int], speed: float = 4.0
) -> Left:
    """Fly at a pace, and send one of `numbers` at each mark."""
    mission, out = folder / "mission.yaml", folder / "run"
    mission.write_text(MISSION, encoding="utf-8")
    emitted = [word for t in marks for word in ("--emit", f"{MARK}@{t}s")]
    command = [sys.executable, "-m", "kybflow", "run", str(mission), "--no-report"]
    command += ["--speed", str(speed), "--plain", "--out", str(out), *emitted]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        for number in numbers:
            if read_until(child.stdout, MARK):
                os.kill(child.pid, number)
        child.stdout.read()
    summary = out / "summary.json"
    lines = (out / "events.jsonl").read_text(encoding="utf-8").splitlines()
    return Left(
        child.returncode,
        json.loads(summary.read_text(encoding="utf-8")) if summary.exists() else {},
        [json.loads(line) for line in lines],
        *last_recorded(out / "log.mcap"),
    )


def read_until(stream: IO[str], word: str) -> bool:
    """Whether a line with `word` came before the end."""
    return any(word in line for line in stream)


def last_recorded(log: Path) -> tuple[float, bool]:
    """(seconds of the newest message that can be read, whether the file has its end)."""
    newest, ended = 0, False
    with log.open("rb") as file:
        try:
            for record in StreamReader(file, validate_crcs=True).records:
                if isinstance(record, Message):
                    newest = record.log_time
                ended = isinstance(record, Footer)
        except EndOfFile:
            ended = False
    return newest / NS, ended


def phases(fast: str) -> list[Any]:
    """Every phase, all but one of them slow."""
    return [pytest.param(p, marks=[pytest.mark.slow] if p != fast else []) for p in PHASES]


def lands(left: Left, phase: str) -> None:
    assert left.code == 130
    assert left.summary["outcome"] == "interrupted"
    assert left.summary["vehicles"]["nano"]["final"] == "ground"
    assert left.path[-3:] == [phase, "auto_land", "fault"]
    [started] = [e for e in left.events if e["event"] == "failsafe_started"]
    assert (started["fields"]["reaction"], started["fields"]["reason"]) == ("land", "interrupted")
    assert left.is_whole
    assert left.summary["recording"] is None
    assert left.recorded == pytest.approx(left.summary["sim_time_s"], abs=0.1)


@pytest.mark.parametrize("phase", phases(fast="up"))
def test_sigterm_lands(tmp_path: Path, phase: str):
    lands(signalled(tmp_path, [PHASES[phase]], [signal.SIGTERM]), phase)


@pytest.mark.parametrize("phase", phases(fast="up"))
def test_a_closed_terminal_lands(tmp_path: Path, phase: str):
    lands(signalled(tmp_path, [PHASES[phase]], [signal.SIGHUP]), phase)


@pytest.mark.parametrize("phase", phases(fast="up"))
def test_ctrl_c_lands(tmp_path: Path, phase: str):
    lands(signalled(tmp_path, [PHASES[phase]], [signal.SIGINT]), phase)


@pytest.mark.parametrize("phase", phases(fast="up"))
def test_ctrl_backslash_lands(tmp_path: Path, phase: str):
    lands(signalled(tmp_path, [PHASES[phase]], [signal.SIGQUIT]), phase)


def test_signals_without_a_meaning_change_nothing(tmp_path: Path):
    left = signalled(tmp_path, [PHASES["up"], PHASES["hold"]], [signal.SIGUSR1, signal.SIGUSR2])
    assert (left.code, left.summary["outcome"]) == (0, "succeeded")
    assert left.path == [*PHASES, "landed"]
    assert left.is_whole


@pytest.mark.parametrize("phase", phases(fast="hold"))
def test_a_second_ctrl_c_cuts_the_stream(tmp_path: Path, phase: str):
    first = PHASES[phase]
    marks = [first, first + LATER]
    left = signalled(tmp_path, marks, [signal.SIGINT] * len(marks), speed=1.0)
    assert left.code == 130
    assert left.summary["reason"] == "interrupted twice: the stream was cut"
    assert left.path[-2:] == [phase, "auto_land"]
    assert left.is_whole
    assert left.recorded == pytest.approx(left.summary["sim_time_s"], abs=0.1)


@pytest.mark.parametrize("phase", phases(fast="up"))
def test_killed_it_leaves_all_but_the_last_second(
    tmp_path: Path, phase: str, monkeypatch: pytest.MonkeyPatch
):
    mark = PHASES[phase]
    left = signalled(tmp_path, [mark], [signal.SIGKILL])
    assert left.code == -signal.SIGKILL
    assert left.path[-1] == phase
    assert not left.is_whole
    assert left.recorded >= mark - 1.0
    assert read_as_documented(tmp_path / "run", monkeypatch) >= mark - 1.0


def read_as_documented(folder: Path, monkeypatch: pytest.MonkeyPatch) -> float:
    """The newest time that the code in `docs/run-folder.md` finds, seconds."""
    page = (Path(__file__).parents[2] / "docs" / "run-folder.md").read_text(encoding="utf-8")
    code = page.partition("```python\n")[2].partition("```")[0]
    found: dict[str, Any] = {}
    monkeypatch.chdir(folder)
    exec(code, found)
    return max(time for time, _, _ in found["messages"]) / NS
