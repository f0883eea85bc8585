"""`kybflow emulate autopilot`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

from typer import BadParameter, Option

from kybflow.cli.arguments import Seed, failing, refusing, repeated
from kybflow.cli.commands.emulate import serving
from kybflow.cli.output import echo
from kybflow.core.errors import DRIVER_FAILED, UnitError
from kybflow.core.units import finite_number
from kybflow.drivers import firmware_names

if TYPE_CHECKING:
    Firmware = str
else:
    Firmware = Literal[firmware_names("emulated_autopilot")]


class AutopilotParameter(NamedTuple):
    """A parameter of the autopilot."""

    name: str
    value: float


def setting(text: str) -> AutopilotParameter:
    """Parse `NAME=VALUE`."""
    name, _, value = text.partition("=")
    try:
        return AutopilotParameter(name.strip(), finite_number(value))
    except UnitError:
        raise BadParameter(f"`{text}` is not NAME=VALUE with a number") from None


def command(
    *,
    vehicle: Annotated[Firmware, Option(help="The firmware to emulate.")],
    mission: serving.Mission = None,
    airframe: Annotated[
        str, Option(help="An airframe of the standard library, without a mission.")
    ] = "mk_quadro",
    count: serving.Count = 1,
    address: Annotated[list[str], repeated("--address", help="Its address; can be repeated.")],
    system: Annotated[int, Option(min=1, max=200, help="The first system id.")] = 1,
    gps: Annotated[
        bool, Option(help="Whether it has GPS; else poses come from the client.")
    ] = True,
    factory: Annotated[
        bool, Option("--factory", help="It has the firmware's defaults, and GPS.")
    ] = False,
    param: Annotated[
        list[AutopilotParameter],
        repeated(
            "--param", parser=setting, metavar="NAME=VALUE", help="A parameter of the autopilot."
        ),
    ],
    own_system: Annotated[
        int, Option(min=1, max=255, help="System id of the client whose loss lands it.")
    ] = 245,
    key: Annotated[Path | None, Option(help="File with the secret of signed messages.")] = None,
    fail: Annotated[
        list[str],
        serving.fails("silent, deaf, blind, battery, refuse, bar, drop, tilt, pilot, heal"),
    ],
    speed: serving.Pace = 1.0,
    seed: Seed = 0,
) -> None:
    """Emulate autopilots on simulated vehicles until Ctrl-C.

    Any MAVLink 2 client can arm them, take off, fly by setpoints and land. The emulator is for
    tests and dry runs; it doesn't replace tests with the firmware itself.

    An address is `udpout:HOST:PORT`, `udpin:HOST:PORT` or `tcpin:HOST:PORT`; the default is that of
    the firmware's own simulator. Each further vehicle listens 10 ports above the previous one.

    It has the failsafes that `kybflow mavlink setup` writes, and flies without a transmitter. With
    --no-gps it is set up for flight indoors with positions from the client, as for
    `kybflow run --target px4`; with --factory it is as the firmware comes: ArduPilot then refuses
    to arm without a transmitter.

    \b
    Examples:
      kybflow emulate autopilot --vehicle px4
      kybflow emulate autopilot --vehicle px4 --count 2 --no-gps
      kybflow emulate autopilot --vehicle ardupilot --mission missions/courier.yaml --no-gps
      kybflow emulate autopilot --vehicle px4 --address udpin:127.0.0.1:14600 --fail blind@20
      kybflow emulate autopilot --vehicle ardupilot --factory
    """
    from kybflow.api.emulation import Wires, autopilots
    from kybflow.core.errors import DriverError
    from kybflow.drivers.emulated_autopilot.state import AutopilotFailures
    from kybflow.drivers.mavlink.protocol.signing import read_key
    from kybflow.drivers.mavlink.transport.wire import read_address

    def started(name: str, number: int, addresses: list[str]) -> None:
        echo(f"{name} ({vehicle}, system {number}) is at {', '.join(addresses)}; Ctrl-C ends it")

    if factory and not gps:
        raise BadParameter(
            "an autopilot as it comes has GPS; leave out --no-gps, or change single parameters"
            " with --param",
            param_hint="--factory",
        )
    breaks = serving.breaks_of(fail, AutopilotFailures)
    with refusing("--key", DriverError):
        secret = None if key is None else read_key(key)
    seats = serving.seats_for(mission, "emulated_autopilot", airframe, count)
    with refusing("--address", DriverError):
        for place in address:
            read_address(place)
    with failing(DRIVER_FAILED, DriverError):
        from kybflow.drivers.emulated_autopilot.firmware import SetupPlan

        setup = SetupPlan(vehicle, not gps, not factory, own_system, dict(param))
        with autopilots(seats, setup, Wires(address, system, secret), seed, started) as fleet:
            serving.served(fleet, breaks, speed)
