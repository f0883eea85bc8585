"""`kybflow emulate ardrone`: AR.Drones on simulated vehicles, for any client."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from kybflow.cli.arguments import PATH, Subcommand, examples, seed_option
from kybflow.cli.emulating.serving import given, seats_of, serve
from kybflow.cli.output import echo
from kybflow.core.exit_codes import DRIVER_FAILED

if TYPE_CHECKING:
    from kybflow.drivers.emulated_ardrone.endpoint import DroneEndpoint
    from kybflow.drivers.emulated_ardrone.onboard.radio import Radio
    from kybflow.drivers.emulation.fleet import Fleet
    from kybflow.parts import Seat

EXAMPLES = examples(
    "kybflow emulate ardrone",
    "kybflow emulate ardrone --count 3 --loss 0.05 --jitter 0.02",
    "kybflow emulate ardrone --fail battery=0.15@30",
)


@click.command("ardrone", cls=Subcommand, epilog=EXAMPLES)
@click.option("--mission", type=PATH, help="A mission whose vehicles and obstacles are taken.")
@click.option(
    "--count", type=click.IntRange(1, 50), default=1, help="How many, where there is no mission."
)
@click.option(
    "--host",
    default="127.0.0.2",
    help="The loopback address of the first; each has the next, with a drone's own ports.",
)
@click.option(
    "--latency", type=click.FloatRange(0.0, 1.0), default=0.0, help="Of a datagram, seconds."
)
@click.option(
    "--jitter", type=click.FloatRange(0.0, 1.0), default=0.0, help="By how much it differs at most."
)
@click.option(
    "--loss", type=click.FloatRange(0.0, 0.9), default=0.0, help="The share that is lost."
)
@click.option(
    "--video",
    is_flag=True,
    help="Send what the airframe's camera `front` or `down` sees, to who connects for it.",
)
@click.option(
    "--fail",
    multiple=True,
    metavar="NAME[=VALUE][@SECONDS]",
    help="What fails, and when: silent, deaf, drop, battery, cutout, heal.",
)
@click.option(
    "--speed",
    type=click.FloatRange(0.01, 100.0),
    default=1.0,
    help="Pace: 2 is twice as fast as real time.",
)
@seed_option
def ardrone(
    mission: Path | None,
    count: int,
    host: str,
    latency: float,
    jitter: float,
    loss: float,
    video: bool,
    fail: tuple[str, ...],
    speed: float,
    seed: int,
) -> None:
    """Emulate AR.Drones 2.0 on simulated vehicles until Ctrl-C.

    Commands at UDP 5556, navigation data at UDP 5554, the configuration at TCP 5559, video at TCP
    5555, each drone on a loopback address of its own: any client flies them that can be given an
    address.
    """
    from kybflow.core.errors import DriverError
    from kybflow.drivers.emulated_ardrone.onboard.drone import DroneFailures
    from kybflow.drivers.emulated_ardrone.onboard.radio import Radio
    from kybflow.drivers.emulation.breaking import read_break
    from kybflow.parts.catalog import load_catalog

    breaks = [given("--fail", partial(read_break, kind=DroneFailures), text) for text in fail]
    driver = load_catalog().get("drivers", "emulated_ardrone")
    seats = seats_of(mission, "ardrone", count, driver)
    try:
        with ExitStack() as stack:
            fleet = _opened(stack, seats, Radio(latency, jitter, loss), host, video, seed)
            sys.stdout.flush()
            serve(fleet, breaks, speed)
            for seat, member in zip(seats, fleet.members, strict=True):
                _tell(seat.context.vehicle, member.onboard.drone.ignored)
    except DriverError as error:
        echo(f"error: {error}", err=True)
        raise Exit(DRIVER_FAILED) from None


def _opened(
    stack: ExitStack, seats: Sequence[Seat], radio: Radio, host: str, video: bool, seed: int
) -> Fleet[DroneEndpoint]:
    """All drones, each at its ports. Raises DriverError."""
    import random

    from kybflow.drivers.emulated_ardrone import EmulatedArdrone
    from kybflow.drivers.emulated_ardrone.onboard.video import DroneVideo
    from kybflow.drivers.emulated_ardrone.ports.sockets import SocketPorts, host_of

    hosts = [host_of(number, host) for number in range(len(seats))]
    fleet = EmulatedArdrone.fleet(seats, radio, random.Random(seed))
    stack.callback(fleet.close)
    for seat, where, member in zip(seats, hosts, fleet.members, strict=True):
        ports = SocketPorts(where)
        stack.callback(ports.close)
        member.onboard.connect(ports)
        if video:
            endpoint, look = member.onboard, member.vehicle.truth
            configuration = endpoint.drone.configuration
            endpoint.video = DroneVideo(seat.context, look, configuration, seed)
        member.onboard.on_phase = partial(_tell_phase, seat.context.vehicle)
        echo(f"{seat.context.vehicle} (AR.Drone) speaks at {where}; Ctrl-C ends it")
    return fleet


def _tell_phase(name: str, seconds: float, phase: str) -> None:
    echo(f"{seconds:.1f} s: {name} is {phase}")
    sys.stdout.flush()


def _tell(name: str, ignored: Counter[str]) -> None:
    if ignored:
        reasons = ", ".join(f"{count} {reason}" for reason, count in ignored.most_common())
        echo(f"{name} ignored {reasons}")
