"""Signals to a real `kybflow run`, in every phase of a mission: it lands, it leaves a whole record,
and its exit code says what happened. Killed outright, it leaves all but the last second.

The signals come from inside: the mission calls an action of a lab's own package that sends one to
its own process. So each comes in the tick that the test names, however busy the machine is.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from mcap.exceptions import EndOfFile
from mcap.records import Footer, Message
from mcap.stream_reader import StreamReader
from toolchain import MISSIONS, ROOT

from kybflow.core.signals import NS
from kybflow.runtime.engine import TWICE
from kybflow.runtime.interrupts import SENT_BY

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
on:
"""
SEND = """'''Send a signal to this process.'''
import os, time

from kybflow.parts import Action, param, params
from kybflow.runtime.interrupts import DEBOUNCE_S

@params
class SendParams:
    signal: int = param("Its number.")
    again: bool = param("Whether it shall count as another than the last.", default=False)

class Send(Action[SendParams]):
    '''Sends it when it is called.'''

    def __call__(self, event, context):
        if self.params.again:
            time.sleep(DEBOUNCE_S)
        os.kill(os.getpid(), self.params.signal)
"""
PHASES = {"up": 1.5, "hold": 4.0, "go": 7.5, "down": 11.3}
"""A time in the middle of each phase, seconds of the run."""
LATER = 1.8
"""When the second interrupt is sent, seconds of the run after the first."""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment of a Python that has the action `send` installed."""
    site = tmp_path_factory.mktemp("site")
    files = {
        "lab/__init__.py": "",
        "lab/actions/__init__.py": "",
        "lab/actions/send.py": SEND,
        "lab-1.dist-info/METADATA": "Metadata-Version: 2.1\nName: lab\nVersion: 1\n",
        "lab-1.dist-info/entry_points.txt": "[kybflow.parts]\nlab = lab\n",
    }
    for name, text in files.items():
        path = site / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    paths = [str(site), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


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


@pytest.fixture
def signalled(tmp_path: Path, installed: dict[str, str]) -> Callable[..., Left]:
    def signalled(*sent: tuple[float, int]) -> Left:
        """Fly, with signals at times of the run."""
        mission, out = tmp_path / "mission.yaml", tmp_path / "run"
        command = [sys.executable, "-m", "kybflow", "run", str(mission), "--no-report"]
        command += ["--plain", "--out", str(out)]
        text = MISSION
        for k, (t, number) in enumerate(sent):
            send = f"{{send: {{signal: {int(number)}, again: {str(k > 0).lower()}}}}}"
            text += f"  - {{event: operator.mark{k}, do: [{send}]}}\n"
            command += ["--emit", f"operator.mark{k}@{t}s"]
        mission.write_text(text, encoding="utf-8")
        done = subprocess.run(command, env=installed, stdout=subprocess.PIPE, check=False)
        summary = out / "summary.json"
        lines = (out / "events.jsonl").read_text(encoding="utf-8").splitlines()
        return Left(
            done.returncode,
            json.loads(summary.read_text(encoding="utf-8")) if summary.exists() else {},
            [json.loads(line) for line in lines],
            *last_recorded(out / "log.mcap"),
        )

    return signalled


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


def phases(quick: str) -> list[Any]:
    """Every phase: one quick, the landing thorough, the others slow."""
    thorough = "down" if quick != "down" else "go"
    return [
        pytest.param(
            p,
            marks=() if p == quick else pytest.mark.thorough if p == thorough else pytest.mark.slow,
        )
        for p in PHASES
    ]


LANDS = {
    signal.SIGINT: PHASES,
    signal.SIGTERM: ("up", "go"),
    signal.SIGHUP: ("hold", "down"),  # a closed terminal
    signal.SIGQUIT: ("down", "hold"),
}


def signal_tier(number: int, phase: str) -> tuple[pytest.MarkDecorator, ...]:
    """SIGINT in one phase is quick; it in the others and each other signal in one are thorough."""
    if (number, phase) == (signal.SIGINT, "go"):
        return ()
    is_first = phase == next(iter(LANDS[number]))
    return (pytest.mark.thorough if number == signal.SIGINT or is_first else pytest.mark.slow,)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("number", "phase"),
    [pytest.param(n, p, marks=signal_tier(n, p)) for n, phases in LANDS.items() for p in phases],
)
def test_a_signal_lands(signalled, number: int, phase: str):
    left = signalled((PHASES[phase], number))
    assert left.code == 130
    assert left.summary["outcome"] == "interrupted"
    assert left.summary["vehicles"]["nano"]["final"] == "ground"
    assert left.path[-3:] == [phase, "auto_land", "fault"]
    [started] = [e for e in left.events if e["event"] == "failsafe_started"]
    assert started["fields"]["reaction"] == "land"
    assert started["fields"]["reason"] == f"by {SENT_BY[number]}; {TWICE}"
    assert left.summary["reason"] == f"by {SENT_BY[number]}"
    assert left.is_whole
    assert left.summary["recording"] is None
    assert left.recorded == pytest.approx(left.summary["sim_time_s"], abs=0.1)


@pytest.mark.thorough
def test_signals_without_a_meaning_change_nothing(signalled):
    left = signalled((PHASES["up"], signal.SIGUSR1), (PHASES["hold"], signal.SIGUSR2))
    assert (left.code, left.summary["outcome"]) == (0, "succeeded")
    assert left.path == [*PHASES, "landed"]
    assert left.is_whole


@pytest.mark.thorough
@pytest.mark.parametrize("phase", phases(quick="hold"))
def test_a_second_ctrl_c_cuts_the_stream(signalled, phase: str):
    first = PHASES[phase]
    left = signalled((first, signal.SIGINT), (first + LATER, signal.SIGINT))
    assert left.code == 130
    assert left.summary["reason"] == "twice, then by Ctrl-C: commands were stopped"
    assert left.path[-2:] == [phase, "auto_land"]
    assert left.is_whole
    assert left.recorded == pytest.approx(left.summary["sim_time_s"], abs=0.1)


@pytest.mark.thorough
@pytest.mark.parametrize("phase", phases(quick="up"))
def test_killed_it_leaves_all_but_the_last_second(
    signalled, phase: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    mark = PHASES[phase]
    left = signalled((mark, signal.SIGKILL))
    assert left.code == -signal.SIGKILL
    assert left.path[-1] == phase
    assert not left.is_whole
    assert left.recorded >= mark - 1.0
    assert read_as_documented(tmp_path / "run", monkeypatch) >= mark - 1.0


def read_as_documented(folder: Path, monkeypatch: pytest.MonkeyPatch) -> float:
    """The newest time that the code in `docs/run-folder.md` finds, seconds."""
    page = (ROOT / "docs" / "run-folder.md").read_text(encoding="utf-8")
    code = page.partition("```python\n")[2].partition("```")[0]
    found: dict[str, Any] = {}
    monkeypatch.chdir(folder)
    exec(code, found)
    return max(time for time, _, _ in found["messages"]) / NS


INTERRUPTED_AT = """
import os, signal, sys

