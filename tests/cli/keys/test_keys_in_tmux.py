"""A person at a real shell in a real terminal (tmux): they let a mission go, pause it, stop the
program with Ctrl-Z, land; and have the shell back afterwards as it was."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from waiting import until
from waiting_mission import MISSION

pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(shutil.which("tmux") is None, reason="tmux is not installed"),
]

WITH_A_PILOT = """
import sys
from pathlib import Path

from plans import part, plan, state, vehicle
from dry_runs import opening
from short_flights import down, hold, up

from kybflow.api.flight import RunRequest
from kybflow.cli.commands.run import fly_plan
from kybflow.dsl.plan import TransitionPlan

autopilot, mode = sys.argv[1:]
driver, opened = opening(autopilot)
go = TransitionPlan(target="up", event="operator.go")
idle = state("idle", part("behaviors", "wait_on_ground"), go)
states = [idle, up("hold"), hold(1000.0, "down"), down()]
flier = vehicle("a", states, driver=driver, tracker=part("trackers", "on_board"))
def taken(session):
    inner = session.advance
    def advance(now):
        wanted = Path("take")
        if wanted.exists():
            wanted.unlink()
            session.links["a"].onboard.give_to_pilot(mode)
        inner(now)
    session.advance = advance
    return session

opened_by = driver.cls.open.__func__
driver.cls.open = classmethod(lambda cls, seats, chance: taken(opened_by(cls, seats, chance)))
sys.exit(fly_plan(plan(flier), RunRequest(out=Path("run"), speed=2.0), report=False))
"""
PILOTS_MODE = {"px4": "POSCTL", "ardupilot": "LOITER"}


class Screen:
    """A shell in a terminal of 80 columns."""

    def __init__(self, folder: Path) -> None:
        self._tmux = ["tmux", "-S", str(folder / "tmux"), "-f", "/dev/null"]
        size = ["-x", "80", "-y", "24"]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        subprocess.run(
            [*self._tmux, "new-session", "-d", *size, "bash --norc"],
            check=True,
            cwd=folder,
            env=environment,
        )

    def tell(self, *words: str) -> str:
        words = (*self._tmux, *words)
        return subprocess.run(words, check=True, capture_output=True, text=True).stdout

    def press(self, *keys: str) -> None:
        self.tell("send-keys", *keys)

    def run(self, line: str) -> None:
        self.tell("send-keys", "-l", line)
        self.press("Enter")

    def text(self) -> str:
        return self.tell("capture-pane", "-p", "-J")

    def shows(self, pattern: str) -> None:
        until(lambda: re.search(pattern, self.text()), pattern)

    def terminal(self) -> str:
        """The name of the terminal, as `pkill -t` takes it."""
        return self.tell("display", "-p", "#{pane_tty}").strip().removeprefix("/dev/")

    def close(self) -> None:
        self.tell("kill-server")


@pytest.fixture
def shell(tmp_path: Path) -> Iterator[Screen]:
    shell = Screen(tmp_path)
    shell.run("stty -g > before")
    yield shell
    shell.close()


@pytest.fixture
def screen(shell: Screen, tmp_path: Path) -> Screen:
    """A run that waits for a person."""
    (tmp_path / "mission.yaml").write_text(MISSION, encoding="utf-8")
    screen = shell
    flags = "--speed 4 --no-report --no-commands --out run"
    screen.run(f"{sys.executable} -m kybflow run mission.yaml {flags}")
    screen.shows(r"1  operator\.go")
    return screen


def has_its_shell_back(screen: Screen, word: str) -> None:
    """Look whether the terminal is as it was, and say so with `word`."""
    screen.run(f"stty -g | diff - before && echo {word}")
    screen.shows(rf"(?m)^{word} *$")


def test_a_mission_is_let_go_paused_and_landed_by_keys(screen: Screen) -> None:
    screen.press("1")
    screen.shows(r"emit operator\.go\? Enter gives it")
    screen.press("Enter")
    screen.shows(r"emit operator\.go: accepted")
    screen.shows(r"nano +│ hold")
    screen.press("p")
    screen.shows(r"r  resume")
    screen.press("C-z")
    screen.shows(r"Stopped")
    has_its_shell_back(screen, "meanwhile")
    screen.run("fg")
    screen.shows(r"r  resume")
    screen.tell("set-buffer", "lllland")
    screen.tell("paste-buffer", "-p")
    screen.press("r", "Enter")
    screen.shows(r"resume: accepted")
    assert "auto_land" not in screen.text()
    screen.press("l")
    screen.shows(r"waiting succeeded")
    has_its_shell_back(screen, "afterwards")


@pytest.mark.parametrize("number", ["TERM", "KILL"])
def test_the_shell_is_back_after_the_run_was_killed(number: str, screen: Screen) -> None:
    subprocess.run(["pkill", f"-{number}", "-t", screen.terminal(), "python"], check=True)
    screen.shows("interrupted" if number == "TERM" else "Killed")
    has_its_shell_back(screen, "afterwards")


@pytest.mark.parametrize("autopilot", PILOTS_MODE)
def test_a_vehicle_is_asked_back_from_a_pilot_by_key(
    autopilot: str, shell: Screen, tmp_path: Path
) -> None:
    pytest.importorskip("pymavlink", reason="pymavlink is not installed")
    (tmp_path / "fly.py").write_text(WITH_A_PILOT, encoding="utf-8")
    shell.run(f"{sys.executable} fly.py {autopilot} {PILOTS_MODE[autopilot]}")
    shell.shows(r"1  operator\.go")
    shell.press("1", "Enter")
    shell.shows(r"a +│ hold")
    (tmp_path / "take").touch()
    shell.shows(r"a +│ hold, by pilot")
    shell.press("r", "Enter")
    shell.shows(r"resume: accepted")
    shell.shows(r"a +│ hold +│")
    shell.press("l")
    shell.shows(r"test succeeded")
    has_its_shell_back(shell, "afterwards")
