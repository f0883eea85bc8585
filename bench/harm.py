"""What is told before take-off of missions that do harm or make no sense, and of sensible ones.

    python bench/harm.py [--half development] [--show] [--fly 0] [--only NAME ...]
                         [--missions NAME ...]

The operators are in bench/harms/families; each is used on every shipped mission that has a
place for it. `told` counts errors and warnings, `at line` those that name a line which the change
explains, of all that are told. Half of the operators, by a hash of their names, are held out: of
them only figures are shown, so that no check is made for one of them. `--show` gives an example of
what is missed, most dangerous first. `--fly N` flies N of the accepted dangerous ones of that half
and says how they end, by the simulator's truth.
"""

from __future__ import annotations

import argparse
import collections
import random
import sys
import tempfile
from pathlib import Path
from time import process_time

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

from flight_judge import judge  # noqa: E402
from harms.families import OPERATORS, VALID  # noqa: E402
from harms.mission_text import Mission  # noqa: E402
from harms.operator import Operator  # noqa: E402
from harms.study import JUDGES, Told, Verdict, verdicts  # noqa: E402
from toolchain import SHIPPED, with_library  # noqa: E402

from kybflow.api.flight import RunRequest, fly  # noqa: E402
from kybflow.core.errors import KybflowError  # noqa: E402
from kybflow.dsl.compiler import compile_mission  # noqa: E402
from kybflow.parts.catalog import load_catalog  # noqa: E402

GOALS = {"dangerous": (95.0, 99.0), "senseless": (85.0, 90.0)}
LINE_GOAL = 95.0


def judged(missions: list[Mission], operators: tuple[Operator, ...], folder: Path) -> list[Told]:
    return [one for mission in missions for one in verdicts(mission, folder, operators)]


def totals(told: list[Told], half: str) -> None:
    own = [(by, v) for by, v in told if half in ("both", v.mutant.operator.half)]
    for label, goals in GOALS.items():
        of = [(by, v) for by, v in own if v.mutant.operator.label == label]
        row, found = f"{half:12}{label:10}{len(of):6}", 0
        for (judge_name, _), goal in zip(JUDGES, goals, strict=False):
            found += sum(by == judge_name for by, _ in of)
            row += f"{share(found, len(of)):>9} (goal {goal:g})"
        right = sum(v.at_line for _, v in of)
        print(f"{row}{share(right, found):>9} (goal {LINE_GOAL:g}) at line")


def share(some: int, of: int) -> str:
    return f"{100.0 * some / of:.1f} %" if of else "-"


def table(told: list[Told]) -> None:
    """A row an operator of the development half; misses first, the dangerous before the rest."""
    groups: dict[Operator, list[Verdict]] = collections.defaultdict(list)
    for _, verdict in told:
        if verdict.mutant.operator.half == "development":
            groups[verdict.mutant.operator].append(verdict)
    rows = sorted(groups.items(), key=lambda r: (r[0].label, -sum(not v.told for v in r[1])))
    print(f"\n{'development half':42}{'label':11}{'all':>4}{'told':>6}{'at line':>9}")
    for operator, own in rows:
        found, right = sum(v.told for v in own), sum(v.at_line for v in own)
        print(f"{operator.name:42}{operator.label:11}{len(own):4}{found:6}{right:9}")


def examples(told: list[Told]) -> None:
    """One mutant that is missed, of each operator of the development half, and one that is told at
    another line."""
    seen: set[tuple[Operator, bool]] = set()
    for _, verdict in sorted(told, key=lambda t: t[1].mutant.operator.label):
        operator, mutant = verdict.mutant.operator, verdict.mutant
        if operator.half != "development" or verdict.at_line or (operator, verdict.told) in seen:
            continue
        seen.add((operator, verdict.told))
        print(f"\n{operator.label}: {operator.name}: {operator.why}")
        lines = mutant.text.split("\n")
        print(f"  {mutant.mission}:")
        print(
            "\n".join(f"  {n:4}  {lines[n - 1]}" for n in sorted(mutant.lines) if n <= len(lines))
        )
        for finding in verdict.findings[:2]:
            print(f"  told: {finding.code} at {sorted(finding.lines)}: {finding.message}")


def unmade(told: list[Told], operators: tuple[Operator, ...]) -> None:
    made = {verdict.mutant.operator for _, verdict in told}
    for operator in operators:
        if operator not in made:
            print(f"no mission has a place for {operator.name}")


def false_alarms(missions: list[Mission], valid: tuple[Operator, ...], folder: Path) -> None:
    told = judged(missions, valid, folder)
    wrong = [(by, v) for by, v in told if by]
    print(
        f"{len(told)} valid variants by {len(valid)} operators: {len(wrong)} false alarms   goal 0"
    )
    for _, verdict in wrong[:20]:
        mutant = verdict.mutant
        print(f"  {mutant.operator.name} of {mutant.mission}: {verdict.findings[0].message}")


def flown(told: list[Told], count: int, folder: Path, half: str) -> None:
    """Fly accepted dangerous mutants; those of the half that is held out are counted only."""
    accepted = [v.mutant for by, v in told if not by and v.mutant.operator.label == "dangerous"]
    accepted = [m for m in accepted if m.target is None and half in ("both", m.operator.half)]
    first = {m.operator: m for m in random.Random(0).sample(accepted, len(accepted))}
    ends: collections.Counter[str] = collections.Counter()
    for index, mutant in enumerate(list(first.values())[:count]):
        path = folder / mutant.mission
        path.write_text(mutant.text, encoding="utf-8")
        end = _end(path, folder / f"run{index}")
        is_held_out = mutant.operator.half == "held-out"
        name, shown = ("(held out)", end.split()[0]) if is_held_out else (mutant.operator.name, end)
        ends[f"{name:42}{shown}"] += 1
    print(f"\n{ends.total()} accepted dangerous mutants flown:")
    for end, times in sorted(ends.items()):
        print(f"  {times:3}  {end}")


def _end(path: Path, out: Path) -> str:
    plan = compile_mission(path, catalog=load_catalog()).plan
    if plan is None:
        return "is refused"
    try:
        flight = fly(plan, RunRequest(seed=0, out=out))
    except KybflowError as error:
        return f"can't be flown: {error}"[:90]
    findings = judge(plan, flight.folder, flight.summary).findings
    kinds = " ".join(sorted({finding.kind for finding in findings}))
    return f"{flight.summary['outcome']} {kinds} {flight.summary['reason'] or ''}"[:110].strip()


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--half", choices=("development", "held-out", "both"), default="both")
    parser.add_argument("--show", action="store_true")
    parser.add_argument("--fly", type=int, default=0)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--missions", nargs="*", default=[])
    options = parser.parse_args()
    operators, valid = (
        tuple(op for op in every if not options.only or op.name in options.only)
        for every in (OPERATORS, VALID)
    )
    began = process_time()
    with tempfile.TemporaryDirectory() as name:
        folder = with_library(Path(name))
        chosen = [p for p in SHIPPED if not options.missions or p.stem in options.missions]
        missions = [Mission(path) for path in chosen]
        told = judged(missions, operators, folder)
        print(
            f"{len(told)} mutants by {len(operators)} operators of {len(missions)} missions", end=""
        )
        print(f", {process_time() - began:.0f} s of CPU time")
        for half in ("development", "held-out", "both"):
            if options.half in ("both", half):
                totals(told, half)
        false_alarms(missions, valid, folder)
        if options.half != "held-out":
            table(told)
        if options.show:
            examples(told)
        unmade(told, operators)
        if options.fly:
            flown(told, options.fly, folder, options.half)


if __name__ == "__main__":
    main()
