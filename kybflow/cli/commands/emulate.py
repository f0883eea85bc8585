"""`kybflow emulate`: autopilots and drones on simulated vehicles, for any client of theirs."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from kybflow.cli.arguments import PATH, FiniteRange, Subcommand, examples, seed_option
from kybflow.cli.emulating.ardrone import ardrone
from kybflow.cli.emulating.serving import given, seats_of, serve
from kybflow.cli.output import echo
from kybflow.core.exit_codes import DRIVER_FAILED
from kybflow.drivers import firmware_names

if TYPE_CHECKING:
    from kybflow.drivers.emulated_autopilot.firmware import SetupPlan
    from kybflow.drivers.emulated_autopilot.messages.endpoint import MavlinkEndpoint
    from kybflow.drivers.emulation.fleet import Fleet
    from kybflow.parts import Seat
    from kybflow.parts.catalog import PartSpec

EXAMPLES = examples(
    "kybflow emulate autopilot --vehicle px4",
    "kybflow emulate autopilot --vehicle px4 --count 2 --no-gps",
    "kybflow emulate autopilot --vehicle ardupilot --mission missions/courier.yaml --no-gps",
    "kybflow emulate autopilot --vehicle px4 --address udpin:127.0.0.1:14600 --fail blind@20",
)


@click.group("emulate", no_args_is_help=True)
def command() -> None:
    """Stand in for something that isn't there."""


command.add_command(ardrone)


@command.command("autopilot", cls=Subcommand, epilog=EXAMPLES)
@click.option(
    "--vehicle",
    type=click.Choice(firmware_names("emulated_autopilot")),
    required=True,
    help="Whose firmware is emulated.",
)
@click.option("--mission", type=PATH, help="A mission whose vehicles and obstacles are taken.")
@click.option(
    "--airframe",
    default="mk_quadro",
    help="An airframe of the standard library, where there is no mission.",
)
@click.option(
    "--count",
    type=click.IntRange(1, 50),
    default=1,
    help="How many, where there is no mission.",
)
@click.option(
    "--address",
    multiple=True,
    help="Where it speaks, as `udpout:HOST:PORT`, `udpin:HOST:PORT` or `tcpin:HOST:PORT`;"
    " can be repeated. Of several vehicles each listens 10 ports above the one before."
    " By default as the firmware's own simulator does.",
)
@click.option("--system", type=click.IntRange(1, 200), default=1, help="System id of the first.")
@click.option(
    "--gps/--no-gps",
    default=True,
    help="Whether it has GPS and is as the firmware comes; else it is set up for flight"
    " indoors, and its position comes from the client, as `kybflow run --target px4`"
    " wants it.",
)
@click.option(
    "--param",
    "parameters",
    multiple=True,
    metavar="NAME=VALUE",
    help="A parameter of the autopilot.",
)
@click.option(
    "--own-system",
    type=click.IntRange(1, 255),
    default=245,
    help="System id of the client, with --no-gps.",
)
@click.option("--key", type=PATH, help="File with the secret of signed messages.")
@click.option(
    "--fail",
    multiple=True,
    metavar="NAME[=VALUE][@SECONDS]",
    help="What fails, and when: silent, deaf, blind, battery, refuse, bar, drop, tilt,"
    " pilot, heal.",
)
@click.option(
    "--speed",
    type=FiniteRange(0.01, 100.0),
    default=1.0,
    help="Pace: 2 is twice as fast as real time.",
)
@seed_option
def autopilot(
    vehicle: str,
    mission: Path | None,
    airframe: str,
    count: int,
    address: tuple[str, ...],
    system: int,
    gps: bool,
    parameters: tuple[str, ...],
    own_system: int,
    key: Path | None,
    fail: tuple[str, ...],
    speed: float,
    seed: int,
) -> None:
    """Emulate autopilots on simulated vehicles until Ctrl-C.

    MAVLink 2 on the addresses at which the firmware's own simulator is found: any client can arm,
    take off, fly by set-points, land. It is made for tests and dry runs; only the firmware itself
    shows what the firmware does.
    """
    from kybflow.core.errors import DriverError
    from kybflow.drivers.emulated_autopilot.state import AutopilotFailures
    from kybflow.drivers.emulation.breaking import read_break
    from kybflow.drivers.mavlink.protocol.signing import read_key

    breaks = [given("--fail", partial(read_break, kind=AutopilotFailures), text) for text in fail]
    changes = dict(given("--param", _setting, text) for text in parameters)
    secret = None if key is None else given("--key", read_key, key)
    seats = seats_of(mission, airframe, count, _driver())
    places = address or _defaults(vehicle)
    try:
        from kybflow.drivers.emulated_autopilot.firmware import SetupPlan, check_names

        check_names(vehicle, changes)
        plan = SetupPlan(vehicle, not gps, not gps, own_system, changes)
        with ExitStack() as stack:
            fleet = _opened(stack, seats, plan, places, system, secret, seed)
            sys.stdout.flush()
            serve(fleet, breaks, speed)
    except DriverError as error:
        echo(f"error: {error}", err=True)
        raise Exit(DRIVER_FAILED) from None


