"""The mutation study: what the checks say of every mutant of a mission, and whether anything gives
a traceback. `bench/mutants.py` prints it, `dsl/test_mutants.py` holds it."""

from __future__ import annotations

import random
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from plan_endings import End, ending
from toolchain import SHIPPED, with_library

from kybflow.core.geometry import distance
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.diagnostics import Severity, render, to_json
from kybflow.parts.catalog import load_catalog
from studies.mission_mutants import Mutant, at_random, mutants

BROKEN, AIR, MOVED = "broken", "ends in the air", "ends elsewhere"


class Judged(NamedTuple):
    """One mutant after the checks. why: what is wrong with it, empty where nothing is known; a
    traceback has the error's own words."""

    mission: str
    kind: str
    what: str
    why: str
    refused: bool
    at_the_line: bool
    text: str

    @property
    def is_found(self) -> bool:
        """Whether it is refused, at a line that the change explains."""
        return self.refused and self.at_the_line


def judged(path: Path, folder: Path, every: int = 1) -> Iterator[Judged]:
    """Each mutant of one mission, or each so-manieth; they are written to `folder`, which has the
    library."""
    mission = folder / path.name
    text = path.read_text(encoding="utf-8")
    mission.write_text(text, encoding="utf-8")
    plan = compile_mission(mission, catalog=load_catalog()).plan
    ends = {} if plan is None or plan.flows else ending(plan)
    for mutant in mutants(text, every):
        mission.write_text(mutant.text, encoding="utf-8")
        yield _judge(mutant, mission, ends)


def _judge(mutant: Mutant, mission: Path, ends: dict[str, End]) -> Judged:
    head = (mission.name, mutant.kind, mutant.what)
    try:
        result = compile_mission(mission, catalog=load_catalog())
    except Exception as error:
        return Judged(*head, repr(error), False, False, mutant.text)
    errors = [d for d in result.diagnostics if d.severity is Severity.ERROR]
    spans = [s for d in errors for s in (d.span, *d.span.used, *d.span.via)]
    near = any(s.file == str(mission) and s.line in mutant.lines for s in spans)
    why = BROKEN if mutant.breaks else ""
    if not why and result.plan is not None:
        why = _moved(ends, ending(result.plan))
    return Judged(*head, why, bool(errors), near, mutant.text)


def _moved(whole: dict[str, End], now: dict[str, End]) -> str:
    """What of the ends is another: whether a vehicle is on the ground, or where."""
    for vehicle in whole.keys() & now.keys():
        a, b = whole[vehicle], now[vehicle]
        if a.grounded and not b.grounded:
            return AIR
        if a.position and b.position and distance(a.position, b.position) > 1e-3:
            return MOVED
    return ""


def tracebacks(job: tuple[int, int]) -> list[str]:
    """The tracebacks of so many missions that are changed at random, by seed and count."""
    seed, count = job
    generator = random.Random(seed)
    texts = [path.read_text(encoding="utf-8") for path in SHIPPED]
    raised = []
    with tempfile.TemporaryDirectory() as name:
        mission = with_library(Path(name)) / "mission.yaml"
        for _ in range(count):
            text = at_random(generator.choice(texts), generator)
            mission.write_text(text, encoding="utf-8", errors="surrogatepass", newline="")
            try:
                result = compile_mission(mission, catalog=load_catalog())
                for diagnostic in result.diagnostics:
                    render(diagnostic, result.texts), to_json(diagnostic)
            except Exception as error:
                raised.append(f"{error!r}\n{text}")
    return raised
