"""`kybflow run`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Exit, Option

from kybflow.cli import arguments
from kybflow.cli.output import UnwaitedStream, console, echo, notices, printer
from kybflow.core.errors import FAILED, INTERRUPTED, INVALID, KybflowError, PartError

if TYPE_CHECKING:
    from kybflow.api.flight import Flown, RunRequest, Server
    from kybflow.cli.printing.live import LivePanel
    from kybflow.core.signals import Event
    from kybflow.dsl.compiler import Result
    from kybflow.dsl.plan import Plan
    from kybflow.recording.earlier_run import EarlierRun
    from kybflow.runtime.commanding.command_queue import RecordedCommand
    from kybflow.runtime.engine import Observer


def command(
    mission: Annotated[Path, Argument(help="The mission to fly.")],
    *,
    target: arguments.Target = None,
    sets: arguments.Sets,
    parts: arguments.Parts,
    seed: arguments.Seed = 0,
    out: arguments.Out = None,
    speed: Annotated[float | None, Option(min=0.01, help="Pace; 1 is real time.")] = None,
    options: arguments.Changes,
    emits: arguments.Emits,
    again: Annotated[Path | None, Option(metavar="RUN", help="Repeat this earlier run.")] = None,
    live: Annotated[bool, Option("--live", help="Show the simulation in a window.")] = False,
    plain: Annotated[
        bool, Option("--plain", help="Print events as lines, without a table.")
    ] = False,
    verbose: Annotated[bool, Option("--verbose", help="Print every passed check.")] = False,
    report: Annotated[bool, Option(help="Write report.html.")] = True,
    commands: Annotated[bool, Option(help="Accept `kybflow command`.")] = True,
    rehearses: Annotated[
        bool | None,
        Option("--rehearse/--no-rehearsal", help="Rehearse it on ideal vehicles first."),
    ] = None,
) -> None:
    """Fly a mission and write its report.

    A simulation flies as fast as possible unless --speed sets its pace. Hardware flies only after
    a rehearsal on ideal vehicles, as with --rehearse, that finds no error. --again repeats an
    earlier run from its folder: its target, seed, --set, --option and --emit, and its commands and
    inputs at the same times. Give the files of --parts anew.

    \b
    Exit codes:
    0: the run succeeded and every expectation held.
    1: the run failed, or its record can't be written.
    2: the mission or the command line is invalid, or the rehearsal failed.
    3: a driver or device failed.
    130: interrupted.

    \b
    Examples:
      kybflow run missions/figure_eight.yaml
      kybflow run missions/figure_eight.yaml --set lap=8s --seed 3
      kybflow run missions/first_flight.yaml --speed 1 --live
      kybflow run runs/X/mission.resolved.yaml --again runs/X
    """
    from kybflow.api.flight import RunRequest

    given: tuple[RecordedCommand, ...] = ()
    inputs: dict[str, str] = {}
    if again is not None:
        from kybflow.recording.earlier_run import read_earlier_run
        from kybflow.recording.run_folder import RunFolderError

        if target or seed or sets or options or emits:
            asked = "target, seed, --set, --option and --emit"
            raise arguments.WrongUsage(f"--again takes {asked} from the earlier run")
        with arguments.refusing("--again", RunFolderError):
            earlier = read_earlier_run(again)
        target, seed, given, inputs = earlier.target, earlier.seed, earlier.commands, earlier.inputs
        is_resolved = mission.resolve().parent == again.resolve()
        sets = [] if is_resolved else [*earlier.sets]
        options = [arguments.Change(*change) for change in earlier.options]
        emits = [arguments.Emitted(*emitted) for emitted in earlier.emits]
        if missing := earlier.missing_parts([file.name for file in parts]):
            told = f"the earlier run flew parts that --again doesn't load:{missing}"
            raise arguments.WrongUsage(told)
        warn_of_changed(earlier, parts)
    plan, result = arguments.compiled(mission, target, sets, parts)
    skips = rehearses is False and not plan.simulated
    rehearsed = None
    if rehearses or not (plan.simulated or skips):
        rehearsed = _rehearse(plan, result, emits, options)
    pace = 1.0 if live and speed is None else speed
    asked_for = (tuple(options), tuple(emits), tuple(sets))
    request = RunRequest(seed, out, pace, *asked_for, given, inputs, skips)
    raise Exit(
        fly_plan(
            plan, request, live=live, plain=plain, verbose=verbose, report=report, serves=commands,
            rehearsed=rehearsed,
        )
    )  # fmt: skip


def warn_of_changed(earlier: EarlierRun, parts: Sequence[Path]) -> None:
    """Warn of files of --parts that differ from those of the earlier run. Exits with INVALID if one
    is not a part."""
    from kybflow.parts.catalog import load_catalog

    with arguments.failing(INVALID, PartError):
        given = {file.name: (file, digest) for file, digest in load_catalog(*parts).files}
    for flown, digest in earlier.parts:
        file, own = given.get(flown.name, (flown, digest))
        if own != digest:
            echo(f"warning: `{file}` is not the file that the earlier run flew:", err=True)
            echo(f"  its SHA-256 is {own}, and was {digest}", err=True)


def _rehearse(
    plan: Plan,
    result: Result,
    emits: Sequence[arguments.Emitted],
    options: Sequence[arguments.Change],
) -> float:
    """Rehearse a plan, print the findings and return its duration, s. Exits with INVALID if a
    finding is an error."""
    from kybflow.api.rehearsal.rehearse import rehearse, reports

    with arguments.failing(INVALID, KybflowError):
        rehearsal = rehearse(plan, emits, options, result.texts)
    for text in reports(rehearsal, result.texts):
        echo(text, err=True)
    if not rehearsal.is_clean:
        echo("nothing has armed: the rehearsal failed (fly anyway: --no-rehearsal)", err=True)
        raise Exit(INVALID)
    return rehearsal.duration


def fly_plan(
    plan: Plan,
    request: RunRequest,
    *,
    live: bool = False,
    plain: bool = False,
    verbose: bool = False,
    report: bool = True,
    serves: bool = False,
    rehearsed: float | None = None,
) -> int:
    """Fly a plan, show its progress, write its report and return the exit code.

    live: whether to show the flight in the drivers' own window. plain: whether to print events as
    lines even on a terminal. verbose: whether to print every check before take-off that passed.
    serves: whether to accept `kybflow command`. rehearsed: how long its rehearsal took, s.
    """
    from kybflow.api.flight import fly
    from kybflow.api.opening import with_window
    from kybflow.cli.printing.flights import EventLines, outcome
    from kybflow.recording.run_folder import RunUnwritten

    err = printer(sys.stderr)
    listeners: list[Callable[[Event], None]] = []
    observers: list[Observer] = []
    servers: list[Server] = []
    if serves:
        from kybflow.command_server.server import CommandServer

        server = CommandServer()
        listeners.append(server.on_event)
        servers.append(server.serve)
    with UnwaitedStream(sys.stdout) as out:
        try:
            plan = with_window(plan) if live else plan
            with ExitStack() as stack:
                if plain or not sys.stdout.isatty():
                    write = out.line
                else:
                    panel = stack.enter_context(_panel(plan, out, rehearsed))
                    write = panel.line
                    observers.append(panel.on_tick)
                    servers += [] if panel.commander is None else [panel.commander.serve]
                listeners.append(EventLines(write, verbose=verbose))
                stack.enter_context(notices())
                flown = fly(plan, request, listeners, observers, servers)
        except KybflowError as error:
            err(f"error: {error}")
            return FAILED if isinstance(error, RunUnwritten) else INVALID
        for line in outcome(flown, has_pace=plan.simulated):
            out.line(line)
    if not report:
        return flown.exit_code
    with UnwaitedStream(sys.stdout) as out:  # all of the outcome is written
        return _report(flown, out.line, err)


def _panel(plan: Plan, out: UnwaitedStream, rehearsed: float | None) -> LivePanel:
    """Return the table of the flight, with keys below it unless an input reads the keyboard."""
    from kybflow.cli.printing.live import LivePanel

    person = None
    steers = any(own.part.cls.terminal_keys for own in plan.inputs)
    if not steers and sys.stdin is not None and sys.stdin.isatty():
        from kybflow.cli.keys import TerminalCommander
        from kybflow.core.terminal import Terminal

        person = TerminalCommander(Terminal(sys.stdin.fileno(), sys.stdout.fileno()))
    return LivePanel(console(out), person, rehearsed)


def _report(flown: Flown, out: Callable[[str], None], err: Callable[[str], None]) -> int:
    """Write the report and return the exit code. The outcome is printed first, because plotly is
    slow."""
    try:
        from kybflow.report.page import write_report

        page = write_report(flown.folder)
    except KybflowError as error:
        err(f"error: {error}")
        return flown.exit_code or FAILED
    except KeyboardInterrupt:
        err(f"interrupted: the run is in {flown.folder}, without a report")
        return INTERRUPTED
    out(f"report: {page}")
    return flown.exit_code
