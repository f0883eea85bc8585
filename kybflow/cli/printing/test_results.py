"""What `kybflow test` prints: a progress bar in a terminal, a line for each failure, a table of the
missions, and what no run has taken."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from kybflow.campaigns.cases import FlightResult
from kybflow.campaigns.coverage import Coverage


@contextmanager
def progress(console: Console, total: int) -> Iterator[Callable[[FlightResult], None]]:
    """The progress of a session as a bar on a terminal. Gives what is called after each flight, and
    prints one that failed, also where there is no bar."""

    def say(text: str) -> None:
        console.print(text, markup=False, soft_wrap=True)

    def done(result: FlightResult) -> None:
        bar.advance(task)
        if result.passed:
            return
        say(f"{result.verdict.upper()}  {result.case.name}")
        for reason in result.reason:
            say("    " + reason.replace("\n", "\n    "))
        if result.folder is not None:
            say(f"    kept in {result.folder}")

    shown = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(
        *shown, TimeElapsedColumn(), console=console, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("flying", total=total)
        yield done


def show_table(
    console: Console, results: Sequence[FlightResult], coverage: dict[Path, Coverage]
) -> None:
    """A line a mission: how many flights passed, how much of it they took; then what none took."""
    table = Table(box=None, pad_edge=False)
    for heading in ("mission", "passed", "states and transitions taken"):
        table.add_column(heading, overflow="fold")
    for path in dict.fromkeys(one.case.path for one in results):
        cases = [one for one in results if one.case.path == path]
        passed = sum(one.passed for one in cases)
        found = coverage.get(path)
        taken = "" if found is None else f"{found.total - len(found.missed)} of {found.total}"
        table.add_row(escape(str(path)), f"{passed} of {len(cases)}", taken)
    console.print(table)
    for path, found in coverage.items():
        for missed in found.missed:
            place = missed.at or str(path)
            console.print(f"{place}: not taken: {missed}", markup=False, soft_wrap=True)
