"""Missions as test cases, and the flight of one, which runs in a process of its own."""

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
from kybflow.dsl.reading.folders import RESOLVED, mission_files
from kybflow.dsl.reading.reader import read
from kybflow.parts.catalog import load_catalog
from kybflow.recording.outcome import Outcome
from kybflow.recording.run_folder import RunFolderError
from kybflow.report.page import write_report

Verdict = Outcome | Literal["invalid"]


@dataclass(frozen=True, slots=True)
class FlightCase:
    """A mission to fly with a seed. out: its run folder, kept when it doesn't succeed, or always
    with `keep`."""

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
    """What became of a case. reason: why it did not succeed, a line an item. seconds: wall time.
    items, taken: the mission's states and transitions, and those that this flight took."""

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
    """Each of `paths`; a folder stands for the missions in it and below, without its libraries and
    what runs have left."""
    for path in paths:
        if os.path.isdir(path):
            yield from (p for p in mission_files(path) if p.name != RESOLVED and not _is_library(p))
        else:
            yield path


def _is_library(path: Path) -> bool:
    root = read(path, str(path)).root
    return root is not None and is_library(root)


def fly_case(case: FlightCase) -> FlightResult:
    """Compile and fly a case; never raises for what the mission does, or a disk that is full."""
    began = time.monotonic()
    result = compile_mission(case.path, catalog=load_catalog(), target=case.target, sets=case.sets)
    if result.plan is None:
        return FlightResult(case, "invalid", tuple(findings(result, case.path)))
    traces = CoverageListener()
    request = RunRequest(seed=case.seed, out=case.out, sets=case.sets)
    try:
        flown = fly(result.plan, request, (traces.hear,))
        verdict: Verdict = flown.summary["outcome"]
        folder = _kept(flown, case.keep or verdict in ("failed", "driver_failed"))
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
    """Why a flight did not succeed, with the line of each expectation that was broken."""
    summary = flown.summary
    if summary["outcome"] == "succeeded":
        return ()
    broken = [
        f"{e['at']}: `{e['text']}` did not hold" for e in summary["expectations"] if not e["held"]
    ]
    return (headline(str(summary["reason"])), *broken)


def _kept(flown: Flown, keep: bool) -> Path | None:
    if keep:
        write_report(flown.folder)
        return flown.folder
    shutil.rmtree(flown.folder, ignore_errors=True)
    return None
