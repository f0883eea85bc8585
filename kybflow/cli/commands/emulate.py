"""`kybflow emulate`: autopilots on simulated vehicles, for any MAVLink client."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from kybflow.cli.arguments import INVALID, Seed, examples
from kybflow.cli.output import echo

if TYPE_CHECKING:
    from kybflow.drivers.emulated_autopilot.breaking import Break
    from kybflow.drivers.emulated_autopilot.firmware.preparing import Plans
    from kybflow.drivers.emulated_autopilot.fleet import Fleet
    from kybflow.parts import Seat
    from kybflow.parts.catalog import PartSpec

EXAMPLES = examples(
    "kybflow emulate autopilot --vehicle px4",
    "kybflow emulate autopilot --vehicle px4 --count 2 --no-gps",
    "kybflow emulate autopilot --vehicle ardupilot --mission missions/courier.yaml --no-gps",
    "kybflow emulate autopilot --vehicle px4 --address udpin:127.0.0.1:14600 --fail blind@20",
)
RATE = 250
FAILED = 3
APART = 2.0
"""Metres between vehicles that no mission places."""
MISSION = """kybflow: 1
mission: emulated
import: {{std: kybflow/airframes}}
vehicles:
{vehicles}
"""
VEHICLE = """  v{number}:
    like: std.{airframe}
    start: {{at: [0, {y}, 0]}}
    behaviors:
      up: {{do: take_off, height: 1 m, then: down}}
      down: {{do: land}}
"""
Given = TypeVar("Given")
Read = TypeVar("Read")

app = typer.Typer(no_args_is_help=True)


@app.callback()
def _emulate() -> None:
    """Stand in for something that isn't there."""


class Autopilot(StrEnum):
    PX4 = "px4"
    ARDUPILOT = "ardupilot"


@app.command("autopilot", epilog=EXAMPLES)
def autopilot(
    vehicle: Annotated[Autopilot, typer.Option(help="Whose firmware is emulated.")],
    mission: Annotated[
        Path | None, typer.Option(help="A mission whose vehicles and obstacles are taken.")
    ] = None,
    airframe: Annotated[
        str, typer.Option(help="An airframe of the standard library, where there is no mission.")
    ] = "mk_quadro",
    count: Annotated[
        int, typer.Option(min=1, max=50, help="How many, where there is no mission.")
    ] = 1,
    address: Annotated[
        list[str] | None,
        typer.Option(
            help="Where it speaks, as `udpout:HOST:PORT`, `udpin:HOST:PORT` or `tcpin:HOST:PORT`;"
            " can be repeated. Of several vehicles each listens 10 ports above the one before."
            " By default as the firmware's own simulator does."
        ),
    ] = None,
    system: Annotated[int, typer.Option(min=1, max=200, help="System id of the first.")] = 1,
    gps: Annotated[
        bool,
        typer.Option(
            help="Whether it has GPS and is as the firmware comes; else it is set up for flight"
            " indoors, and its position comes from the client, as `kybflow run --target px4`"
            " wants it."
        ),
    ] = True,
    parameter: Annotated[
        list[str] | None,
        typer.Option("--param", metavar="NAME=VALUE", help="A parameter of the autopilot."),
    ] = None,
    own_system: Annotated[
        int, typer.Option(min=1, max=255, help="System id of the client, with --no-gps.")
    ] = 245,
    key: Annotated[
        Path | None, typer.Option(help="File with the secret of signed messages.")
    ] = None,
    fail: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=VALUE][@SECONDS]",
            help="What fails, and when: silent, deaf, blind, battery, refuse, bar, drop, tilt,"
            " pilot, heal.",
        ),
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0.01, max=100.0, help="Pace: 2 is twice as fast as real time.")
    ] = 1.0,
    seed: Seed = 0,
) -> None:
    """Emulate autopilots on simulated vehicles until Ctrl-C.

    MAVLink 2 on the addresses at which the firmware's own simulator is found: any client can arm,
    take off, fly by set-points, land. It is made for tests and rehearsals; only the firmware itself
    shows what the firmware does.
    """
    from kybflow.core.errors import DriverError
    from kybflow.drivers.emulated_autopilot.breaking import read_break
    from kybflow.drivers.mavlink.protocol.signing import read_key

    breaks = [_given("--fail", read_break, text) for text in fail or ()]
    changes = dict(_given("--param", _setting, text) for text in parameter or ())
    secret = None if key is None else _given("--key", read_key, key)
    seats = _seats(mission, airframe, count)
    places = address or _defaults(vehicle)
    try:
        from kybflow.drivers.emulated_autopilot.firmware.preparing import Plans, check_names

        check_names(vehicle.value, changes)
        plans = Plans(vehicle.value, not gps, not gps, own_system, changes)
        with ExitStack() as stack:
            fleet = _opened(stack, seats, plans, places, system, secret, seed)
            sys.stdout.flush()
            _serve(fleet, breaks, speed)
    except DriverError as error:
        echo(f"error: {error}", err=True)
        raise typer.Exit(FAILED) from None


