"""`kybflow mocap-server`."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated, NamedTuple

from typer import Argument, BadParameter, Exit, Option

from kybflow.cli.arguments import (
    Out,
    Seed,
    Sets,
    Target,
    compiled,
    failing,
    refusing,
    repeated,
    wrong,
)
from kybflow.cli.output import echo
from kybflow.core.errors import DRIVER_FAILED, DriverError, UnitError
from kybflow.core.geometry import Vec3
from kybflow.core.units import finite_number


class StillBody(NamedTuple):
    """A body at rest, in metres."""

    name: str
    place: Vec3


def still_body(text: str) -> StillBody:
    """Parse `NAME=X,Y,Z`."""
    name, _, numbers = text.rpartition("=")
    try:
        x, y, z = map(finite_number, numbers.split(","))
    except (UnitError, ValueError):
        name = ""
    if not name.strip():
        raise BadParameter(f"`{text}` is not NAME=X,Y,Z")
    return StillBody(name.strip(), (x, y, z))


def command(
    mission: Annotated[Path | None, Argument(help="The mission to fly.")] = None,
    *,
    still: Annotated[
        list[StillBody],
        repeated("--still", parser=still_body, metavar="NAME=X,Y,Z", help="A body at rest."),
    ],
    host: Annotated[
        str, Option(help="Address to listen at; 0.0.0.0 is open to the network.")
    ] = "127.0.0.1",
    port: Annotated[
        int, Option(min=0, max=65535, help="Port of TCP and UDP; 0 picks a free one.")
    ] = 3883,
    target: Target = None,
    sets: Sets,
    seed: Seed = 0,
    out: Out = None,
) -> None:
    """Fly a mission in real time and publish its simulated vehicles over VRPN, like a
    motion-capture system.

    Each vehicle is the tracker of its name, sensor 0, in metres, z up, with noise and faults.
    --still publishes bodies at rest, in metres, instead of a mission until Ctrl-C.

    \b
    Examples:
      kybflow mocap-server missions/figure_eight.yaml
      kybflow mocap-server missions/figure_eight.yaml --host 10.0.0.5 --port 3884
      kybflow mocap-server --still courier=0,0,0.1 --still pillar=1,2,0
    """
    if (mission is None) == (not still):
        raise wrong("MISSION", "give either a mission or bodies with --still")
    from kybflow.api.emulation import publish_at_rest
    from kybflow.api.flight import RunRequest
    from kybflow.cli.commands.run import fly_plan
    from kybflow.sensors.vrpn.codec import CodecError
    from kybflow.sensors.vrpn.server import Server, published, to

    plan = None if mission is None else compiled(mission, target, sets)[0]
    with failing(DRIVER_FAILED, DriverError):
        server = Server(host, port)
    try:
        echo(f"VRPN server on {host}:{server.port} (HOST:PORT or tcp://HOST:PORT); Ctrl-C ends it")
        if plan is None:
            with suppress(KeyboardInterrupt), refusing("--still", CodecError):
                publish_at_rest(dict(still), server, seed)
        else:
            request = RunRequest(seed, out, 1.0, sets=tuple(sets))
            raise Exit(fly_plan(published(plan, to(server)), request, report=False))
    finally:
        server.close()
