"""What `kybflow mavlink` does with those that it meets, and what it prints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import typer

from kybflow.cli.arguments import echo

if TYPE_CHECKING:
    from kybflow.core.signals import Time
    from kybflow.drivers.mavlink.discovery import Scout
    from kybflow.drivers.mavlink.preflight.outfit import Outfit, Row
    from kybflow.drivers.mavlink.telemetry.heard import Heard

SHOWN = 3
"""Of what an autopilot said, the newest."""


def listen_to(scout: Scout, steps: Iterator[Time], patience: Time) -> None:
    """Print a line for each autopilot that is heard. Raises DriverError where none is."""
    scout.watch(steps, patience)
    for system in scout.found():
        heard = scout.heard[system]
        echo(f"system {system}: {described(heard)}")
        for said in list(heard.texts)[-SHOWN:]:
            echo(f"    it says: {said.text}")


def set_up(scout: Scout, steps: Iterator[Time], outfit: Outfit, *, write: bool) -> bool:
    """Print the settings, written if that is asked; whether all is right. Raises DriverError where
    the autopilot can't be reached."""
    system = _only(scout, scout.find(steps), outfit.profile.name)
    echo(f"system {system}: {described(scout.heard[system])}")
    is_bytewise = outfit.profile.integer_parameters_bytewise
    parameters = scout.settle(system, is_bytewise, steps, outfit.names)
    written: dict[str, float] = {}
    if write:
        if scout.heard[system].armed:
            echo("error: it is armed: nothing is written; disarm it first", err=True)
            return False
        written = outfit.wrong(parameters.values)
        scout.settle(system, is_bytewise, steps, outfit.names, written)
    rows = outfit.rows(parameters, written)
    echo("\n".join((*table(rows), "")))
    for line in verdict(rows, dangers := outfit.dangers(parameters.values), written=write):
        echo(line)
    return not dangers and all(row.is_right for row in rows)


def _only(scout: Scout, systems: Sequence[int], name: str) -> int:
    """The one that was found, if it is of that firmware."""
    from kybflow.drivers.mavlink.discovery import FIRMWARES

    if len(systems) > 1:
        names = ", ".join(str(system) for system in systems)
        raise typer.BadParameter(f"systems {names} are heard: say which", param_hint="--system")
    number = scout.heard[systems[0]].autopilot
    if FIRMWARES.get(number or 0) != name:
        found = described(scout.heard[systems[0]])
        message = f"system {systems[0]} is no {name}: {found}"
        raise typer.BadParameter(message, param_hint="--vehicle")
    return systems[0]


def table(rows: Sequence[Row]) -> list[str]:
    """The rows in columns: parameter, what it is, what it should be, how it stands, why."""
    head = ("parameter", "has", "needs", "", "why")
    cells = [head, *(_cells(row) for row in rows)]
    widths = [max(len(line[i]) for line in cells) for i in range(4)]
    return [
        "  ".join((*(f"{c:<{w}}" for c, w in zip(line, widths, strict=False)), line[4]))
        for line in cells
    ]


def _cells(row: Row) -> tuple[str, ...]:
    has, why = "-", row.setting.why
    if row.found is not None:
        has, why = f"{row.found:g}", row.setting.does(row.found)
    why = f"{why} ({row.reason})" if row.reason else why
    return row.setting.name, has, row.needs, row.state, why


def verdict(rows: Sequence[Row], dangers: Sequence[str], *, written: bool) -> Iterator[str]:
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


def described(heard: Heard) -> str:
    """Firmware, mode, and whether it is armed."""
    from kybflow.drivers.mavlink.discovery import FIRMWARES
    from kybflow.drivers.mavlink.firmware.profile import profile_of

    name = FIRMWARES.get(heard.autopilot or 0)
    arming = "armed" if heard.armed else "disarmed"
    if name is None:
        return f"an autopilot that kybflow does not fly (MAV_AUTOPILOT {heard.autopilot}), {arming}"
    mode = "mode unheard" if heard.mode is None else profile_of(name).mode_name(heard.mode)
    return f"{name}, {mode}, {arming}"
