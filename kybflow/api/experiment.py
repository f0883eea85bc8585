"""What a script does with missions: rehearse and fly them, and connect to a run. `import kybflow`
offers these functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from kybflow.api.missions import Findings, MissionInvalid, Values, compile_plan, pairs, settings
from kybflow.dsl.compiler import Result
from kybflow.dsl.plan import Plan

if TYPE_CHECKING:
    from kybflow.api.rehearsal.rehearse import Rehearsal
    from kybflow.api.runs import Run
    from kybflow.command_server.client import RunClient
    from kybflow.core.signals import Event


def rehearse(
    mission: str | Path,
    *,
    target: str | None = None,
    set: Values | None = None,
    options: Values | None = None,
    emit: Sequence[tuple[float, str]] = (),
    parts: Sequence[str | Path] = (),
) -> Findings:
    """Fly a mission on ideal vehicles and return the findings. options: parameters of parts, such
    as `mk.processors.limit_speed.speed`. emit: a person's events, as (seconds, name). Raises
    MissionInvalid if it can't be flown, EventRefused or OptionRefused."""
    plan, result = compile_plan(mission, target, settings(set), parts)
    return Findings(_rehearsed(plan, result, emit, pairs(options)).diagnostics, result.texts)


def run(
    mission: str | Path,
    *,
    target: str | None = None,
    seed: int = 0,
    set: Values | None = None,
    options: Values | None = None,
    emit: Sequence[tuple[float, str]] = (),
    parts: Sequence[str | Path] = (),
    out: str | Path | None = None,
    speed: float | None = None,
    on_event: Callable[[Event], None] | None = None,
    commands: bool = False,
    report: bool = False,
) -> Run:
    """Fly a mission and return the run. A failed run is returned, not raised.

    parts: Python files that define a part each. out: the run folder; a new one in `runs/` by
    default. speed: the pace of a simulation, 1 for real time; None for as fast as possible.
    on_event: called with every event, in the flight's thread. commands: whether `connect` reaches
    the run. report: whether to write its report. Hardware flies only after a rehearsal without
    errors. Raises MissionInvalid, RunFolderError, RunUnwritten, EventRefused or OptionRefused.
    """
    from kybflow.api.flight import RunRequest, fly
    from kybflow.api.runs import Run

    sets, changes = settings(set), pairs(options)
    plan, result = compile_plan(mission, target, sets, parts)
    if not plan.simulated:
        rehearsal = _rehearsed(plan, result, emit, changes)
        if not rehearsal.is_clean:
            raise MissionInvalid(Findings(rehearsal.diagnostics, result.texts))
    folder = None if out is None else Path(out)
    request = RunRequest(seed, folder, speed, changes, tuple(emit), sets)
    listeners = [] if on_event is None else [on_event]
    servers = []
    if commands:
        from kybflow.command_server.server import CommandServer

        server = CommandServer()
        listeners.append(server.on_event)
        servers.append(server.serve)
    flown = fly(plan, request, listeners, servers=servers)
    if report:
        from kybflow.report.page import write_report

        write_report(flown.folder)
    return Run.load(flown.folder)


def connect(run: str | Path | None = None, *, name: str = "python") -> RunClient:
    """Connect to a run that flies, to send commands. run: its folder, or the beginning of its name;
    None for the only one. name: how the run's record calls this program. Raises RunNotFound or
    RunUnreachable."""
    from kybflow.command_server.address import find_run
    from kybflow.command_server.client import RunClient

    return RunClient(find_run(None if run is None else str(run)), name)


def _rehearsed(
    plan: Plan,
    result: Result,
    emit: Sequence[tuple[float, str]],
    options: Sequence[tuple[str, str]],
) -> Rehearsal:
    from kybflow.api.rehearsal.rehearse import rehearse as rehearsed

    return rehearsed(plan, emit, options, result.texts)
