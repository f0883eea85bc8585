"""Inputs that mean harm: none may give a traceback, or take long.

    python bench/hostile.py FIRST LAST [--long 5] [--kind KIND] [--show]

Each number from FIRST to LAST is one input (`bench/studies/hostile_inputs.py`): noise in the text
of a mission, other values and shapes in it and in a library, other tables and calibrations, what
is no file in the place of one, odd arguments of every command. Each is given to the command line
inside of this process, in a folder that has the shipped libraries. Printed are those that raise,
end with an exit code that no help names, or take more than `--long` seconds or a gibibyte, and how
many inputs there were of each kind. A flight or a server is interrupted after a second, as Ctrl-C
does. Which input a number is depends on the generator and the missions. `--show` prints each input
with its answer.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import resource
import sys
import tempfile
from pathlib import Path
from time import perf_counter

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

from studies.hostile_answers import answer  # noqa: E402
from studies.hostile_inputs import drawn, lay_out  # noqa: E402

MEMORY = 6 << 30
"""Bytes that this process may have: what asks for more raises instead of filling the machine."""
MOST_KIB = 1 << 20
"""The most memory that an answer may need, KiB, as the kernel counts the process's peak."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--long", type=float, default=5.0, help="seconds that no input may take")
    parser.add_argument("--kind", help="only inputs of this kind")
    parser.add_argument("--show", action="store_true")
    asked = parser.parse_args()
    sys.stdout.reconfigure(errors="backslashreplace")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    counts: collections.Counter[str] = collections.Counter()
    bad, began, slowest, peak = 0, perf_counter(), 0.0, 0
    with tempfile.TemporaryDirectory() as above:
        place = Path(above) / "inner"
        place.mkdir()
        lay_out(place)
        for number in range(asked.first, asked.last + 1):
            one = drawn(number)
            if asked.kind not in (None, one.kind):
                continue
            with contextlib.chdir(place):
                found = answer(one, place, asked.long)
            counts[one.kind] += 1
            slowest = max(slowest, found.seconds)
            before, peak = peak, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            if before <= MOST_KIB < peak:
                found = found._replace(wrong=f"{found.wrong} needs {peak >> 10} MiB")
            if found.wrong or asked.show:
                bad += bool(found.wrong)
                shown = " ".join(word[:60] for word in one.arguments)
                print(f"{number} ({one.kind}) {shown}: {found.wrong or found.code}", flush=True)
                print(found.text[-3000:] if found.wrong or asked.show else "", flush=True)
    took = perf_counter() - began
    print(", ".join(f"{count} {kind}" for kind, count in sorted(counts.items())))
    print(f"{counts.total()} inputs, {bad} wrong, all {took:.0f} s")
    print(f"the slowest {slowest:.1f} s, at most {peak >> 10} MiB")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
