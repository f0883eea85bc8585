"""How fast `kybflow validate` is, as whole processes beside check-jsonschema on the same file.

    python bench/validate.py [--rounds 9] [--missions 200]

The two take turns, so that whatever else the machine does slows both. check-jsonschema judges the
shape only; kybflow compiles the whole mission. Then many missions in one call, against one mission
in one call: the difference over their number is the cost of a mission after the start.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

ROOT = Path(__file__).parent.parent
MISSION = ROOT / "missions" / "figure_eight.yaml"
SCHEMA = ROOT / "schemas" / "mission.schema.json"
BIN = Path(sys.executable).parent
GOAL, GOAL_MS = 0.8, 5.0
CACHING = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
"""Both keep their bytecode, as installed programs do."""


def seconds_of(command: list[str]) -> float:
    """Wall time of a whole process; the bench ends when it fails."""
    began = perf_counter()
    done = subprocess.run(
        command, cwd=ROOT, env=CACHING, capture_output=True, text=True, check=False
    )
    spent = perf_counter() - began
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command[:3])} failed:\n{done.stdout}{done.stderr}")
    return spent


def against_check_jsonschema(rounds: int) -> None:
    if shutil.which("check-jsonschema", path=str(BIN)) is None:
        print("check-jsonschema: skipped, not installed (pip install '.[bench]')")
        return
    other = [str(BIN / "check-jsonschema"), "--schemafile", str(SCHEMA), str(MISSION)]
    own = [str(BIN / "kybflow"), "validate", str(MISSION)]
    seconds_of(own), seconds_of(other)
    pairs = [(seconds_of(own), seconds_of(other)) for _ in range(rounds)]
    ours, theirs = (statistics.median(column) for column in zip(*pairs, strict=True))
    ratio = statistics.median(a / b for a, b in pairs)
    print("whole process, median              seconds")
    print(f"  kybflow validate                 {ours:7.3f}")
    print(f"  check-jsonschema                 {theirs:7.3f}")
    print(f"  ratio (median of pairs)          {ratio:7.2f}   goal {GOAL}")


def many(count: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROOT / "missions" / "library", Path(folder) / "library")
        text = MISSION.read_text(encoding="utf-8")
        paths = [Path(folder) / f"mission_{index}.yaml" for index in range(count)]
        for path in paths:
            path.write_text(text, encoding="utf-8")
        command = [str(BIN / "kybflow"), "validate"]
        one = min(seconds_of([*command, str(paths[0])]) for _ in range(3))
        all_of_them = min(seconds_of([*command, *map(str, paths)]) for _ in range(2))
    each = (all_of_them - one) / (count - 1) * 1e3
    print(f"{count} missions in one call          {all_of_them:7.3f} s")
    print(f"  each after the start             {each:7.2f} ms   goal {GOAL_MS}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--missions", type=int, default=200)
    options = parser.parse_args()
    against_check_jsonschema(options.rounds)
    many(options.missions)


if __name__ == "__main__":
    main()
