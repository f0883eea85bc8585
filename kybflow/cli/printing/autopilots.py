"""What `kybflow mavlink` does with those that it meets, and what it prints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import click

from kybflow.cli.output import echo

if TYPE_CHECKING:
    from kybflow.core.signals import Time
    from kybflow.drivers.mavlink.discovery import Discovery
    from kybflow.drivers.mavlink.preflight.required_parameters import ParameterRow, ParameterSetup
    from kybflow.drivers.mavlink.telemetry.received_status import ReceivedStatus

SHOWN = 3
"""Of what an autopilot said, the newest."""


def listen_to(discovery: Discovery, steps: Iterator[Time], patience: Time) -> None:
    """Print a line for each autopilot that is heard. Raises DriverError where none is."""
    discovery.watch(steps, patience)
    for system in discovery.found():
        status = discovery.statuses[system]
        echo(f"system {system}: {described(status)}")
        for said in list(status.texts)[-SHOWN:]:
            echo(f"    it says: {said.text}")


def set_up(
    discovery: Discovery, steps: Iterator[Time], setup: ParameterSetup, *, write: bool
) -> bool:
    """Print the settings, written if that is asked; whether all is right. Raises DriverError where
    the autopilot can't be reached."""
    system = _only(discovery, discovery.find(steps), setup.profile.name)
    echo(f"system {system}: {described(discovery.statuses[system])}")
    parameters = discovery.settle(system, setup.profile, steps, setup.names)
    written: dict[str, float] = {}
    if write:
        if discovery.statuses[system].armed:
            echo("error: it is armed: nothing is written; disarm it first", err=True)
            return False
        written = setup.wrong(parameters.values)
        discovery.settle(system, setup.profile, steps, setup.names, written)
    rows = setup.rows(parameters, written)
    echo("\n".join((*table(rows), "")))
    for line in verdict(rows, dangers := setup.dangers(parameters.values), written=write):
        echo(line)
    return not dangers and all(row.is_right for row in rows)


def _only(discovery: Discovery, systems: Sequence[int], name: str) -> int:
    """The one that was found, if it is of that firmware."""
    from kybflow.drivers.mavlink.firmware import firmware_by

    if len(systems) > 1:
        names = ", ".join(str(system) for system in systems)
        raise click.BadParameter(f"systems {names} are heard: say which", param_hint="--system")
    number = discovery.statuses[systems[0]].autopilot
    if firmware_by(number) != name:
        found = described(discovery.statuses[systems[0]])
        message = f"system {systems[0]} is no {name}: {found}"
        raise click.BadParameter(message, param_hint="--vehicle")
    return systems[0]


def table(rows: Sequence[ParameterRow]) -> list[str]:
    """The rows in columns: parameter, what it is, what it should be, how it stands, why."""
    head = ("parameter", "has", "needs", "", "why")
    cells = [head, *(_cells(row) for row in rows)]
    widths = [max(len(line[i]) for line in cells) for i in range(4)]
    return [
        "  ".join((*(f"{c:<{w}}" for c, w in zip(line, widths, strict=False)), line[4]))
        for line in cells
    ]


def _cells(row: ParameterRow) -> tuple[str, ...]:
    has, why = "-", row.setting.why
    if row.found is not None:
        has, why = f"{row.found:g}", row.setting.does(row.found)
    why = f"{why} ({row.reason})" if row.reason else why
    return row.setting.name, has, row.needs, row.state, why


def verdict(
    rows: Sequence[ParameterRow], dangers: Sequence[str], *, written: bool
) -> Iterator[str]:
    """What is left to do, a line each."""
    for danger in dangers:
        yield f"DANGER: {danger}"
    missing = ", ".join(row.setting.name for row in rows if row.state == "MISSING")
    if missing:
        yield (
            f"missing: {missing}. Many parameters only appear once what they belong to is switched"
            " on and the autopilot has started anew: do that and look again; this firmware may also"
            " have them under other names"
        )
    if refused := ", ".join(row.setting.name for row in rows if row.state == "REFUSED"):
        yield f"refused: {refused}. Set them with the ground station, and look again"
    if not written and (count := sum(row.state == "WRONG" for row in rows)):
        yield f"{count} to write: the same command with --write"
    restart = ", ".join(r.setting.name for r in rows if r.state == "written" and r.setting.restart)
    if restart:
        yield f"start the autopilot anew before it flies: {restart} count only then"
    if not dangers and all(row.is_right for row in rows):
        yield "all is right"


def described(status: ReceivedStatus) -> str:
    """Firmware, mode, and whether it is armed."""
    from kybflow.drivers.mavlink.firmware import firmware_by, profile_of

    name = firmware_by(status.autopilot)
    arming = "armed" if status.armed else "disarmed"
    if name is None:
        return (
            f"an autopilot that kybflow does not fly (MAV_AUTOPILOT {status.autopilot}), {arming}"
        )
    mode = "mode unheard" if status.mode is None else profile_of(name).mode_name(status.mode)
    return f"{name}, {mode}, {arming}"
