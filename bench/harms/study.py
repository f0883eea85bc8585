"""Makes the mutants of the operators and judges them: whether each is told of, and at its line.

A judge is `(path, mutant) -> findings`: `validated` asks the compiler, `rehearsed` flies the
mission on ideal vehicles.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from harms.mission_text import Mission, edited
from harms.operator import Operator
from kybflow.api.rehearsal.rehearse import rehearse
from kybflow.dsl.compiler import check_mission, compile_mission
from kybflow.dsl.diagnostics import Diagnostic
from kybflow.parts.catalog import load_catalog

PLACES = 3
"""Mutants of one operator in one mission at most; which, is drawn by a seed of both names."""


class Mutant(NamedTuple):
    """mission: the file's name. lines: where a report of it is right."""

    operator: Operator
    mission: str
    text: str
    lines: frozenset[int]
    target: str | None


class Finding(NamedTuple):
    """What was told of a mission. lines: of the mission's own file, all that it speaks of."""

    code: str
    message: str
    lines: frozenset[int]


class Verdict(NamedTuple):
    mutant: Mutant
    findings: tuple[Finding, ...]

    @property
    def told(self) -> bool:
        return bool(self.findings)

    @property
    def at_line(self) -> bool:
        return any(finding.lines & self.mutant.lines for finding in self.findings)


Judge = Callable[[Path, Mutant], tuple[Finding, ...]]


def mutants(mission: Mission, operators: Iterable[Operator]) -> Iterator[Mutant]:
    """The mutants of one mission, `PLACES` an operator at most."""
    for operator in operators:
        changes = list(operator.make(mission))
        generator = random.Random(f"{operator.name} {mission.name}")
        for one in generator.sample(changes, min(PLACES, len(changes))):
            text, lines = edited(mission, one.edits, one.also)
            if text != mission.text:
                yield Mutant(operator, f"{mission.name}.yaml", text, lines, one.target)


def validated(path: Path, mutant: Mutant) -> tuple[Finding, ...]:
    """What the compiler says, errors and warnings."""
    result = check_mission(path, catalog=load_catalog(), target=mutant.target)
    return tuple(_finding(diagnostic, str(path)) for diagnostic in result.diagnostics)


def _finding(diagnostic: Diagnostic, file: str) -> Finding:
    span = diagnostic.span
    others = (other.span for other in diagnostic.related)
    spans = [s for s in (span, *span.used, *span.via, span.given, *others) if s is not None]
    lines = {s.line for s in spans if s.file == file}
    for text in (diagnostic.message, diagnostic.label, *diagnostic.notes, diagnostic.help):
        lines |= {int(n) for n in re.findall(rf"(?:\blines? |{re.escape(file)}:)(\d+)", text)}
    return Finding(diagnostic.code, diagnostic.message, frozenset(lines))


def rehearsed(path: Path, mutant: Mutant) -> tuple[Finding, ...]:
    """What the rehearsal of a mission without findings says."""
    compiled = compile_mission(path, catalog=load_catalog(), target=mutant.target)
    assert compiled.plan is not None, "the rehearsal is asked last"
    found = rehearse(compiled.plan, texts=compiled.texts).diagnostics
    return tuple(_finding(diagnostic, str(path)) for diagnostic in found)


JUDGES: tuple[tuple[str, Judge], ...] = (("validate", validated), ("rehearse", rehearsed))
"""Who judges, in order. Each is asked of what nobody before it told."""


Told = tuple[str, Verdict]
"""Who told of a mutant, empty where nobody did, and what."""


def verdicts(
    mission: Mission,
    folder: Path,
    operators: Iterable[Operator],
    judges: tuple[tuple[str, Judge], ...] = JUDGES,
) -> Iterator[Told]:
    """Each mutant of a mission and who told of it, empty where nobody did. `folder` has the
    library."""
    for mutant in mutants(mission, operators):
        path = folder / mutant.mission
        path.write_text(mutant.text, encoding="utf-8")
        for name, judge in judges:
            findings = judge(path, mutant)
            if findings:
                yield name, Verdict(mutant, findings)
                break
        else:
            yield "", Verdict(mutant, ())
