"""`kybflow mavlink`: who is heard at an address, and what an autopilot needs for flight indoors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import click
from click.exceptions import Exit

from kybflow.cli.arguments import PATH, Subcommand, examples
from kybflow.cli.output import echo
from kybflow.core.exit_codes import DRIVER_FAILED, FAILED
from kybflow.drivers import firmware_names

if TYPE_CHECKING:
    from kybflow.core.signals import Time
    from kybflow.drivers.mavlink.discovery import Discovery

SETUP = examples(
    "kybflow mavlink setup --vehicle px4",
    "kybflow mavlink setup --vehicle px4 --system 2 --simulator --write",
    "kybflow mavlink setup --vehicle ardupilot --address serial:/dev/ttyUSB0:57600",
)
LISTEN = examples(
    "kybflow mavlink listen --address udpin:127.0.0.1:14540",
    "kybflow mavlink listen --address serial:/dev/ttyUSB0:57600 --for 20s",
)
RATE = 100
LONGEST = 3600
Given = TypeVar("Given")
Read = TypeVar("Read")

own_system_option = click.option(
    "--own-system",
    type=click.IntRange(1, 255),
    default=245,
    help="The system id of this program, as in the mission.",
)
key_option = click.option("--key", type=PATH, help="File with the secret of signed messages.")


@click.group("mavlink", no_args_is_help=True)
def command() -> None:
    """Meet an autopilot: hear it, and set its parameters."""


@command.command("setup", cls=Subcommand, epilog=SETUP)
@click.option(
    "--vehicle",
    type=click.Choice(firmware_names("mavlink")),
    required=True,
    help="Whose firmware it is.",
)
@click.option("--address", help="Where it is; where the firmware's own simulator is by default.")
@click.option(
    "--system",
    type=click.IntRange(1, 254),
    help="Its system id; needed where several are heard.",
)
@click.option("--write", is_flag=True, help="Write what is wrong, and read it back.")
@click.option("--simulator", is_flag=True, help="It is the firmware's own simulator.")
@own_system_option
@key_option
def setup(
    vehicle: str,
    address: str | None,
    system: int | None,
    write: bool,
    simulator: bool,
    own_system: int,
    key: Path | None,
) -> None:
    """Look at the parameters that flight indoors without GPS needs; nothing is written without
    --write.

    \b
    Exit codes:
    0: all is right.
    1: something is not.
    2: the command line is invalid.
    3: the autopilot can't be reached.
    """
    from kybflow.cli.printing.autopilots import set_up
    from kybflow.drivers.mavlink.firmware import profile_of
    from kybflow.drivers.mavlink.preflight.required_parameters import ParameterSetup

    profile = profile_of(vehicle)
    first, place = profile.default_address(1), address or profile.default_address(system or 1)

    def note() -> str:
        if address:
            return ""
        others = "" if place == first else _heard(first, own_system, key)
        return f"; without --address system {system or 1} is looked for there{others}"

    with _opened(place, system, own_system, key, note) as discovery:
        parameters = ParameterSetup(profile, own_system, simulator=simulator)
        is_right = set_up(discovery, ticks(), parameters, write=write)
    raise Exit(0 if is_right else FAILED)


@command.command("listen", cls=Subcommand, epilog=LISTEN)
@click.option("--address", required=True, help="Where to listen, such as udpin:127.0.0.1:14540.")
@click.option("--for", "duration", default="5s", help="How long, such as 5s.")
@own_system_option
@key_option
def listen(address: str, duration: str, own_system: int, key: Path | None) -> None:
    """Say which autopilots are heard at an address.

    \b
    Exit codes:
    0: at least one is heard.
    2: the command line is invalid.
    3: none is.
    """
    from kybflow.cli.printing.autopilots import listen_to

    patience = _duration(duration)
    with _opened(address, None, own_system, key) as discovery:
        listen_to(discovery, ticks(), patience)


def ticks() -> Iterator[Time]:
    """The wall's time, waiting for each."""
    from kybflow.runtime.clock import WallClock

    clock = WallClock(RATE)
    while True:
        yield clock.step()


@contextmanager
def _opened(
    address: str, system: int | None, own_system: int, key: Path | None,
    note: Callable[[], str] = str,
) -> Iterator[Discovery]:  # fmt: skip
    """The discovery on the wire of that address; its failures end the command. note: what to add to
    them."""
    from kybflow.core.errors import DriverError
    from kybflow.drivers.mavlink.protocol.signing import read_key
    from kybflow.drivers.mavlink.transport.address import read_address

    secret = None if key is None else _given("--key", read_key, key)
    place = _given("--address", read_address, address)
    try:
        from kybflow.drivers.mavlink.discovery import Discovery
        from kybflow.drivers.mavlink.transport import open_wire

        with closing(open_wire(place)) as wire:
            yield Discovery(wire, system, own_system, secret)
    except DriverError as error:
        echo(f"error: {error}{note()}", err=True)
        raise Exit(DRIVER_FAILED) from None


def _heard(address: str, own_system: int, key: Path | None) -> str:
    """Who is heard at another address, for one who looked in vain; empty where nobody is."""
    from kybflow.core.errors import DriverError
    from kybflow.drivers.mavlink.discovery import Discovery
    from kybflow.drivers.mavlink.protocol.signing import read_key
    from kybflow.drivers.mavlink.transport import open_wire

    try:
        with closing(open_wire(address)) as wire:
            secret = None if key is None else read_key(key)
            systems = Discovery(wire, None, own_system, secret).find(ticks())
    except DriverError:
        return ""
    return f"; at {address} is system {', '.join(map(str, systems))}"


def _given(option: str, read: Callable[[Given], Read], text: Given) -> Read:
    from kybflow.core.errors import DriverError

    try:
        return read(text)
    except DriverError as error:
        raise click.BadParameter(str(error), param_hint=option) from None


def _duration(text: str) -> Time:
    from kybflow.core.errors import UnitError
    from kybflow.core.units import DURATION, parse_quantity

    try:
        seconds = parse_quantity(text, DURATION)
    except UnitError as error:
        message = f"{error}; {error.hint}" if error.hint else str(error)
        raise click.BadParameter(message, param_hint="--for") from None
    if not 0.0 < seconds <= LONGEST:
        raise click.BadParameter(f"`{text}` is not within 0 s to {LONGEST} s", param_hint="--for")
    return round(seconds * 1e9)