def _opened(
    stack: ExitStack,
    seats: Sequence[Seat],
    plans: Plans,
    places: Sequence[str],
    first: int,
    secret: bytes | None,
    seed: int,
) -> Fleet:
    """All vehicles, each on its wires. Raises DriverError."""
    import random

    from kybflow.drivers.mavlink.transport import open_wire

    driver = _driver().cls
    fleet: Fleet = driver.fleet(seats, [plans] * len(seats), random.Random(seed), first)
    stack.callback(fleet.close)
    for number, member in enumerate(fleet.members):
        said = []
        for place in places:
            wire = open_wire(_shifted(place, number))
            stack.callback(wire.close)
            member.autopilot.connect(wire, secret)
            said.append(wire.address)
        name = f"{seats[number].context.vehicle} ({plans.firmware}, system {first + number})"
        echo(f"{name} speaks at {', '.join(said)}; Ctrl-C ends it")
    return fleet


def _serve(fleet: Fleet, breaks: Sequence[Break], speed: float) -> None:
    """Go on in the wall's time until Ctrl-C."""
    from kybflow.core.signals import NS
    from kybflow.runtime.clock import SimulatedClock

    clock, waiting = SimulatedClock(RATE, speed), sorted(breaks)
    try:
        while True:
            now = clock.step()
            while waiting and waiting[0].at <= now:
                what = waiting.pop(0)
                echo(f"{now / NS:.1f} s: {what}")
                sys.stdout.flush()
                for member in fleet.members:
                    what.apply(member.autopilot)
            fleet.advance(now)
    except KeyboardInterrupt:
        return


def _defaults(vehicle: Autopilot) -> tuple[str, ...]:
    """Where the firmware's own simulator speaks."""
    if vehicle is Autopilot.PX4:
        return ("udpout:127.0.0.1:14540", "udpout:127.0.0.1:14550")
    return ("tcpin:127.0.0.1:5760",)


def _shifted(place: str, number: int) -> str:
    """The address of one of several vehicles: PX4's own goes up by one, all ground stations share
    one, and where we listen every vehicle has its own."""
    from kybflow.drivers.mavlink.transport.address import LISTENING, read_address

    address = _given("--address", read_address, place)
    step = 10 if address.kind in LISTENING else int(place == "udpout:127.0.0.1:14540")
    return str(address._replace(number=address.number + step * number))


def _seats(mission: Path | None, airframe: str, count: int) -> list[Seat]:
    """The vehicles of a mission, or `count` of one kind."""
    from tempfile import TemporaryDirectory

    if mission is not None:
        return _compiled(mission, mission)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "emulated.yaml"
        vehicles = "".join(
            VEHICLE.format(number=number + 1, airframe=airframe, y=APART * number)
            for number in range(count)
        )
        path.write_text(MISSION.format(vehicles=vehicles), encoding="utf-8")
        return _compiled(path, None)


def _compiled(path: Path, mission: Path | None) -> list[Seat]:
    """The seats of a mission; ends with what is wrong with it."""
    from kybflow.api.opening import context_of
    from kybflow.api.validation import findings
    from kybflow.dsl.compiler import compile_mission
    from kybflow.parts import Seat
    from kybflow.parts.catalog import load_catalog

    result = compile_mission(path, catalog=load_catalog())
    if result.plan is None and mission is None:
        raise typer.BadParameter(
            "the standard library has no such airframe", param_hint="--airframe"
        )
    if result.plan is None:
        for text in findings(result, path):
            echo(text, err=True)
        raise typer.Exit(INVALID)
    plan, params = result.plan, _driver().params()
    return [Seat(context_of(plan, vehicle), params) for vehicle in plan.vehicles]


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


def _given(option: str, read: Callable[[Given], Read], given: Given) -> Read:
    from kybflow.core.errors import DriverError

    try:
        return read(given)
    except DriverError as error:
        raise typer.BadParameter(str(error), param_hint=option) from None
