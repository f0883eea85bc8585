"""What the checks find in broken missions: every node of every mission deleted, duplicated,
swapped, renamed, given another unit, linked elsewhere.

    python bench/mutants.py [--random 2000] [--jobs 2] [--fly 0] [--show 0]

First every mutant by one change of one node (`studies/mission_mutants.py`): of those that break a
name, a unit, a link or the uniqueness of a key by the way in which they are made, and of those that
end in the air or elsewhere than the mission when nothing but time passes, how many are refused, at
a line that the change explains. One that ends elsewhere, inside the fence and clear of everything,
is a mission of its own, which nothing can refuse; it counts all the same. Then missions changed at
random in several places, or with noise in their text: none may give a traceback. `--fly` flies so
many of the accepted mutants and says how they end.
"""

from __future__ import annotations

import argparse
import collections
import os
import random
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from time import perf_counter

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

from studies.mission_mutants import KINDS  # noqa: E402
from studies.mutation_study import AIR, BROKEN, MOVED, Judged, judged, tracebacks  # noqa: E402
from toolchain import SHIPPED, with_library  # noqa: E402

from kybflow.dsl.compiler import compile_mission  # noqa: E402
from kybflow.parts.catalog import load_catalog  # noqa: E402

GOAL = 95.0


def study(folder: Path, show: int) -> list[Judged]:
    began = perf_counter()
    found = [one for path in SHIPPED for one in judged(path, folder)]
    print(f"{len(found)} mutants of {len(SHIPPED)} missions, {perf_counter() - began:.0f} s")
    print(f"{'':10}{'all':>7}{'refused':>9} |{'broken':>8}{'refused':>9}{'at line':>9}", end=" |")
    print(f"{'in the air':>12}{'elsewhere':>11}")
    for kind in (*KINDS, ""):
        _row(kind or "all", [one for one in found if kind in ("", one.kind)])
    known = ("", BROKEN, AIR, MOVED)
    print(f"tracebacks: {sum(one.why not in known for one in found)}   goal 0")
    wrong = [one for one in found if one.why]
    right = [one for one in wrong if one.is_found]
    share = 100.0 * len(right) / len(wrong)
    print(f"refused at the right line: {len(right)} of {len(wrong)}, {share:.1f} %   goal {GOAL} %")
    for one in [one for one in wrong if not one.is_found][:show]:
        print(f"  {one.mission}: {one.what}: {one.why}")
    return found


def _row(name: str, own: list[Judged]) -> None:
    broken = [one for one in own if one.why == BROKEN]
    refused = [one for one in broken if one.refused]
    why = collections.Counter(one.why for one in own)
    print(
        f"{name:10}{len(own):7}{sum(o.refused for o in own):9} |{len(broken):8}{len(refused):9}"
        f"{sum(o.at_the_line for o in refused):9} |{why[AIR]:12}{why[MOVED]:11}"
    )


def unmutated() -> None:
    results = [compile_mission(path, catalog=load_catalog()) for path in SHIPPED]
    count = sum(len(result.diagnostics) for result in results)
    print(f"{count} reports on {len(SHIPPED)} missions as they are   goal 0")


def hammer(count: int, jobs: int) -> None:
    began = perf_counter()
    chunks = [(seed, min(500, count - seed)) for seed in range(0, count, 500)]
    with ProcessPoolExecutor(jobs) as pool:
        raised = [text for part in pool.map(tracebacks, chunks) for text in part]
    spent = perf_counter() - began
    print(f"{count} random mutants, {spent:.0f} s: {len(raised)} tracebacks   goal 0")
    for text in raised[:3]:
        print(text)


def flown(found: list[Judged], count: int, folder: Path) -> None:
    """Fly accepted mutants; each must end on the ground, whatever it then misses."""
    from kybflow.campaigns.cases import FlightCase, fly_case

    accepted = [one for one in found if not one.refused and one.why in ("", MOVED)]
    chosen = random.Random(0).sample(accepted, min(count, len(accepted)))
    ends: collections.Counter[str] = collections.Counter()
    for index, one in enumerate(chosen):
        path = folder / one.mission
        path.write_text(one.text, encoding="utf-8")
        tried = fly_case(FlightCase(path, 0, folder / f"run{index}"))
        reason = tried.reason[0] if tried.reason else ""
        ends[f"{tried.verdict} {reason[:60]}".strip()] += 1
    print(f"{len(chosen)} accepted mutants flown:")
    for end, times in ends.most_common():
        print(f"  {times:4}  {end}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--random", type=int, default=2000)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--fly", type=int, default=0)
    parser.add_argument("--show", type=int, default=0)
    options = parser.parse_args()
    unmutated()
    with tempfile.TemporaryDirectory() as name:
        folder = with_library(Path(name))
        found = study(folder, options.show)
        if options.fly:
            flown(found, options.fly, folder)
    if options.random:
        hammer(options.random, options.jobs)


if __name__ == "__main__":
    main()
