"""`kybflow test`."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from kybflow.cli.arguments import (
    PATH,
    Subcommand,
    argument,
    examples,
    set_option,
    target_option,
)
from kybflow.cli.output import console, echo
from kybflow.core.exit_codes import INVALID

if TYPE_CHECKING:
    from kybflow.campaigns.cases import FlightCase, FlightResult

EXAMPLES = examples(
    "kybflow test missions",
    "kybflow test missions/figure_eight.yaml --seeds 0..99",
    "kybflow test missions --junit report.xml --full",
)
_SEEDS = re.compile(r"(\d{1,9})(?:\.\.(\d{1,9}))?")
_MOST = 100_000


@click.command("test", cls=Subcommand, epilog=EXAMPLES)
@argument("paths", "Missions, or folders with missions below.", type=PATH, nargs=-1, required=True)
@click.option(
    "--seeds",
    default="0",
    help="Seeds to fly each mission with: `0..99`, `3`, or `0,7,20..29`.",
)
@click.option(
    "--jobs", type=click.IntRange(min=1), help="Flights at a time; one a processor by default."
)
@click.option("--junit", type=PATH, help="Write JUnit XML to this file.")
@click.option("--full", is_flag=True, help="Fail when a state or transition was never taken.")
@click.option(
    "--out",
    type=PATH,
    default="runs",
    help="Where the run folders of flights that fail are kept.",
)
@click.option("--keep", is_flag=True, help="Keep every run folder.")
@target_option
@set_option
def command(
    paths: tuple[Path, ...],
    seeds: str,
    jobs: int | None,
    junit: Path | None,
    full: bool,
    out: Path,
    keep: bool,
    target: str | None,
    sets: tuple[str, ...],
) -> None:
    """Fly missions as tests, and tell which states and transitions no flight has taken.

    \b
    Exit codes:
    0: every flight succeeded.
    1: one failed.
    2: a mission or the command line is invalid.
    3: a driver or device failed, or a process that flew died.
    130: interrupted.
    """
    from datetime import datetime

    from kybflow.campaigns.cases import FlightCase, missions_under

    folder = out / f"test-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    numbers = _seeds(seeds)
    found = list(missions_under(paths))
    if not found:
        echo(f"no mission is under {', '.join(map(str, paths))}", err=True)
        raise Exit(INVALID)
    cases = [
        FlightCase(path, seed, folder / f"{n}-{path.stem}-{seed}", target, sets, keep)
        for n, path in enumerate(found)
        for seed in numbers
    ]
    if junit is not None:
        _report(junit, ())
    with _made(folder):
        raise Exit(_fly(cases, jobs or os.cpu_count() or 1, junit, full))


def _fly(cases: Sequence[FlightCase], jobs: int, junit: Path | None, full: bool) -> int:
    """Fly the cases and print the results; the exit code."""
    from kybflow.campaigns.session import coverage_of, exit_code, run_cases
    from kybflow.cli.printing.test_results import ProgressBar, show_table

    screen = console(sys.stdout)
    with ProgressBar(screen, len(cases)) as bar:
        results = run_cases(cases, jobs, bar.done)
    coverage = coverage_of(results)
    show_table(screen, results, coverage)
    if len(results) < len(cases):
        screen.print(f"stopped after {len(results)} of {len(cases)} flights", highlight=False)
    if junit is not None:
        _report(junit, results)
    missed = full and any(one.missed for one in coverage.values())
    return exit_code(results, len(cases)) or int(missed)


@contextmanager
def _made(folder: Path) -> Iterator[None]:
    """Make `folder` before anything flies; remove it when nothing was kept in it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = f"`{folder}` can't be written: {error.strerror}"
        raise click.BadParameter(message, param_hint="--out") from None
    try:
        yield
    finally:
        with suppress(OSError):
            folder.rmdir()


def _report(junit: Path, results: Sequence[FlightResult]) -> None:
    from kybflow.campaigns.junit import write_junit

    try:
        write_junit(junit, results)
    except OSError as error:
        message = f"`{junit}` can't be written: {error.strerror}"
        raise click.BadParameter(message, param_hint="--junit") from None


def _seeds(text: str) -> list[int]:
    """`0..99`, `3`, `0,7,20..29` as numbers, each once."""
    numbers: dict[int, None] = {}
    for item in text.split(","):
        match = _SEEDS.fullmatch(item.strip())
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, -1)
        if not 0 <= last - first < _MOST:
            message = f"`{item.strip()}` is no seed and no range of seeds; write `7` or `0..99`"
            raise click.BadParameter(message, param_hint="--seeds")
        numbers.update(dict.fromkeys(range(first, last + 1)))
    return list(numbers)