def _opened(
    stack: ExitStack,
    seats: Sequence[Seat],
    plan: SetupPlan,
    places: Sequence[str],
    first: int,
    secret: bytes | None,
    seed: int,
) -> Fleet[MavlinkEndpoint]:
    """All vehicles, each on its wires. Raises DriverError."""
    import random

    from kybflow.drivers.mavlink.transport import open_wire

    driver = _driver().cls
    fleet: Fleet[MavlinkEndpoint] = driver.fleet(
        seats, [plan] * len(seats), random.Random(seed), first
    )
    stack.callback(fleet.close)
    for number, member in enumerate(fleet.members):
        said = []
        for place in places:
            wire = open_wire(_shifted(place, number))
            stack.callback(wire.close)
            member.onboard.connect(wire, secret)
            said.append(wire.address)
        name = f"{seats[number].context.vehicle} ({plan.firmware}, system {first + number})"
        echo(f"{name} speaks at {', '.join(said)}; Ctrl-C ends it")
    return fleet


def _own_address(firmware: str, number: int = 0) -> str:
    """Where the firmware's own simulator speaks to a driver. number: of several, from 0."""
    from kybflow.drivers.mavlink.firmware import profile_of
    from kybflow.drivers.mavlink.transport.address import read_address

    theirs = read_address(profile_of(firmware).default_address(1 + number))
    return str(theirs._replace(kind={"udpin": "udpout", "tcp": "tcpin"}[theirs.kind]))


def _defaults(firmware: str) -> tuple[str, ...]:
    """Where the firmware's own simulator speaks."""
    from kybflow.drivers.emulated_autopilot.firmware import emulated_firmware

    return (_own_address(firmware), *emulated_firmware(firmware).stations)


def _shifted(place: str, number: int) -> str:
    """The address of one of several vehicles: at the driver's port of a firmware's own simulator
    that one's next, where we listen one of its own; all ground stations share one."""
    from kybflow.drivers.mavlink.transport.address import LISTENING, read_address

    for firmware in firmware_names("emulated_autopilot"):
        if place == _own_address(firmware):
            return _own_address(firmware, number)
    address = given("--address", read_address, place)
    step = 10 if address.kind in LISTENING else 0
    return str(address._replace(number=address.number + step * number))


def _driver() -> PartSpec:
    """The driver, which brings MuJoCo."""
    from kybflow.parts.catalog import load_catalog

    return load_catalog().get("drivers", "emulated_autopilot")


def _setting(text: str) -> tuple[str, float]:
    """NAME=VALUE."""
    from kybflow.core.errors import DriverError

    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise DriverError(f"`{text}` is not NAME=VALUE, with a number") from None
