"""`kybflow mavlink setup`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Exit, Option

from kybflow.cli.arguments import wrong
from kybflow.cli.commands.mavlink import meeting
from kybflow.cli.output import columns, echo, grouped
from kybflow.core.errors import FAILED
from kybflow.drivers import firmware_names

if TYPE_CHECKING:
    from kybflow.core.signals import Time
    from kybflow.drivers.mavlink.discovery import Discovery, ParameterRow, ParameterSetup

    Firmware = str
else:
    Firmware = Literal[firmware_names("mavlink")]


def command(
    vehicle: Annotated[Firmware, Option(help="The firmware.")],
    address: Annotated[str | None, Option(help="Its address; by default its simulator's.")] = None,
    system: Annotated[
        int | None, Option(min=1, max=254, help="Its system id; by default the only one.")
    ] = None,
    write: Annotated[
        bool, Option("--write", help="Write wrong parameters and read them back.")
    ] = False,
    simulator: Annotated[
        bool, Option("--simulator", help="The autopilot is the firmware's simulator.")
    ] = False,
    own_system: meeting.OwnSystem = 245,
    key: meeting.Key = None,
) -> None:
    """Check the parameters for flight indoors without GPS; --write corrects them.

    \b
    Exit codes:
    0: all parameters are right.
    1: a parameter is wrong.
    2: the command line is invalid.
    3: the autopilot can't be reached.

    \b
    Examples:
      kybflow mavlink setup --vehicle px4
      kybflow mavlink setup --vehicle px4 --system 2 --simulator --write
      kybflow mavlink setup --vehicle ardupilot --address serial:/dev/ttyUSB0:57600
    """
    from kybflow.drivers.mavlink.discovery import ParameterSetup
    from kybflow.drivers.mavlink.firmware import profile_of

    profile = profile_of(vehicle)
    first, place = profile.default_address(1), address or profile.default_address(system or 1)

    def note() -> str:
        if address:
            return ""
        others = "" if place == first else _systems_at(first, own_system, key)
        return f"; that is the default address of system {system or 1}, see --address{others}"

    with meeting.meeting(place, system, own_system, key, note) as discovery:
        parameters = ParameterSetup(profile, own_system, simulator=simulator)
        is_right = set_up(discovery, meeting.ticks(), parameters, write=write)
    raise Exit(0 if is_right else FAILED)


def _systems_at(address: str, own_system: int, key: Path | None) -> str:
    """Return a hint about the systems found at another address; empty if there are none."""
    from kybflow.core.errors import DriverError
    from kybflow.drivers.mavlink.discovery import Discovery
    from kybflow.drivers.mavlink.protocol.signing import read_key
    from kybflow.drivers.mavlink.transport.sockets import open_wire

    try:
        with closing(open_wire(address)) as wire:
            secret = None if key is None else read_key(key)
            systems = Discovery(wire, None, own_system, secret).find(meeting.ticks())
    except DriverError:
        return ""
    return f"; at {address} is system {', '.join(map(str, systems))}"


def set_up(
    discovery: Discovery, steps: Iterator[Time], setup: ParameterSetup, *, write: bool
) -> bool:
    """Print the parameters, after correcting them if `write` is set. Return whether all are right.
    Raises DriverError if the autopilot can't be reached."""
    from kybflow.drivers.mavlink.firmware import firmware_by

    systems = discovery.find(steps)
    if len(systems) > 1:
        names = ", ".join(map(str, systems))
        raise wrong("--system", f"there are systems {names}; name one of them")
    system = systems[0]
    status, name = discovery.statuses[system], setup.profile.name
    if firmware_by(status.autopilot) != name:
        raise wrong("--vehicle", f"system {system} is no {name}: {meeting.described(status)}")
    echo(f"system {system}: {meeting.described(status)}")
    parameters = discovery.settle(system, setup.profile, steps, setup.names)
    written: dict[str, float] = {}
    if write:
        if discovery.statuses[system].armed:
            echo("error: nothing is written to an armed autopilot; disarm it first", err=True)
            return False
        written = setup.wrong(parameters.values)
        discovery.settle(system, setup.profile, steps, setup.names, written)
    rows = setup.rows(parameters, written)
    head = ("parameter", "has", "needs", "", "reason")
    echo("\n".join((*columns([head, *map(_cells, rows)]), "")))
    for line in verdict(rows, dangers := setup.dangers(parameters.values), written=write):
        echo(line)
    return not dangers and all(row.is_right for row in rows)


def _cells(row: ParameterRow) -> tuple[str, ...]:
    """Return a parameter's name, value, needed value, status and the reason."""
    has, why = "-", row.setting.why
    if row.found is not None:
        has, why = f"{row.found:g}", row.setting.does(row.found)
    why = f"{why} ({row.reason})" if row.reason else why
    return row.setting.name, has, row.needs, row.state, why


def verdict(
    rows: Sequence[ParameterRow], dangers: Sequence[str], *, written: bool
) -> Iterator[str]:
    """Yield what remains to be done."""
    names = grouped((row.state, row.setting.name) for row in rows)
    yield from (f"DANGER: {danger}" for danger in dangers)
    if missing := names.get("MISSING"):
        yield (
            f"missing: {', '.join(missing)}. Many parameters appear only after their feature is"
            " enabled and the autopilot restarted; do that and check again. This firmware may also"
            " have other names for them"
        )
    if refused := names.get("REFUSED"):
        yield f"refused: {', '.join(refused)}. Set them with the ground station and check again"
    if not written and "WRONG" in names:
        yield f"{len(names['WRONG'])} to write: repeat the command with --write"
    if restart := [r.setting.name for r in rows if r.state == "written" and r.setting.restart]:
        yield f"restart the autopilot before it flies, for {', '.join(restart)}"
    if not dangers and all(row.is_right for row in rows):
        yield "all parameters are right"
