"""One flight of one mission as a test; it runs in a process of its own."""

from __future__ import annotations

import shutil
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from kybflow.api.flight import Flown, RunRequest, fly
from kybflow.api.validation import findings
from kybflow.campaigns.coverage import Arrow, State, Traces, written
from kybflow.core.details import headline
from kybflow.core.errors import KybflowError
from kybflow.dsl.compiler import compile_mission
from kybflow.parts.catalog import load_catalog
from kybflow.recording.outcome import Outcome
from kybflow.recording.run_folder import RunFolderError
from kybflow.report.page import write_report

Verdict = Outcome | Literal["invalid"]


@dataclass(frozen=True, slots=True)
class Case:
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
class Tried:
    """What became of a case. reason: why it did not succeed, a line an item. seconds: wall time.
    written, taken: the mission's states and transitions, and those that this flight took."""

    case: Case
    verdict: Verdict
    reason: tuple[str, ...] = ()
    seconds: float = 0.0
    folder: Path | None = None
    written: tuple[State | Arrow, ...] = ()
    taken: frozenset[State | Arrow] = field(default_factory=frozenset)

    @property
    def passed(self) -> bool:
        return self.verdict == "succeeded"


def try_case(case: Case) -> Tried:
    """Compile and fly a case; never raises for what the mission does, or a disk that is full."""
    began = time.monotonic()
    result = compile_mission(case.path, catalog=load_catalog(), target=case.target, sets=case.sets)
    if result.plan is None:
        return Tried(case, "invalid", tuple(findings(result, case.path)))
    traces = Traces()
    request = RunRequest(seed=case.seed, out=case.out, sets=case.sets)
    try:
        flown = fly(result.plan, request, (traces.hear,))
        verdict: Verdict = flown.summary["outcome"]
        folder = _kept(flown, case.keep or verdict in ("failed", "driver_failed"))
    except RunFolderError as error:
        return Tried(case, "driver_failed", (str(error),))
    except KybflowError as error:
        return Tried(case, "invalid", (str(error),))
    return Tried(
        case,
        verdict,
        _reasons(flown),
        time.monotonic() - began,
        folder,
        tuple(written(result.plan)),
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
