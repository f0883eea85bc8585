"""`kybflow mocap-server`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from kybflow.cli.arguments import (
    PATH,
    Subcommand,
    argument,
    compiled,
    examples,
    out_option,
    seed_option,
    set_option,
    target_option,
)
from kybflow.cli.output import echo

if TYPE_CHECKING:
    from kybflow.core.geometry import Vec3
    from kybflow.dsl.plan import Plan
    from kybflow.sensors.vrpn.server import Server

EXAMPLES = examples(
    "kybflow mocap-server missions/figure_eight.yaml",
    "kybflow mocap-server missions/figure_eight.yaml --host 10.0.0.5 --port 3884",
    "kybflow mocap-server --still courier=0,0,0.1 --still pillar=1,2,0",
)
STILL_RATE = 120


@click.command("mocap-server", cls=Subcommand, epilog=EXAMPLES)
@argument(
    "mission", "The mission whose simulated vehicles are published.", type=PATH, required=False
)
@click.option(
    "--still",
    multiple=True,
    metavar="NAME=X,Y,Z",
    help="Instead of a mission: a body at rest, in metres, until Ctrl-C.",
)
@click.option(
    "--host", default="127.0.0.1", help="Our address to listen on; 0.0.0.0 lets everybody in."
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=3883,
    help="Port, TCP and UDP; 0 takes a free one.",
)
@target_option
@set_option
@seed_option
@out_option
def command(
    mission: Path | None,
    still: tuple[str, ...],
    host: str,
    port: int,
    target: str | None,
    sets: tuple[str, ...],
    seed: int,
    out: Path | None,
) -> None:
    """Fly a mission in real time and publish its simulated vehicles over VRPN, as a motion-capture
    system would.

    Each vehicle is the tracker of its name, sensor 0, in metres, z up, noise and faults included.
    """
    if (mission is None) == (not still):
        raise click.BadParameter("give a mission, or bodies with --still", param_hint="MISSION")
    places = dict(_place(text) for text in still)
    from kybflow.sensors.vrpn.server import Server

    plan = None if mission is None else compiled(mission, target, sets)[0]
    server = Server(host, port)
    try:
        echo(f"VRPN server on {host}:{server.port} (HOST:PORT or tcp://HOST:PORT); Ctrl-C ends it")
        if plan is None:
            _stand(places, server, seed)
        else:
            raise Exit(_fly(plan, server, sets, seed, out))
    finally:
        server.close()


def _fly(plan: Plan, server: Server, sets: tuple[str, ...], seed: int, out: Path | None) -> int:
    from kybflow.api.flight import RunRequest
    from kybflow.cli.commands.run import fly_plan
    from kybflow.sensors.vrpn.publishing import published, to

    request = RunRequest(seed, out, 1.0, sets=sets)
    return fly_plan(published(plan, to(server)), request, report=False)


def _stand(places: dict[str, Vec3], server: Server, seed: int) -> None:
    import random

    from kybflow.parts.catalog import load_catalog
    from kybflow.runtime.clock import WallClock
    from kybflow.sensors.vrpn.codec import CodecError
    from kybflow.sensors.vrpn.publishing import PoseNoise, still, to

    sim = load_catalog().get("drivers", "sim").params()
    noise = PoseNoise(sim.mocap_position_noise, sim.mocap_attitude_noise)
    publish, clock = still(places, to(server), noise, random.Random(seed)), WallClock(STILL_RATE)
    try:
        while True:
            publish(clock.step())
    except KeyboardInterrupt:
        return
    except CodecError as error:
        raise click.BadParameter(str(error), param_hint="--still") from None


def _place(text: str) -> tuple[str, Vec3]:
    """Name and place of `NAME=X,Y,Z`."""
    from math import isfinite

    name, _, numbers = text.rpartition("=")
    try:
        x, y, z = map(float, numbers.split(","))
    except ValueError:
        x = float("nan")
        y = z = x
    if not name.strip() or not all(map(isfinite, (x, y, z))):
        raise click.BadParameter(f"`{text}` is not NAME=X,Y,Z", param_hint="--still")
    return name.strip(), (x, y, z)
