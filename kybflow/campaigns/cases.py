"""Missions as test cases, and the flight of a single case."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from kybflow.api.flight import Flown, RunRequest, fly
from kybflow.api.validation import findings
from kybflow.campaigns.coverage import CoverageItem, CoverageListener, coverage_items
from kybflow.core.details import headline
from kybflow.core.errors import KybflowError
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.language.judge import is_library
from kybflow.dsl.reading.reader import RESOLVED, mission_files, read
from kybflow.parts.catalog import load_catalog
from kybflow.recording.outcome import Outcome
from kybflow.recording.run_folder import RunFolderError
from kybflow.report.page import write_report

Verdict = Outcome | Literal["invalid"]


@dataclass(frozen=True, slots=True)
class FlightCase:
    """A mission to fly with a seed. out: its run folder, which is deleted after a success unless
    `keep` is set."""

    path: Path
    seed: int
    out: Path
    target: str | None = None
    sets: tuple[str, ...] = ()
    keep: bool = False

    @property
    def name(self) -> str:
        return f"{self.path}, seed {self.seed}"


@dataclass(frozen=True, slots=True)
class FlightResult:
    """The result of a case.

    reason: lines that say why it did not succeed. seconds: wall time. folder: the run folder, if it
    is kept. items: all states and transitions of the mission. taken: those that this flight took.
    """

    case: FlightCase
    verdict: Verdict
    reason: tuple[str, ...] = ()
    seconds: float = 0.0
    folder: Path | None = None
    items: tuple[CoverageItem, ...] = ()
    taken: frozenset[CoverageItem] = field(default_factory=frozenset)

    @property
    def passed(self) -> bool:
        return self.verdict == "succeeded"


def missions_under(paths: Iterable[Path]) -> Iterator[Path]:
    """Yield `paths`, replacing each folder by the missions in it and its subfolders, without
    libraries and files of runs."""
    for path in paths:
        if not os.path.isdir(path):
            yield path
            continue
        for found in mission_files(path):
            root = read(found, str(found)).root
            if found.name != RESOLVED and (root is None or not is_library(root)):
                yield found


def fly_case(case: FlightCase) -> FlightResult:
    """Compile and fly a case. Errors of the mission or a full disk are results, not exceptions."""
    began = time.monotonic()
    result = compile_mission(case.path, catalog=load_catalog(), target=case.target, sets=case.sets)
    if result.plan is None:
        return FlightResult(case, "invalid", tuple(findings(result, case.path)))
    traces = CoverageListener()
    request = RunRequest(seed=case.seed, out=case.out, sets=case.sets)
    try:
        flown = fly(result.plan, request, (traces.on_event,))
        verdict: Verdict = flown.summary["outcome"]
        folder = None
        if case.keep or verdict in ("failed", "driver_failed"):
            write_report(flown.folder)
            folder = flown.folder
        else:
            shutil.rmtree(flown.folder, ignore_errors=True)
    except RunFolderError as error:
        return FlightResult(case, "driver_failed", (str(error),))
    except KybflowError as error:
        return FlightResult(case, "invalid", (str(error),))
    return FlightResult(
        case,
        verdict,
        _reasons(flown),
        time.monotonic() - began,
        folder,
        tuple(coverage_items(result.plan)),
        frozenset(traces.taken),
    )


def _reasons(flown: Flown) -> tuple[str, ...]:
    """Return why a flight did not succeed, with a line for each expectation that did not hold."""
    summary = flown.summary
    if summary["outcome"] == "succeeded":
        return ()
    broken = [
        f"{e['at']}: `{e['text']}` did not hold" for e in summary["expectations"] if not e["held"]
    ]
    return (headline(str(summary["reason"])), *broken)
