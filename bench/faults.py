"""Random flights with faults, judged by the simulator's truth: what breaks must come down.

    python bench/faults.py FIRST LAST [--jobs 2] [--out faults.jsonl] [--table] [--keep FOLDER]

Each number from FIRST to LAST is one flight (`bench/studies/random_faults.py`): a mission, a
target, a seed and faults. Each line of `--out` is one flight with its findings
(`tests/support/flight_judge.py`); flights that are there already are not flown again. At the end a
table says how many flights of each kind of finding there are, and their numbers; those that nothing
could save are counted apart. `--table` flies nothing. With `--keep` the missions and run folders
stay: `python bench/faults.py 93 93 --keep there` flies one again, and `kybflow report` shows it.
Which flight a number is depends on the generator and the missions, so a number belongs to a commit.
"""

from __future__ import annotations

import argparse
import json
import shutil
import signal
import sys
import tempfile
import traceback
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from time import process_time
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

from flight_judge import KINDS, Judgement, judge  # noqa: E402
from studies.random_faults import draw  # noqa: E402
from toolchain import with_library  # noqa: E402

from kybflow.api.flight import RunRequest, fly  # noqa: E402
from kybflow.core.signals import NS  # noqa: E402

CPU_LIMIT = 900.0
"""Seconds of processor time after which a flight counts as endless."""


class Endless(BaseException):
    """A flight took `CPU_LIMIT`; no part can catch it."""


@contextmanager
def limited() -> Iterator[None]:
    def over(*_: Any) -> None:
        raise Endless

    signal.signal(signal.SIGPROF, over)
    signal.setitimer(signal.ITIMER_PROF, CPU_LIMIT)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def flown(seed: int, keep: Path | None = None) -> dict[str, Any]:
    """Draw, fly and judge one flight: its line of `--out`."""
    began = process_time()
    with tempfile.TemporaryDirectory() as name:
        drawn = draw(seed, with_library(keep or Path(name)))
        out = (keep or Path(name)) / f"run{seed}"
        if out.exists():
            shutil.rmtree(out)
        record: dict[str, Any] = {
            "seed": seed, "mission": drawn.mission, "target": drawn.target,
            "scenario": drawn.scenario, "hover": drawn.hover, "faults": drawn.faults,
            "commands": [f"{c.heard / NS:.2f} s {c.by}: {c.command}" for c in drawn.commands],
        }  # fmt: skip
        told: list[str] = []
        try:
            with limited():
                events = (lambda event: told.append(event.name),)
                request = RunRequest(seed=seed, out=out, again=drawn.commands)
                run = fly(drawn.plan, request, events)
                record |= _outcome(run.summary) | _judged(judge(drawn.plan, out, run.summary))
        except Endless:
            record["findings"] = [["endless", "", 0.0, CPU_LIMIT]]
        except Exception:
            record |= {"findings": [["traceback", "", 0.0, 0.0]], "error": traceback.format_exc()}
        if record["findings"]:
            record["yaml"] = drawn.path.read_text(encoding="utf-8")
        record["injected"] = told.count("fault_injected")
    record["cpu_s"] = round(process_time() - began, 2)
    return record


def _outcome(summary: dict[str, Any]) -> dict[str, Any]:
    names = ("outcome", "reason", "sim_time_s")
    final = {name: vehicle["final"] for name, vehicle in summary["vehicles"].items()}
    return {name: summary[name] for name in names} | {"final": final}


def _judged(judgement: Judgement) -> dict[str, Any]:
    findings = [
        [f.kind, f.vehicle, round(f.time, 3), round(f.value, 3)] for f in judgement.findings
    ]
    lift = None if judgement.lift == float("inf") else round(judgement.lift, 3)
    return {"findings": findings, "lift": lift, "doomed": judgement.doomed}


def read(path: Path) -> dict[int, dict[str, Any]]:
    """The flights of a file, by their numbers; the last line may be half a line."""
    lines = path.read_text(encoding="utf-8").split("\n")[:-1] if path.exists() else []
    return {record["seed"]: record for record in map(json.loads, lines)}


def told(record: dict[str, Any]) -> str:
    """One flight in a line."""
    head = f"{record['seed']:7} {record['mission']}, {record['target']}, {record['scenario']}"
    found = [f"{kind} {vehicle} {value:.2f}" for kind, vehicle, _, value in record["findings"]]
    apart = " (nothing could save it)" if record.get("doomed") else ""
    return f"{head}: {record.get('outcome')}{apart}  {'; '.join(found)}"


def table(records: list[dict[str, Any]]) -> str:
    """The kinds of findings, how many flights have each, and their numbers."""
    sound = [record for record in records if not record.get("doomed")]
    doomed = [record for record in records if record.get("doomed")]
    lied = [r["seed"] for r in doomed if {k for k, *_ in r["findings"]} & {"succeeded", "untrue"}]
    seeds = defaultdict(list)
    for record in sound:
        for kind in dict.fromkeys(finding[0] for finding in record["findings"]):
            seeds[kind].append(record["seed"])
    unsafe = sum(1 for record in sound if record["findings"])
    spent = sum(record["cpu_s"] for record in records) / max(1, len(records))
    lines = [f"{len(records)} flights, {spent:.1f} s of processor time each"]
    lines += [f"{'injected no fault':20}{sum(not r['injected'] for r in records):6}"]
    lines += [f"{'unsafe':20}{unsafe:6}  of {len(sound)} that could be saved"]
    lines += [f"  {k:18}{len(seeds[k]):6}  {' '.join(map(str, seeds[k]))}" for k in KINDS]
    lines += [f"{'beyond saving':20}{len(doomed):6}  {' '.join(str(r['seed']) for r in doomed)}"]
    lines += [f"  {'untrue verdict':18}{len(lied):6}  {' '.join(map(str, lied))}"]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("faults.jsonl"))
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--table", action="store_true", help="print the table of --out only")
    options = parser.parse_args()
    known = {} if options.keep else read(options.out)
    wanted = range(options.first, options.last + 1)
    left = [] if options.table else [seed for seed in wanted if seed not in known]
    # A fresh interpreter every 50 flights, started anew: nothing of a flight is left for the next.
    with get_context("spawn").Pool(options.jobs, maxtasksperchild=50) as pool:
        for record in pool.imap_unordered(partial(flown, keep=options.keep), left):
            if record.get("outcome") == "interrupted":
                continue  # by whoever ends this program: it is flown when that goes on
            known[record["seed"]] = record
            print(told(record), flush=True)
            if not options.keep:
                with options.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(record) + "\n")
    print(table([known[seed] for seed in wanted if seed in known]))


if __name__ == "__main__":
    main()
