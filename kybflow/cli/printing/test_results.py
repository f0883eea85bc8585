"""The output of `kybflow test`: a progress bar on a terminal, the failures, a table of the
missions, and the states and transitions that no flight took."""

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
    """Show a progress bar on a terminal. Yield the function to call after each flight; it prints
    failures even if there is no bar."""

    def show(text: str) -> None:
        console.print(text, markup=False, soft_wrap=True)

    def done(result: FlightResult) -> None:
        bar.advance(task)
        if result.passed:
            return
        show(f"{result.verdict.upper()}  {result.case.name}")
        for reason in result.reason:
            show("    " + reason.replace("\n", "\n    "))
        if result.folder is not None:
            show(f"    kept in {result.folder}")

    shown = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(
        *shown, TimeElapsedColumn(), console=console, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("flying", total=total)
        yield done


def show_table(
    console: Console, results: Sequence[FlightResult], coverage: dict[Path, Coverage]
) -> None:
    """Print the number of passed flights and the coverage of each mission, then what no flight
    took."""
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
