"""`kybflow run`."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from kybflow.cli.arguments import (
    PATH,
    FiniteRange,
    Subcommand,
    argument,
    compiled,
    emit_option,
    examples,
    option_option,
    out_option,
    pair,
    seed_option,
    set_option,
    target_option,
    timed,
)
from kybflow.cli.output import console, echo, teller
from kybflow.core.errors import KybflowError
from kybflow.core.exit_codes import FAILED, INTERRUPTED, INVALID

if TYPE_CHECKING:
    from kybflow.api.flight import Flown, RunRequest
    from kybflow.cli.keys.terminal_commander import TerminalCommander
    from kybflow.cli.printing.live import LivePanel
    from kybflow.cli.printing.run import PlainPanel
    from kybflow.command_server.server import CommandServer
    from kybflow.dsl.compiler import Result
    from kybflow.dsl.plan import Plan
    from kybflow.recording.earlier_run import EarlierRun
    from kybflow.runtime.commanding.command_queue import RecordedCommand

ASKED = "target, seed, --set, --option and --emit"
EXAMPLES = examples(
    "kybflow run missions/figure_eight.yaml",
    "kybflow run missions/figure_eight.yaml --set lap=8s --seed 3",
    "kybflow run missions/first_flight.yaml --speed 1 --live",
    "kybflow run runs/X/mission.resolved.yaml --again runs/X",
)


@click.command("run", cls=Subcommand, epilog=EXAMPLES)
@argument("mission", "The mission to fly.", type=PATH)
@target_option
@set_option
@seed_option
@out_option
@click.option(
    "--speed",
    type=FiniteRange(min=0.01),
    help="Pace of a simulation, 1 is real time; else as fast as it goes.",
)
@option_option
@emit_option
@click.option(
    "--again",
    type=PATH,
    metavar="RUN",
    help="Fly as an earlier run's folder says: with its target, seed, --set, --option and --emit, "
    "and each command given, each input moved, at the same time.",
)
@click.option("--live", is_flag=True, help="Show the simulation in a window.")
@click.option("--plain", is_flag=True, help="Events as lines, no table.")
@click.option("--report/--no-report", default=True, help="Write report.html.")
@click.option("--commands/--no-commands", "serves", default=True, help="Take `kybflow command`s.")
@click.option(
    "--rehearse/--no-rehearsal",
    "rehearses",
    default=None,
    help="Fly it on ideal vehicles first, and not at all if that goes wrong; as by default on "
    "hardware.",
)
def command(
    mission: Path,
    target: str | None,
    sets: tuple[str, ...],
    seed: int,
    out: Path | None,
    speed: float | None,
    options: tuple[str, ...],
    emits: tuple[str, ...],
    again: Path | None,
    live: bool,
    plain: bool,
    report: bool,
    serves: bool,
    rehearses: bool | None,
) -> None:
    """Fly a mission and report.

    \b
    Exit codes:
    0: it ended as it should and every expectation held.
    1: it did not, or its record could not be written.
    2: the mission or the command line is invalid, or its rehearsal went wrong.
    3: a driver or device failed.
    130: interrupted.
    """
    from kybflow.api.flight import RunRequest

    commands: tuple[RecordedCommand, ...] = ()
    said: dict[str, str] = {}
    if again is not None:
        if target or seed or sets or options or emits:
            raise click.UsageError(f"--again takes {ASKED} from the earlier run")
        target, seed, sets, options, emits, commands, said = _earlier(again)
        sets = () if mission.resolve().parent == again.resolve() else sets
    pace = 1.0 if live and speed is None else speed
    changes = tuple(pair(option) for option in options)
    given = tuple(timed(emit) for emit in emits)
    plan, result = compiled(mission, target, sets)
    skips = rehearses is False and not plan.simulated
    if rehearses or not (plan.simulated or skips):
        _rehearse(plan, result, given, changes)
    request = RunRequest(seed, out, pace, changes, given, sets, commands, said, skips)
    raise Exit(fly_plan(plan, request, live=live, plain=plain, report=report, serves=serves))


def _rehearse(
    plan: Plan,
    result: Result,
    given: tuple[tuple[float, str], ...],
    changes: tuple[tuple[str, str], ...],
) -> None:
    """Rehearse a plan and say what came of it. Exits with INVALID where it went wrong."""
    from kybflow.api.rehearsal.rehearse import rehearse
    from kybflow.cli.printing.rehearsal import reports

    try:
        rehearsal = rehearse(plan, given, changes, result.texts)
    except KybflowError as error:
        echo(f"error: {error}", err=True)
        raise Exit(INVALID) from None
    for text in reports(rehearsal, result.texts):
        echo(text, err=True)
    if not rehearsal.is_clean:
        echo(
            "nothing has armed: the rehearsal went wrong (--no-rehearsal flies all the same)",
            err=True,
        )
        raise Exit(INVALID)


def fly_plan(
    plan: Plan,
    request: RunRequest,
    *,
    live: bool = False,
    plain: bool = False,
    report: bool = True,
    serves: bool = False,
) -> int:
    """Fly a plan, show it and write its report; the exit code. live: in the drivers' own window.
    plain: events as lines also on a terminal. serves: take those of `kybflow command`."""
    from kybflow.api.flight import fly
    from kybflow.cli.printing.run import outcome
    from kybflow.recording.run_folder import RunUnwritten

    tell, complain = teller(sys.stdout), teller(sys.stderr)
    try:
        plan = _with_window(plan) if live else plan
        steers = any(own.part.cls.reads_terminal for own in plan.inputs)
        person = None if steers else _person(plain=plain)
        with _panel(tell, person, plain=plain) as shown:
            server = _command_server() if serves else None
            listeners = (shown.hear,) if server is None else (shown.hear, server.hear)
            servers = tuple(one.serve for one in (server, person) if one is not None)
            flown = fly(plan, request, listeners, (shown.look,), servers)
    except RunUnwritten as error:
        complain(f"error: {error}")
        return FAILED
    except KybflowError as error:
        complain(f"error: {error}")
        return INVALID
    for line in outcome(flown, has_pace=plan.simulated):
        tell(line)
    return _reported(flown, tell, complain) if report else flown.exit_code


def _earlier(folder: Path) -> EarlierRun:
    from kybflow.recording.earlier_run import read_earlier_run
    from kybflow.recording.run_folder import RunFolderError

    try:
        return read_earlier_run(folder)
    except RunFolderError as error:
        raise click.BadParameter(str(error), param_hint="--again") from None


def _command_server() -> CommandServer:
    from kybflow.command_server.server import CommandServer

    return CommandServer()


def _panel(
    tell: Callable[[str], None], person: TerminalCommander | None, *, plain: bool
) -> PlainPanel | LivePanel:
    """Where the flight is shown; only a table needs rich."""
    if plain or not sys.stdout.isatty():
        from kybflow.cli.printing.run import PlainPanel

        return PlainPanel(tell)
    from kybflow.cli.printing.live import LivePanel

    return LivePanel(console(sys.stdout), person)


def _person(*, plain: bool) -> TerminalCommander | None:
    """Who presses keys below the table, where there is one."""
    if plain or not (sys.stdout.isatty() and sys.stdin is not None and sys.stdin.isatty()):
        return None
    from kybflow.cli.keys.terminal_commander import TerminalCommander
    from kybflow.core.terminal import Terminal

    return TerminalCommander(Terminal(sys.stdin.fileno(), sys.stdout.fileno()))


def _reported(flown: Flown, tell: Callable[[str], None], complain: Callable[[str], None]) -> int:
    """Write the report, now that the verdict can be read: plotly takes its time. The exit code."""
    try:
        from kybflow.report.page import write_report

        page = write_report(flown.folder)
    except KybflowError as error:
        complain(f"error: {error}")
        return flown.exit_code or FAILED
    except KeyboardInterrupt:
        complain(f"interrupted: there is no report, all else is in {flown.folder}")
        return INTERRUPTED
    tell(f"report: {page}")
    return flown.exit_code


def _with_window(plan: Plan) -> Plan:
    """The plan with its drivers' own view switched on. Raises KybflowError where there is none."""
    vehicles = []
    for vehicle in plan.vehicles:
        driver = vehicle.driver
        if not hasattr(driver.params, "live"):
            raise KybflowError(f"the driver `{driver.name}` has no view of its own for --live")
        params = dataclasses.replace(driver.params, live=True)
        driver = dataclasses.replace(driver, params=params)
        vehicles.append(dataclasses.replace(vehicle, driver=driver))
    return dataclasses.replace(plan, vehicles=tuple(vehicles))