# what a class body of a library may do: __set_name__ turns whatever it raises into RuntimeError
class Named:
    def __set_name__(self, owner, name):
        os.kill(os.getpid(), number)

module, number = sys.argv.pop(1), int(sys.argv.pop(1))
if signal.getsignal(number) is signal.SIG_IGN:  # tests that run under nohup
    signal.signal(number, signal.default_int_handler)

class Sends:
    def find_spec(self, name, *_):
        if name == module == "kybflow.report.page":
            os.kill(os.getpid(), number)
        elif name == module:
            class Owner:
                field = Named()

sys.meta_path.insert(0, Sends())
from kybflow.__main__ import main
main()
"""
"""A command that is sent a signal when it imports a module."""


@pytest.mark.parametrize(
    ("module", "number"),
    [
        ("typer", signal.SIGINT),
        ("kybflow.dsl.compiler", signal.SIGTERM),
        pytest.param("kybflow.report.page", signal.SIGHUP, marks=pytest.mark.thorough),
        pytest.param("kybflow.cli.app", signal.SIGINT, marks=pytest.mark.slow),
        pytest.param("kybflow.dsl.compiler", signal.SIGINT, marks=pytest.mark.slow),
        pytest.param("mujoco", signal.SIGINT, marks=pytest.mark.thorough),
        pytest.param("kybflow.report.page", signal.SIGTERM, marks=pytest.mark.slow),
    ],
)
def test_an_interrupt_while_a_command_loads_is_no_traceback(
    tmp_path: Path, module: str, number: int
):
    mission = str(MISSIONS / "first_flight.yaml")
    words = ["run", mission, "--plain", "--out", str(tmp_path)]
    command = [sys.executable, "-c", INTERRUPTED_AT, module, str(int(number)), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert "Traceback" not in done.stderr
    if module == "kybflow.report.page":
        assert not (tmp_path / "report.html").exists()
        assert json.loads((tmp_path / "summary.json").read_text())["outcome"] == "succeeded"
        assert done.stderr == f"interrupted: the run is in {tmp_path}, without a report\n"
