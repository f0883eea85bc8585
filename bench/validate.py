"""What `kybflow validate` costs beside check-jsonschema: processor time of whole processes.

    python bench/validate.py [--rounds 5] [--missions 200]

check-jsonschema judges the shape of one file; kybflow compiles the whole mission. They take turns,
so that whatever else the machine does slows both. Then many missions in one call: what they take
more than one, over their number, is the cost of a mission after the start. No two of them are
alike: in the first set every name and number of the mission is another one, in the second the
repository's missions take turns, each time with another name and other bounds.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

ROOT = Path(__file__).parent.parent
MISSIONS = ROOT / "missions"
MISSION = MISSIONS / "figure_eight.yaml"
SCHEMA = ROOT / "schemas" / "mission.schema.json"
BIN = Path(sys.executable).parent
OTHER = [str(BIN / "check-jsonschema"), "--schemafile", str(SCHEMA), str(MISSION)]
OWN = [str(BIN / "kybflow"), "validate"]
GOAL, EACH_GOAL = 0.5, 0.006
CACHING = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
"""Both keep their bytecode, as installed programs do."""
_NAMES = re.compile(r"\b(mk|nano|up|steady|eight|down|eight_flight|std)\b(?!/)")
_PARAMETERS = re.compile(r"(\$|^  )(lap|height|mass_guess)\b", re.MULTILINE)
_BOUND = re.compile(r"(?<= [<>] )(\d+(?:\.\d+)?)(?= (?:m|cm|mm|m/s|cm/s|s)\b)")


def seconds_of(command: Sequence[str]) -> float:
    """Processor time of a whole process; the bench ends when it fails."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        command, cwd=ROOT, env=CACHING, capture_output=True, text=True, check=False
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command[:3])} failed:\n{done.stdout}{done.stderr}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def own_eight(index: int) -> str:
    """The figure eight with names, lengths and times of its own."""
    text = _PARAMETERS.sub(rf"\g<0>_{index}", other_bounds(MISSION, index))
    text = _NAMES.sub(rf"\1_{index}", text)
    for name, value in {"lap": 8 + index / 50, "height": 1 + index / 1000}.items():
        text = re.sub(rf"(?<=  {name}_{index}:)(.*default: )\d+", rf"\g<1>{value:g}", text)
    text = text.replace("for_time: 3 s", f"for_time: {3 + index / 100:g} s")
    return text.replace("1.46 m", f"{1.46 - index / 1000:g} m")


def in_turn(index: int) -> str:
    """One of the repository's missions, with a name and bounds of its own."""
    paths = sorted(MISSIONS.glob("*.yaml"))
    return other_bounds(paths[index % len(paths)], index)


def other_bounds(path: Path, index: int) -> str:
    text = path.read_text(encoding="utf-8")
    text = re.sub(r"(?m)^mission: .*", rf"\g<0>_{index}", text)
    return _BOUND.sub(lambda match: f"{float(match[1]) * (1 + index / 2000):.6g}", text)


def written(folder: Path, count: int, text_of: Callable[[int], str]) -> list[str]:
    """The paths of `count` missions, with the libraries and tables that they name beside them."""
    for name in ("library", "operators", "scans", "trajectories"):
        shutil.copytree(MISSIONS / name, folder / name)
    paths = [folder / f"mission_{index}.yaml" for index in range(count)]
    for index, path in enumerate(paths):
        path.write_text(text_of(index), encoding="utf-8")
    return [str(path) for path in paths]


def measure(rounds: int, eights: list[str], others: list[str]) -> None:
    commands = (OTHER, [*OWN, str(MISSION)], [*OWN, *eights], [*OWN, *others])
    for command in commands:
        seconds_of(command)
    columns = list(zip(*([seconds_of(c) for c in commands] for _ in range(rounds)), strict=True))
    theirs, one, *many = columns
    print("whole process, median                       seconds")
    print(f"  check-jsonschema, one file                {statistics.median(theirs):7.3f}")
    print(f"  kybflow validate, one mission             {statistics.median(one):7.3f}")
    show("  ratio", [a / b for a, b in zip(one, theirs, strict=True)], ".2f", f"{GOAL}")
    whats = (f"{len(eights)} figure eights in one call", f"{len(others)} missions in one call")
    for what, column in zip(whats, many, strict=True):
        each = [(a - b) / (len(eights) - 1) for a, b in zip(column, one, strict=True)]
        print(f"{what}, median {statistics.median(column):13.3f} s")
        print(f"  each after the start {statistics.median(each) * 1e3:28.2f} ms")
        shares = [a / b for a, b in zip(each, theirs, strict=True)]
        show("  over check-jsonschema's whole process", shares, ".2%", f"{EACH_GOAL:.1%}")


def show(what: str, ratios: list[float], form: str, goal: str) -> None:
    """The median of the rounds, and how far apart they are: the noise of the machine."""
    spread = f"{min(ratios):{form}} to {max(ratios):{form}}"
    print(f"{what:<42}{statistics.median(ratios):>9{form}}   {spread}, goal {goal}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--missions", type=int, default=200)
    options = parser.parse_args()
    if shutil.which("check-jsonschema", path=str(BIN)) is None:
        raise SystemExit("check-jsonschema is not installed: pip install '.[bench]'")
    with tempfile.TemporaryDirectory() as eights, tempfile.TemporaryDirectory() as others:
        measure(
            options.rounds,
            written(Path(eights), options.missions, own_eight),
            written(Path(others), options.missions, in_turn),
        )


if __name__ == "__main__":
    main()
