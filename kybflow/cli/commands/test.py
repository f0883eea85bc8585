"""`kybflow test`."""

from __future__ import annotations

import os
import re
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from typer import Argument, Exit, Option

from kybflow.cli.arguments import Parts, Sets, Target, failing, writing, wrong
from kybflow.cli.output import console, echo
from kybflow.core.errors import INVALID, PartError

_SEEDS = re.compile(r"(\d{1,9})(?:\.\.(\d{1,9}))?")
_MOST_SEEDS = 100_000


def command(
    paths: Annotated[list[Path], Argument(help="Missions, or folders with missions below.")],
    *,
    seeds: Annotated[str, Option(help="For each mission: `0..99`, `3` or `0,7,20..29`.")] = "0",
    jobs: Annotated[
        int | None, Option(min=1, help="Parallel flights; by default one per core.")
    ] = None,
    junit: Annotated[Path | None, Option(help="Write JUnit XML to this file.")] = None,
    full: Annotated[bool, Option("--full", help="Fail on untaken states or transitions.")] = False,
    out: Annotated[Path, Option(help="Folder for failed flights.")] = Path("runs"),
    keep: Annotated[bool, Option("--keep", help="Keep every run folder.")] = False,
    target: Target = None,
    sets: Sets,
    parts: Parts,
) -> None:
    """Fly missions as tests, and list the states and transitions that no flight takes.

    \b
    Exit codes:
    0: every flight succeeded.
    1: a flight failed.
    2: a mission or the command line is invalid.
    3: a driver or device failed, or the process of a flight died.
    130: interrupted.

    \b
    Examples:
      kybflow test missions
      kybflow test missions/figure_eight.yaml --seeds 0..99
      kybflow test missions --junit report.xml --full
    """
    from datetime import datetime

    from kybflow.campaigns.cases import FlightCase, missions_under, write_junit
    from kybflow.campaigns.session import coverage_of, exit_code, run_cases
    from kybflow.cli.printing.flights import progress, show_table
    from kybflow.parts.catalog import load_catalog

    folder = out / f"test-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    numbers = _seeds(seeds)
    with failing(INVALID, PartError):  # fails before the flights
        load_catalog(*parts)
    found = list(missions_under(paths))
    if not found:
        echo(f"{', '.join(map(str, paths))}: no missions found", err=True)
        raise Exit(INVALID)
    asked = (target, tuple(sets), keep, tuple(parts))
    cases = [
        FlightCase(path, seed, folder / f"{n}-{path.stem}-{seed}", *asked)
        for n, path in enumerate(found)
        for seed in numbers
    ]
    if junit is not None:  # fails before the flights
        with writing(junit, "--junit"):
            write_junit(junit, ())
    with writing(folder, "--out"):
        folder.mkdir(parents=True, exist_ok=True)
    screen = console(sys.stdout)
    try:
        with progress(screen, len(cases)) as done:
            results = run_cases(cases, jobs or os.cpu_count() or 1, done)
    finally:
        with suppress(OSError):  # not empty: it holds kept flights
            folder.rmdir()
    coverage = coverage_of(results)
    show_table(screen, results, coverage)
    if len(results) < len(cases):
        screen.print(f"stopped after {len(results)} of {len(cases)} flights", highlight=False)
    if junit is not None:
        with writing(junit, "--junit"):
            write_junit(junit, results)
    missed = full and any(one.missed for one in coverage.values())
    raise Exit(exit_code(results, len(cases)) or int(missed))


def _seeds(text: str) -> list[int]:
    """Parse `0..99`, `3` or `0,7,20..29`, without duplicates."""
    numbers: dict[int, None] = {}
    for item in text.split(","):
        match = _SEEDS.fullmatch(item.strip())
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, -1)
        if not 0 <= last - first < _MOST_SEEDS:
            raise wrong(
                "--seeds",
                f"`{item.strip()}` is neither a seed such as `7` nor a range such as `0..99`",
            )
        numbers.update(dict.fromkeys(range(first, last + 1)))
    return list(numbers)
