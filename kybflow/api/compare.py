"""Compares runs: what was flown, with what, how well, and the first events that differ."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest
from operator import attrgetter
from pathlib import PurePath
from typing import Any, NamedTuple

import yaml

from kybflow.api.runs import Run, readable
from kybflow.core.files import read_all
from kybflow.core.signals import NS, Event
from kybflow.core.units import format_measured
from kybflow.dsl.reading.reader import RESOLVED
from kybflow.recording.run_folder import RunFolderError


class ComparedRow(NamedTuple):
    """One fact of each run. values: as shown; None where a run doesn't have it."""

    section: str
    name: str
    values: tuple[str | None, ...]

    @property
    def differs(self) -> bool:
        return len(set(self.values)) > 1


def compare(runs: Sequence[Run]) -> list[ComparedRow]:
    """Return the facts of the runs: `run`, `code`, `parameter` (only those that differ), `error`
    and `expectation`; and of each run the first event that differs from the first run's
    (`events`)."""
    rows: list[ComparedRow] = []
    for section, facts in (
        ("run", _run), ("code", _code), ("parameter", _parameters), ("error", _errors),
        ("expectation", _expectations),
    ):  # fmt: skip
        rows += _rows(section, runs, facts)
    rows = [row for row in rows if row.section != "parameter" or row.differs]
    first = [None, *(_first_difference(runs[0], run) for run in runs[1:])]
    return [*rows, ComparedRow("events", "first difference", tuple(first))]


def _rows(
    section: str, runs: Sequence[Run], facts: Callable[[Run], Iterator[tuple[str, str]]]
) -> Iterator[ComparedRow]:
    each = []
    for run in runs:
        try:
            with readable(run.folder):
                each.append(dict(facts(run)))
        except yaml.YAMLError as error:
            raise RunFolderError(f"`{run.folder / RESOLVED}` is damaged: {error}") from error
    for name in dict.fromkeys(name for found in each for name in found):
        yield ComparedRow(section, name, tuple(found.get(name) for found in each))


def _run(run: Run) -> Iterator[tuple[str, str]]:
    for key in ("mission", "target", "seed", "world"):
        if key in run.summary:
            yield key, str(run.summary[key])
    yield "outcome", run.outcome
    yield "reason", run.reason
    if run.summary:
        yield "time", f"{run.summary['sim_time_s']:.1f} s"


def _code(run: Run) -> Iterator[tuple[str, str]]:
    provenance = run.provenance
    yield from ((name, str(value)) for name, value in provenance.get("versions", {}).items())
    for file in (*provenance.get("sources", ()), *provenance.get("parts", ())):
        yield PurePath(file["path"]).name, file["sha256"][:12]


def _parameters(run: Run) -> Iterator[tuple[str, str]]:
    """Yield every value of the mission after imports, parameters and defaults, by its place."""
    provenance = run.provenance
    for key in ("set", "option", "emit"):
        yield f"--{key}", ", ".join(provenance.get(key, ()))
    yield from _flat("", yaml.safe_load(read_all(run.folder / RESOLVED)))


def _flat(name: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(f"{name}.{key}" if name else str(key), inner)
    elif isinstance(value, list) and any(isinstance(one, dict) for one in value):
        used = [one.get("use") if isinstance(one, dict) else None for one in value]
        for index, (use, inner) in enumerate(zip(used, value, strict=True)):
            label = use if use and used.count(use) == 1 else str(index)
            yield from _flat(f"{name}.{label}", inner)
    else:
        yield name, str(value)


def _errors(run: Run) -> Iterator[tuple[str, str]]:
    for name, vehicle in run.summary.get("vehicles", {}).items():
        times = Counter[str]()
        for visit in vehicle["behaviors"]:
            error, state = visit["position_error_m"], visit["name"]
            if error:
                times[state] += 1
                which = f" ({times[state]})" if times[state] > 1 else ""
                shown = (format_measured(error[key], "m") for key in ("mean", "max"))
                yield f"{name}.{state}{which} mean, max", ", ".join(shown)


def _expectations(run: Run) -> Iterator[tuple[str, str]]:
    for one in run.expectations:
        verdict, unit = "held" if one["held"] else "FAILED", one["unit"]
        named = (("", one["value"], ""), ("margin ", one["margin"], "+"))
        known = [
            word + format_measured(of, unit, sign) for word, of, sign in named if of is not None
        ]
        yield one["text"], f"{verdict} ({', '.join(known)})" if known else verdict


def _first_difference(first: Run, other: Run) -> str | None:
    """Return the first event that one of the runs has and the other has not; None if all are the
    same."""

    for ours, theirs in zip_longest(first.events, other.events):
        if ours is None or theirs is None or fact(ours) != fact(theirs):
            return _shown(min(filter(None, (theirs, ours)), key=attrgetter("time")))
    return None


def fact(event: Event, without: str = "") -> tuple[Any, ...]:
    """Return what happened, to compare events; without one of the fields."""
    fields = {name: value for name, value in event.fields.items() if name != without}
    return event.time, event.name, event.vehicle, json.dumps(fields, sort_keys=True)


def _shown(event: Event) -> str:
    of = f" {event.vehicle}" if event.vehicle else ""
    behavior = event.fields.get("behavior")
    return f"{event.time / NS:.2f} s:{of} {event.name}{f' {behavior}' if behavior else ''}"
