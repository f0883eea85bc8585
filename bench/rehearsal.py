"""What a rehearsal costs beside the flight that it rehearses, and how well it tells its time.

    python bench/rehearsal.py [MISSION ...]

Each mission is flown in the simulator without its faults and rehearsed, in one process and in turns
with nothing else; the figures are mission time and CPU time, and their ratios beside the goals.
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
import time
from pathlib import Path
from typing import Any

from kybflow.api.flight import RunRequest, fly
from kybflow.api.rehearsal.rehearse import rehearse
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan
from kybflow.parts.catalog import load_catalog

ROOT = Path(__file__).parent.parent
OFF, COST, SECONDS = 3.0, 10.0, 1.0
"""Goals: the mission time differs by so many percent at most, CPU time is so many percent of the
flight's at most, and so many seconds."""
WARM_UP = ROOT / "missions" / "first_flight.yaml"
"""Flown first, so that neither pays for imports and compiled steps."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("missions", nargs="*", type=Path, help="those in missions/ by default")
    chosen = parser.parse_args().missions or sorted((ROOT / "missions").glob("*.yaml"))
    measured(WARM_UP)
    print(f"{'mission':16} {'flown':>8} {'rehearsed':>10} {'off':>8} {'CPU':>9} {'of flight':>10}")
    rows = [measured(path) for path in chosen]
    for path, (flown, rehearsed, cpu, cost, count) in zip(chosen, rows, strict=True):
        off = 100.0 * (rehearsed / flown - 1.0)
        found = f"  {count} findings" if count else ""
        print(
            f"{path.stem:16} {flown:6.2f} s {rehearsed:8.2f} s {off:+6.2f} % {cpu:7.3f} s"
            f" {100.0 * cpu / cost:8.1f} %{found}"
        )
    worst = max(abs(100.0 * (r / f - 1.0)) for f, r, *_ in rows)
    dearest = max(100.0 * cpu / cost for _, _, cpu, cost, _ in rows)
    longest = max(cpu for _, _, cpu, _, _ in rows)
    print(f"\ntime off by {worst:.1f} % at most (goal {OFF:g} %)")
    print(f"CPU {dearest:.1f} % of the flight's at most (goal {COST:g} %)")
    print(f"CPU {longest:.2f} s at most (goal {SECONDS:g} s)")


def measured(path: Path) -> tuple[float, float, float, float, int]:
    """Mission time flown and rehearsed, CPU time of the rehearsal and of the flight, findings."""
    result = compile_mission(path, catalog=load_catalog())
    assert result.plan is not None, path
    plan = dataclasses.replace(result.plan, faults=(), expectations=())
    begin = time.process_time()
    rehearsal = rehearse(plan, texts=result.texts)
    cpu = time.process_time() - begin
    begin = time.process_time()
    summary = flown(plan)
    cost = time.process_time() - begin
    count = len(rehearsal.diagnostics)
    return summary["sim_time_s"], rehearsal.duration, cpu, cost, count


def flown(plan: Plan) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as place:
        return fly(plan, RunRequest(out=Path(place) / "run")).summary


if __name__ == "__main__":
    main()
