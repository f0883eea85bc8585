"""What `kybflow test` prints: a progress bar in a terminal, a line for each failure, a table of the
missions, and what no run has taken."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from kybflow.campaigns.cases import FlightResult
from kybflow.campaigns.coverage import Coverage


class ProgressBar:
    """The progress of a session as a bar on a terminal, with each failure as it happens. Elsewhere
    only the failures are printed."""

    def __init__(self, console: Console, total: int) -> None:
        columns = (
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
            TimeElapsedColumn(),
        )  # fmt: skip
        self._console = console
        self._progress = Progress(*columns, console=console, disable=not console.is_terminal)
        self._task = self._progress.add_task("flying", total=total)

    def __enter__(self) -> ProgressBar:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._progress.stop()

    def done(self, result: FlightResult) -> None:
        self._progress.advance(self._task)
        if result.passed:
            return
        self._say(f"{result.verdict.upper()}  {result.case.name}")
        for reason in result.reason:
            self._say("    " + reason.replace("\n", "\n    "))
        if result.folder is not None:
            self._say(f"    kept in {result.folder}")

    def _say(self, text: str) -> None:
        self._console.print(text, markup=False, soft_wrap=True)


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
