"""Missions as test cases: the flight of a single case, its result, the coverage of several flights,
and the results as JUnit XML.

Coverage is about the states and transitions of a mission. Transitions from one state with equal
cause, target and mission line count as one, because the events of a run don't distinguish them.
Implied transitions and built-in states don't count.
"""

from __future__ import annotations

import os
import re
import shutil
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

from kybflow.api.flight import RunRequest, fly
from kybflow.api.validation import findings
from kybflow.core.errors import KybflowError
from kybflow.core.signals import Event
from kybflow.core.text import headline
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.language.judge import is_library
from kybflow.dsl.plan import Plan
from kybflow.dsl.reading.reader import RESOLVED, mission_files, read
from kybflow.parts.catalog import load_catalog
from kybflow.recording.outcome import Outcome
from kybflow.recording.run_folder import RunFolderError
from kybflow.report.page import write_report

Verdict = Outcome | Literal["invalid"]


@dataclass(frozen=True, slots=True)
class FlightCase:
    """A mission to fly with a seed. out: its run folder, which is deleted after a success unless
    `keep` is set. parts: Python files that define a part each."""

    path: Path
    seed: int
    out: Path
    target: str | None = None
    sets: tuple[str, ...] = ()
    keep: bool = False
    parts: tuple[Path, ...] = ()

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
    catalog = load_catalog(*case.parts)
    result = compile_mission(case.path, catalog=catalog, target=case.target, sets=case.sets)
    if result.plan is None:
        return FlightResult(case, "invalid", tuple(findings(result, case.path)))
    traces = CoverageListener()
    request = RunRequest(seed=case.seed, out=case.out, sets=case.sets)
    try:
        flown = fly(result.plan, request, (traces.on_event,))
        verdict: Verdict = flown.summary["outcome"]
        missed = flown.summary["never_injected"] if verdict == "succeeded" else []
        verdict = "failed" if missed else verdict
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
    reasons = [f"{one['at']}: the fault `{one['fault']}` never happened" for one in missed]
    if flown.summary["outcome"] != "succeeded":
        broken = [e for e in flown.summary["expectations"] if not e["held"]]
        reasons = [headline(str(flown.summary["reason"]))]
        reasons += [f"{e['at']}: `{e['text']}` did not hold" for e in broken]
    seconds, items = time.monotonic() - began, tuple(coverage_items(result.plan))
    taken = frozenset(traces.taken)
    return FlightResult(case, verdict, tuple(reasons), seconds, folder, items, taken)


_CAUSES = {"done": "then", "refused": "failed"}
"""The cause of the transition for each `how` of an ended behavior, where the two differ."""


class StateItem(NamedTuple):
    """A state of a vehicle. at: its mission line."""

    vehicle: str
    name: str
    at: str = ""

    def __str__(self) -> str:
        return f"{self.vehicle}: {self.name}"


class TransitionItem(NamedTuple):
    """A transition of a vehicle. at: its mission line."""

    vehicle: str
    source: str
    cause: str
    target: str
    at: str

    def __str__(self) -> str:
        return f"{self.vehicle}: {self.source} -> {self.target} ({self.cause})"


CoverageItem = StateItem | TransitionItem


class CoverageListener:
    """Collects the states and transitions of a run from its events."""

    def __init__(self) -> None:
        self.taken: set[CoverageItem] = set()
        self._left: dict[str, tuple[str, str, str]] = {}

    def on_event(self, event: Event) -> None:
        name, vehicle = str(event.fields.get("behavior")), event.vehicle
        if event.name == "behavior_ended":
            how = str(event.fields["how"])
            self._left[vehicle] = (name, _CAUSES.get(how, how), event.at)
        elif event.name == "behavior_started":
            self.taken.add(StateItem(vehicle, name))
            left = self._left.pop(vehicle, None)
            if left is not None:
                source, cause, at = left
                self.taken.add(TransitionItem(vehicle, source, cause, name, at))


def coverage_items(plan: Plan) -> list[CoverageItem]:
    """Return every state and transition that the mission declares, in order."""
    found: list[CoverageItem] = []
    for vehicle in plan.vehicles:
        for state in vehicle.states.values():
            if state.built_in:
                continue
            found.append(StateItem(vehicle.name, state.name, state.at))
            found += [
                TransitionItem(vehicle.name, state.name, t.cause, t.target, t.at)
                for t in state.transitions
                if not t.implied
            ]
    return list(dict.fromkeys(found))


class Coverage(NamedTuple):
    """The states and transitions of a mission that its runs `missed`, out of a `total`."""

    total: int
    missed: tuple[CoverageItem, ...]

    @property
    def share(self) -> float:
        return 1.0 - len(self.missed) / self.total if self.total else 1.0


def covered(items: Iterable[CoverageItem], taken: Iterable[CoverageItem]) -> Coverage:
    """Return how many of the `items` are `taken`. States in `taken` have no mission line."""
    everything, known = tuple(items), set(taken)
    missed = tuple(
        one
        for one in everything
        if (one._replace(at="") if isinstance(one, StateItem) else one) not in known
    )
    return Coverage(len(everything), missed)


_FORBIDDEN = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd]")
"""The characters that XML 1.0 forbids, and those outside the basic plane, which some readers drop.
"""


def write_junit(path: Path, results: Sequence[FlightResult]) -> None:
    """Write a suite for each mission with a case for each seed. Raises OSError."""
    root = Element("testsuites", name="kybflow test")
    by_mission: dict[Path, list[FlightResult]] = {}
    for one in results:
        by_mission.setdefault(one.case.path, []).append(one)
    for mission, cases in by_mission.items():
        suite = SubElement(
            root,
            "testsuite",
            name=_plain(str(mission)),
            tests=str(len(cases)),
            failures=str(sum(_is_failure(one) for one in cases)),
            errors=str(sum(not one.passed and not _is_failure(one) for one in cases)),
            time=f"{sum(one.seconds for one in cases):.3f}",
        )
        for one in cases:
            case = SubElement(
                suite,
                "testcase",
                classname=_plain(str(mission)),
                name=f"seed {one.case.seed}",
                time=f"{one.seconds:.3f}",
            )
            if not one.passed:
                tag = "failure" if _is_failure(one) else "error"
                first = _plain(one.reason[0]) if one.reason else one.verdict
                fault = SubElement(case, tag, message=first.splitlines()[0], type=one.verdict)
                fault.text = _plain("\n".join(one.reason))
    indent(root)
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _is_failure(result: FlightResult) -> bool:
    """Return whether the mission failed. An invalid mission or a failed driver counts as an error
    instead."""
    return result.verdict == "failed"


def _plain(text: str) -> str:
    return _FORBIDDEN.sub("?", text)
