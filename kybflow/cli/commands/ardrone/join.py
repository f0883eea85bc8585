"""`kybflow ardrone join`."""

from __future__ import annotations

from typing import Annotated

from typer import Option

from kybflow.cli.arguments import WrongUsage, failing
from kybflow.cli.output import echo
from kybflow.core.errors import DRIVER_FAILED


def command(
    ssid: Annotated[str, Option(help="The network to join, without WPA.")],
    address: Annotated[str, Option(help="The drone's address in that network.")],
    netmask: Annotated[str, Option(help="The network's mask.")] = "255.255.255.0",
    drone: Annotated[str, Option(help="The drone's present address.")] = "192.168.1.1",
    write: Annotated[
        bool, Option("--write", help="Execute the commands; by default they are only shown.")
    ] = False,
) -> None:
    """Move a drone from its own network into another, over its telnet shell.

    The drone stays there until it is switched off. Join the drone's own network first. Without
    --write the command only prints what it would send.

    \b
    Examples:
      kybflow ardrone join --ssid lab --address 192.168.1.11
      kybflow ardrone join --ssid lab --address 192.168.1.11 --write
    """
    from kybflow.core.errors import DriverError
    from kybflow.drivers.ardrone.joining import TELNET, join_lines, run_lines

    try:
        lines = join_lines(ssid, address, netmask)
    except DriverError as error:
        raise WrongUsage(str(error)) from None
    if not write:
        echo(f"would be sent to {drone}, port {TELNET}:")
        for line in lines:
            echo(f"  {line}")
        echo("nothing is sent without --write")
        return
    with failing(DRIVER_FAILED, DriverError):
        run_lines(lines, drone, echo)
    echo(f"the drone joins `{ssid}` as {address}; join that network too")
