"""`kybflow emulate ardrone`."""

from __future__ import annotations

import sys
from functools import partial
from typing import Annotated

from typer import Option

from kybflow.cli.arguments import Seed, failing
from kybflow.cli.commands.emulate import serving
from kybflow.cli.output import echo
from kybflow.core.errors import DRIVER_FAILED


def command(
    *,
    mission: serving.Mission = None,
    count: serving.Count = 1,
    host: Annotated[str, Option(help="The first drone's loopback address.")] = "127.0.0.2",
    latency: Annotated[float, Option(min=0.0, max=1.0, help="Delay of a datagram, seconds.")] = 0.0,
    jitter: Annotated[
        float, Option(min=0.0, max=1.0, help="Largest variation of the delay, seconds.")
    ] = 0.0,
    loss: Annotated[float, Option(min=0.0, max=0.9, help="Share of lost datagrams.")] = 0.0,
    video: Annotated[bool, Option("--video", help="Send camera images.")] = False,
    fail: Annotated[list[str], serving.fails("silent, deaf, drop, battery, cutout, heal")],
    speed: serving.Pace = 1.0,
    seed: Seed = 0,
) -> None:
    """Emulate AR.Drones 2.0 on simulated vehicles until Ctrl-C.

    Each drone has its own loopback address, one after the other, with commands at UDP 5556,
    navigation data at UDP 5554, the configuration at TCP 5559 and video at TCP 5555. Any client
    that accepts an address can fly them. With --video each drone sends the images of its airframe's
    camera `front` or `down`.

    \b
    Examples:
      kybflow emulate ardrone
      kybflow emulate ardrone --count 3 --loss 0.05 --jitter 0.02
      kybflow emulate ardrone --fail battery=0.15@30
    """
    from kybflow.api.emulation import drones
    from kybflow.core.errors import DriverError
    from kybflow.drivers.emulated_ardrone.drone import DroneFailures
    from kybflow.drivers.emulated_ardrone.endpoint import Radio

    def started(name: str, where: str) -> None:
        echo(f"{name} (AR.Drone) is at {where}; Ctrl-C ends it")

    def show_phase(name: str, seconds: float, phase: str) -> None:
        echo(f"{seconds:.1f} s: {name} is {phase}")
        sys.stdout.flush()

    breaks = serving.breaks_of(fail, DroneFailures)
    seats = serving.seats_for(mission, "emulated_ardrone", "ardrone", count)
    radio = Radio(latency, jitter, loss)
    with (
        failing(DRIVER_FAILED, DriverError),
        drones(seats, radio, host, seed, started, video=video) as fleet,
    ):
        names = [seat.context.vehicle for seat in seats]
        for name, member in zip(names, fleet.members, strict=True):
            member.onboard.on_phase = partial(show_phase, name)
        serving.served(fleet, breaks, speed)
        for name, member in zip(names, fleet.members, strict=True):
            if ignored := member.onboard.drone.ignored:
                reasons = ", ".join(f"{count} {reason}" for reason, count in ignored.most_common())
                echo(f"{name} ignored {reasons}")
