"""Random flights with faults, each flown again from its record: every decision must be the same.

    python bench/replays.py FIRST LAST

The flights are those of `bench/faults.py`. A line for each says whether its replay decided as the
flight did, and whether it wrote the same bytes, which a flight with cameras can't.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

from studies.random_faults import draw  # noqa: E402
from toolchain import with_library  # noqa: E402

from kybflow.api.flight import RunRequest, fly  # noqa: E402
from kybflow.api.replay.replay import replay  # noqa: E402


def flown_again(seed: int) -> tuple[bool, str]:
    """Fly a flight and its record; return whether all decisions were the same, and a line."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        drawn = draw(seed, with_library(folder))
        fly(drawn.plan, RunRequest(seed=seed, out=folder / "run", again=drawn.commands))
        replayed = replay(folder / "run", out=folder / "again")
        logs = [(folder / run / "log.mcap").read_bytes() for run in ("run", "again")]
    what = f"{seed} {drawn.mission}, {drawn.target}, {drawn.scenario}"
    if replayed.difference is None:
        return True, f"{what}: the same, {'' if logs[0] == logs[1] else 'not '}in every byte"
    return False, f"{what}: differs: {replayed.difference}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    given = parser.parse_args()
    same = 0
    for seed in range(given.first, given.last + 1):
        is_same, line = flown_again(seed)
        same += is_same
        print(line, flush=True)
    print(f"{same} of {given.last - given.first + 1} decided the same")


if __name__ == "__main__":
    main()
