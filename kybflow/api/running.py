"""`kybflow run`: compile, fly, show, report."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from kybflow.api.findings import findings
from kybflow.api.flight import Flown, RunRequest, fly
from kybflow.cli.live_table import LivePanel, PlainPanel
from kybflow.core.details import headline
from kybflow.core.errors import KybflowError
from kybflow.core.units import format_measured
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan
from kybflow.parts.catalog import load_catalog
from kybflow.recording.outcome import EXIT_CODES, INVALID
from kybflow.report.page import write_report


@dataclass(frozen=True, slots=True)
class Asked:
    """What the command line asked for."""

    path: Path
    target: str | None
    request: RunRequest
    live: bool
    plain: bool
    report: bool


def run_mission(
    asked: Asked, out: Console, err: Console, prepare: Callable[[Plan], Plan] = lambda plan: plan
) -> int:
    """Fly one mission, its plan made ready by `prepare`; the exit code. Findings and refusals go to
    `err`."""
    result = compile_mission(
        asked.path, catalog=load_catalog(), target=asked.target, sets=asked.request.sets
    )
    for text in findings(result, asked.path):
        err.print(text, markup=False, soft_wrap=True)
    if result.plan is None:
        return INVALID
    try:
        plan = _live(result.plan) if asked.live else result.plan
        plan = prepare(plan)
        flown = _flown(plan, asked, out)
    except KybflowError as error:
        err.print(f"error: {error}", markup=False, soft_wrap=True)
        return INVALID
    _tell(flown, out, has_pace=plan.simulated)
    if asked.report and not _reported(flown, out, err):
        return flown.exit_code or EXIT_CODES["failed"]
    return flown.exit_code


def _reported(flown: Flown, out: Console, err: Console) -> bool:
    """Write the report; whether it could be."""
    try:
        page = write_report(flown.folder)
    except KybflowError as error:
        err.print(f"error: {error}", markup=False, soft_wrap=True)
        return False
    out.print(f"report: {page}", markup=False, soft_wrap=True)
    return True


def _flown(plan: Plan, asked: Asked, out: Console) -> Flown:
    plain = asked.plain or not out.is_terminal
    with PlainPanel(out) if plain else LivePanel(out) as panel:
        return fly(plan, asked.request, (panel.hear,), (panel.look,))


def _live(plan: Plan) -> Plan:
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


def _tell(flown: Flown, out: Console, *, has_pace: bool) -> None:
    """Print how it went. has_pace: whether it need not go by the clock on the wall."""
    summary = flown.summary
    for expectation in summary["expectations"]:
        mark = "held  " if expectation["held"] else "FAILED"
        out.print(
            f"{mark}  {expectation['text']}{_value(expectation)}", markup=False, soft_wrap=True
        )
    for seconds, name in flown.never_given:
        line = f"`{name}` at {seconds:g} s was never given: the run had ended"
        out.print(line, markup=False, soft_wrap=True)
    reason = f": {headline(summary['reason'])}" if summary["reason"] else ""
    pace = _pace(summary["real_time_factor"]) if has_pace else ""
    out.print(
        f"{summary['mission']} {summary['outcome']}{reason}\n"
        f"{summary['sim_time_s']:.1f} s flown in {summary['wall_time_s']:.1f} s{pace}, "
        f"recorded in {flown.folder}",
        markup=False,
        soft_wrap=True,
    )


def _pace(factor: float | None) -> str:
    """How many times as fast as real time; one significant figure of a slow one. Empty where it is
    not known."""
    if factor is None:
        return ""
    return f" ({factor:.0f} x real time)" if factor >= 1.0 else f" ({factor:.1g} x real time)"


def _value(expectation: dict[str, object]) -> str:
    value = expectation["value"]
    if not isinstance(value, float):
        return ""
    return f"  ({format_measured(value, str(expectation['unit']))})"
