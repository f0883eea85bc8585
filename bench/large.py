"""How fast a large mission is proven: 5,000 lines with 10 imports, as a whole process.

    python bench/large.py [--rounds 5] [--lines 5000] [--profile]

The reference, in turn with it, is PyYAML's C loader on the same files: a lower bound for anything
that reads them. `--profile` prints where the time goes instead.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from validate import BIN, seconds_of

GOAL = 1.0
IMPORTS = 10
STATES = 24
_LOAD = "import sys, yaml\nfor path in sys.argv[1:]: yaml.load(open(path), yaml.CSafeLoader)"


def library(number: int) -> str:
    """A library with vehicles, chains, stacks and a world."""
    return f"""library: lab_{number}
import: {{std: kybflow/airframes}}
parameters:
  speed: {{type: speed, default: 50 cm/s, help: Largest speed.}}
chains:
  line:
    parameters: {{first: {{type: position}}, last: {{type: position}}}}
    behaviors:
      reach: {{do: fly_to, position: $first, speed: $speed, then: along}}
      along: {{do: fly_to, position: $last, speed: $speed, then: wait}}
      wait:  {{do: hover, for_time: 1 s}}
stacks:
  safe: {{processors: [limit_speed, limit_acceleration, fence, position_error]}}
vehicles:
  quad: {{like: std.nano_plus, processors: [{{stack: safe}}]}}
"""


def mission(lines: int) -> str:
    """A mission of at least so many lines."""
    text = ["kybflow: 1", "mission: large", "import:"]
    text += [f"  lab_{n}: {{from: lab_{n}.yaml, with: {{speed: $cruise}}}}" for n in range(IMPORTS)]
    text += [
        "parameters:",
        "  cruise: {type: speed, default: 60 cm/s}",
        "  low:    {type: ratio, default: 30 %}",
        "world:",
        "  fence: {from: [-50, -50, 0], to: [50, 50, 5]}",
        "vehicles:",
    ]
    count = 0
    while len(text) < lines:
        text += vehicle(count)
        count += 1
    return "\n".join([*text, "expect:", "  - finished within 500 s", ""])


def vehicle(number: int) -> Iterator[str]:
    """One vehicle: take off, waypoints with conditions, chains in between, land."""
    x, y = 2 * (number % 40) - 40, 2 * (number // 40) - 40
    yield f"  v{number}:"
    yield f"    like: lab_{number % IMPORTS}.quad"
    yield f"    start: {{at: [{x}, {y}, 0]}}"
    yield "    behaviors:"
    yield "      up:"
    yield "        do: take_off"
    yield "        height: 1 m"
    yield "        then: s0"
    for state in range(STATES):
        follower = f"s{state + 1}" if state + 1 < STATES else "down"
        yield f"      s{state}:"
        if state % 8 == 7:
            yield f"        do: chain.lab_{number % IMPORTS}.line"
            yield f"        first: [{x}, {y}, 1]"
            yield f"        last: [{x}, {y}, 1.5]"
        else:
            yield "        do: fly_to"
            yield f"        position: [{x}, {y}, {1 + state / 20:g}]"
            yield "        speed: $cruise"
        yield "        next:"
        yield "          - when: battery.remaining < $low and state.altitude > 50 cm"
        yield "            go: down"
        yield "        within: 30 s"
        yield "        failed: down"
        yield f"        then: {follower}"
    yield "      down:"
    yield "        do: land"


def write(folder: Path, lines: int) -> list[Path]:
    """The mission, first, and its libraries."""
    paths = [folder / "large.yaml", *(folder / f"lab_{n}.yaml" for n in range(IMPORTS))]
    paths[0].write_text(mission(lines), encoding="utf-8")
    for number, path in enumerate(paths[1:]):
        path.write_text(library(number), encoding="utf-8")
    return paths


def profile(path: Path) -> None:
    import cProfile
    import pstats

    from kybflow.dsl.compiler import check_mission
    from kybflow.parts.catalog import load_catalog

    catalog = load_catalog()
    with cProfile.Profile() as profiler:
        result = check_mission(path, catalog=catalog)
    print(f"{len(result.diagnostics)} findings", *result.diagnostics[:2])
    pstats.Stats(profiler).sort_stats("tottime").print_stats(32)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--lines", type=int, default=5000)
    parser.add_argument("--profile", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        paths = write(Path(folder), options.lines)
        if options.profile:
            profile(paths[0])
            return
        own = [str(BIN / "kybflow"), "validate", str(paths[0])]
        load = [sys.executable, "-c", _LOAD, *map(str, paths)]
        seconds_of(own), seconds_of(load)
        pairs = [(seconds_of(own), seconds_of(load)) for _ in range(options.rounds)]
    ours, theirs = (statistics.median(column) for column in zip(*pairs, strict=True))
    print(f"{options.lines} lines, {IMPORTS} imports, median   seconds")
    print(f"  kybflow validate                {ours:7.3f}   goal {GOAL}")
    print(f"  PyYAML's C loader               {theirs:7.3f}")
    print(f"  ratio (median of pairs)         {statistics.median(a / b for a, b in pairs):7.2f}")


if __name__ == "__main__":
    main()
