"""The output of `kybflow run`, a line per event and the outcome; and of `kybflow test`, a progress
bar on a terminal, the failures, a table of the missions, and the states and transitions that no
flight took."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from kybflow.cli.output import styled
from kybflow.core.signals import NS, Event, Time
from kybflow.core.text import details, headline
from kybflow.dsl.resolving.library_files import without_homes
from kybflow.parts.events import PreflightPassed
from kybflow.recording.outcome import measured

if TYPE_CHECKING:
    from rich.console import Console

    from kybflow.api.flight import Flown
    from kybflow.campaigns.cases import Coverage, FlightResult

_MARGIN = " " * 20
_RAISED = re.compile(r'^  File "(.+)", line (\d+)', re.MULTILINE)
_NOTABLE_S = 0.1
"""Time without a value that is worth a word, s."""
_MEASURED = ("text", "held", "value", "margin", "unit", "when_s")
"""The fields of an expectation that `measured` takes."""
_QUIET_FIELDS = frozenset({"behavior", "part", "traceback"})


class EventLines:
    """Formats the events of a run and passes each on to `write`. The checks before take-off that
    passed become one line per vehicle, which counts them, unless `verbose`."""

    def __init__(self, write: Callable[[str], None], *, verbose: bool = False) -> None:
        self._write, self._verbose = write, verbose
        self._passed = Counter[tuple[Time, str]]()

    def __call__(self, event: Event) -> None:
        if event.name == PreflightPassed.name and not self._verbose:
            self._passed[event.time, event.vehicle] += 1
            return
        for (time, vehicle), count in self._passed.items():
            self._write(f"{_beginning(time, vehicle)}preflight: {count} checks passed")
        self._passed.clear()
        self._write(sentence(event))


def _beginning(time: Time, vehicle: str) -> str:
    return f"{time / NS:7.2f} s  {vehicle:8} "


def sentence(event: Event) -> str:
    """Format an event as a line, `  3.24 s  mk     behavior_started up (take_off)`, followed by any
    tables in its fields. The event `run_ended` omits its reason, which is part of the outcome."""
    fields = dict(event.fields)
    words = [event.name]
    if "behavior" in fields:
        words.append(str(fields["behavior"]))
    if "part" in fields:
        words.append(f"({fields['part']})")
    quiet = _QUIET_FIELDS | {"reason"} if event.name == "run_ended" else _QUIET_FIELDS
    shown = {k: v for k, v in fields.items() if k not in quiet and v is not None}
    words += [f"{k}={headline(_short(v))}" for k, v in shown.items()]
    if raised := _RAISED.findall(str(fields.get("traceback", ""))):
        words.append("({}:{})".format(*raised[-1]))
    at = f"  [{without_homes(event.at)}]" if event.at else ""
    line = f"{_beginning(event.time, event.vehicle)}{' '.join(words)}{at}"
    below = (row for value in shown.values() for row in details(_short(value)))
    return "\n".join([line, *(f"{_MARGIN}{row}" for row in below)])


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def outcome(flown: Flown, *, has_pace: bool) -> Iterator[str]:
    """Yield the lines printed after a run. has_pace: whether its clock may differ from real
    time."""
    summary = flown.summary
    began = any(vehicle["behaviors"] for vehicle in summary["vehicles"].values())
    for expectation in summary["expectations"] if began else ():
        mark, at = ("held  ", "") if expectation["held"] else ("FAILED", f"  [{expectation['at']}]")
        how = measured(*(expectation[key] for key in _MEASURED))
        value = f"  ({how})" if how else ""
        unknown = expectation["unknown_s"]
        gap = f"; unknown for {unknown:.1f} s of the flight" if unknown > _NOTABLE_S else ""
        yield f"{mark}  {expectation['text']}{value}{gap}{at}"
    for fault in summary["never_injected"]:
        yield f"the fault `{fault['fault']}` never happened  [{fault['at']}]"
    for given in summary["commands"]:
        yield f"`{given['command']}` was commanded at {given['t_s']:g} s by {given['by']}"
    for seconds, name in flown.never_given:
        yield f"`{name}` at {seconds:g} s was never given, because the run ended first"
    if missed := summary.get("missed_ticks"):
        ticks = "tick was" if missed == 1 else "ticks were"
        yield f"{missed} {ticks} missed: the computer was late"
    reason = f": {headline(summary['reason'])}" if summary["reason"] else ""
    ended = summary["outcome"].replace("_", " ").replace("failed", "FAILED")
    yield f"{summary['mission']} {ended}{reason}"
    pace, factor = "", summary["real_time_factor"]
    if has_pace and factor is not None:  # one significant digit below 1
        pace = f" ({factor:.0f} x real time)" if factor >= 1.0 else f" ({factor:.1g} x real time)"
    yield (
        f"{summary['sim_time_s']:.1f} s flown in {summary['wall_time_s']:.1f} s{pace}, "
        f"recorded in {flown.folder}"
    )


@contextmanager
def progress(console: Console, total: int) -> Iterator[Callable[[FlightResult], None]]:
    """Show a progress bar on a terminal. Yield the function to call after each flight; it prints
    failures even if there is no bar."""
    from rich import progress as bars

    def show(text: str) -> None:
        console.print(styled(text), soft_wrap=True)

    def done(result: FlightResult) -> None:
        bar.advance(task)
        if result.passed:
            return
        show(f"{result.verdict.upper()}  {result.case.name}")
        for reason in result.reason:
            show("    " + reason.replace("\n", "\n    "))
        if result.folder is not None:
            show(f"    kept in {result.folder}")

    shown = (bars.TextColumn("{task.description}"), bars.BarColumn(), bars.MofNCompleteColumn())
    times = (bars.TimeElapsedColumn(), bars.TimeRemainingColumn(), bars.TextColumn("left"))
    with bars.Progress(*shown, *times, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task("flying", total=total)
        yield done


def show_table(
    console: Console, results: Sequence[FlightResult], coverage: dict[Path, Coverage]
) -> None:
    """Print the number of passed flights and the coverage of each mission, then what no flight
    took."""
    from rich.markup import escape
    from rich.table import Table

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
