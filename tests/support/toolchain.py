"""Compiles and flies missions, written in a test or shipped, and runs the command line."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from typer.testing import CliRunner, Result

from kybflow.api.flight import Flown, RunRequest, fly
from kybflow.cli.app import app
from kybflow.core.signals import Event
from kybflow.dsl import compiler
from kybflow.dsl.plan import Plan
from kybflow.parts.catalog import Catalog, load_catalog

ROOT = Path(__file__).parents[2]
MISSIONS = ROOT / "missions"
SHIPPED = sorted(MISSIONS.glob("*.yaml"))


def with_library(folder: Path) -> Path:
    """`folder`, with what the missions import and the files that they name."""
    for name in ("library", "operators", "scans", "trajectories"):
        shutil.copytree(MISSIONS / name, folder / name, dirs_exist_ok=True)
    return folder


def result_of(
    mission: Path,
    text: str | None = None,
    *,
    catalog: Catalog | None = None,
    target: str | None = None,
    sets: Sequence[str] = (),
) -> compiler.Result:
    """What the compiler says of the mission; `text` is written to its file first."""
    if text is not None:
        mission.write_text(text, encoding="utf-8")
    catalog = catalog or load_catalog()
    return compiler.compile_mission(mission, catalog=catalog, target=target, sets=sets)


def compiled(mission: Path, text: str | None = None, *, warns: bool = False, **choice: Any) -> Plan:
    """The plan of a mission without findings; of one that `warns`, without errors."""
    result = result_of(mission, text, **choice)
    findings = [f"{d.code} {d.message}" for d in result.diagnostics]
    assert warns or findings == []
    assert result.plan is not None, findings
    return result.plan


def flight_of(
    plan: Plan, out: Path, *observers: Callable[[Any], None], **request: Any
) -> tuple[Flown, list[Event]]:
    """The flight and its events."""
    events: list[Event] = []
    return fly(plan, RunRequest(out=out, **request), (events.append,), observers), events


def succeeds(
    plan: Plan, out: Path, *observers: Callable[[Any], None], **request: Any
) -> tuple[Flown, list[Event]]:
    """The flight, which meets every expectation of its mission, and its events."""
    flown, told = flight_of(plan, out, *observers, **request)
    assert [e for e in flown.summary["expectations"] if not e["held"]] == []
    assert flown.summary["outcome"] == "succeeded", flown.summary
    return flown, told


def program(
    *words: object,
    cwd: Path | None = None,
    path: Sequence[Path] = (),
    module: str = "kybflow",
    **environment: str,
) -> subprocess.CompletedProcess[str]:
    """A module's run as a program of its own; `path` has the folders that it imports from first."""
    places = [*map(str, path), os.environ.get("PYTHONPATH", "")]
    return subprocess.run(
        [sys.executable, "-m", module, *map(str, words)],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, places)), **environment},
        capture_output=True,
        text=True,
        check=False,
    )  # fmt: skip


def invoke(*words: object) -> Result:
    """What `kybflow` with these arguments did."""
    return CliRunner().invoke(app, [str(word) for word in words])


def printed(*words: object) -> tuple[int, str]:
    """The exit code and the output of a command that raises nothing."""
    result = invoke(*words)
    assert not isinstance(result.exception, Exception)
    return result.exit_code, result.output
