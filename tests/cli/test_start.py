"""What a command imports before it does its work, and what is told before the report is written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from toolchain import MISSIONS

from kybflow.cli.app import app
from kybflow.core.errors import KybflowError
from kybflow.report import page

FIRST, EIGHT = str(MISSIONS / "first_flight.yaml"), str(MISSIONS / "figure_eight.yaml")
NEVER = {
    "asyncio", "glfw", "jinja2", "jsonschema", "plotly", "pydantic", "rich", "scipy",
    "urllib.request",
}  # fmt: skip
FLIES = {"foxglove", "mujoco", "numpy", "transitions"}
IMPORTED = """
import sys
from kybflow.cli.app import main
try: main()
except SystemExit: pass
print(*sys.modules)
"""
UNTIL_THE_FIRST_TICK = """
import os, sys
sys.modules["numba"] = None  # as in a plain install: it brings SciPy and more of its own
from kybflow.runtime.engine import Engine
def tick(engine):
    print(*sys.modules, flush=True)
    os._exit(0)
Engine.tick = tick
"""
"""Before IMPORTED: ends the process instead of the first tick."""


def imported(code: str, *words: str) -> set[str]:
    done = subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, check=True
    )
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.thorough
@pytest.mark.parametrize("words", [["--help"], ["run", "--help"], ["validate", EIGHT]])
def test_what_flies_nothing_loads_nothing_that_flies(words: list[str]) -> None:
    modules = imported(IMPORTED, *words)
    assert modules & (NEVER | FLIES) == set()
    assert "kybflow.cli.app" in modules


@pytest.mark.thorough
def test_no_mission_here_needs_more_than_numpy_to_be_validated() -> None:
    modules = imported(IMPORTED, "validate", str(MISSIONS))
    assert modules & (NEVER | FLIES) == {"numpy"}


def test_a_command_does_not_load_the_others() -> None:
    modules = imported(IMPORTED, "validate", EIGHT)
    assert {m for m in modules if m.startswith("kybflow.cli.commands.")} == {
        "kybflow.cli.commands.validate"
    }


@pytest.mark.thorough
def test_a_run_has_loaded_at_its_first_tick_what_flies_and_no_more(tmp_path: Path) -> None:
    modules = imported(UNTIL_THE_FIRST_TICK + IMPORTED, "run", EIGHT, "--out", str(tmp_path / "r"))
    assert modules & NEVER == set()
    assert modules >= FLIES


def fly(out: Path) -> int:
    """The exit code of a flight whose text goes to the process's own streams."""
    with pytest.raises(SystemExit) as end:
        app(["run", FIRST, "--out", str(out)])
    return int(str(end.value.code))


def test_the_verdict_is_on_the_screen_before_the_report_is_begun(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def begun(folder: Path) -> Path:
        os.write(1, b"begun\n")
        return folder / "report.html"

    monkeypatch.setattr(page, "write_report", begun)
    assert fly(tmp_path) == 0
    verdict, _, mark, report = capfd.readouterr().out.splitlines()[-4:]
    assert verdict == "first_flight succeeded"
    assert (mark, report) == ("begun", f"report: {tmp_path / 'report.html'}")


def test_an_interrupt_while_the_report_is_written_loses_the_report_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def interrupted(path: Path, data: bytes) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(page, "write_file", interrupted)
    assert fly(tmp_path) == 130
    told = capfd.readouterr()
    assert "first_flight succeeded\n" in told.out
    assert told.err == f"interrupted: the run is in {tmp_path}, without a report\n"
    files = {path.name for path in tmp_path.iterdir()}
    assert files >= {"log.mcap", "events.jsonl", "summary.json", "provenance.json"}
    assert "report.html" not in files


def test_a_report_that_fails_is_told_after_the_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def failing(folder: Path) -> Path:
        raise KybflowError("no page today")

    monkeypatch.setattr(page, "write_report", failing)
    assert fly(tmp_path) == 1
    told = capfd.readouterr()
    assert "first_flight succeeded\n" in told.out
    assert told.err == "error: no page today\n"
