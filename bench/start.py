"""What a command costs before and after its work, in CPU time beside a reference in the same run.

    python bench/start.py [--rounds 9]

Each figure is a whole process, or a part of one, over a reference that takes turns with it, so that
whatever else the machine does slows both:

- `kybflow run`, start to first tick, over importing what it can't fly without, NumPy and MuJoCo;
- `kybflow --help`, over importing the command-line library;
- a flight's last tick to its verdict on the screen, over the report that is written after it.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parent.parent
MISSION = str(ROOT / "missions" / "figure_eight.yaml")
CACHING = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
"""All keep their bytecode, as installed programs do."""
UNTIL_THE_FIRST_TICK = """
import os
from kybflow.cli.app import main
from kybflow.cli.commands import run
fly_plan = run.fly_plan
def begun(*plan, **rest):
    from kybflow.runtime.engine import Engine
    Engine.tick = lambda engine: os._exit(0)
    return fly_plan(*plan, **rest)
run.fly_plan = begun
main()
"""
AFTER_THE_LAST_TICK = """
import json, sys
from time import process_time
from kybflow.cli.app import main
from kybflow.cli.commands import run
fly_plan, reported = run.fly_plan, run._reported
def watched(*plan, **rest):
    from kybflow.runtime.engine import Engine
    fly = Engine.run
    def run_and_note(engine):
        reason = fly(engine)
        global landed
        landed = process_time()
        return reason
    Engine.run = run_and_note
    return fly_plan(*plan, **rest)
def timed(*flown):
    told = process_time()
    code = reported(*flown)
    json.dump([told - landed, process_time() - told], sys.stderr)
    return code
run.fly_plan, run._reported = watched, timed
main()
"""


def cpu_of(code: str, *words: str) -> float:
    """CPU seconds of a whole process; the bench ends when it fails."""
    process = subprocess.Popen(
        [sys.executable, "-c", code, *words], cwd=ROOT, env=CACHING, stdout=subprocess.DEVNULL
    )
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise SystemExit(f"`{' '.join(words) or code}` failed")
    return used.ru_utime + used.ru_stime


def in_new_folder(cpu: Callable[[str], float]) -> float:
    with tempfile.TemporaryDirectory() as folder:
        return cpu(str(Path(folder) / "run"))


def beside(own: Callable[[], float], reference: Callable[[], float], rounds: int) -> None:
    """Let the two take turns, and print the ratio."""
    own(), reference()
    show([(own(), reference()) for _ in range(rounds)])


def show(pairs: list[tuple[float, float]]) -> None:
    ours, theirs = (statistics.median(column) * 1e3 for column in zip(*pairs, strict=True))
    ratio = statistics.median(a / b for a, b in pairs)
    print(f"  {ours:8.1f} ms   reference {theirs:8.1f} ms   ratio {ratio:6.3f}")


def ended(folder: str) -> tuple[float, float]:
    """CPU seconds from the last tick to the verdict, and of the report after it."""
    words = [sys.executable, "-c", AFTER_THE_LAST_TICK, "run", MISSION, "--out", folder]
    done = subprocess.run(words, cwd=ROOT, env=CACHING, capture_output=True, text=True, check=True)
    verdict, report = json.loads(done.stderr)
    return verdict, report


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=9)
    rounds = parser.parse_args().rounds
    print("kybflow run, start to first tick, over `import numpy, mujoco`")
    beside(
        lambda: in_new_folder(
            lambda folder: cpu_of(UNTIL_THE_FIRST_TICK, "run", MISSION, "--out", folder)
        ),
        lambda: cpu_of("import numpy, mujoco"),
        rounds,
    )
    print("kybflow --help, over `import typer`")
    beside(
        lambda: cpu_of("from kybflow.cli.app import main; main()", "--help"),
        lambda: cpu_of("import typer"),
        rounds,
    )
    print("last tick to verdict, over writing the report")
    pairs = []
    for _ in range(max(1, rounds // 3)):
        with tempfile.TemporaryDirectory() as folder:
            pairs.append(ended(str(Path(folder) / "run")))
    show(pairs)


if __name__ == "__main__":
    main()
