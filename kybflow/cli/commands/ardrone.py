"""`kybflow ardrone`: what is done to an AR.Drone before it is flown."""

from __future__ import annotations

import click
from click.exceptions import Exit

from kybflow.cli.arguments import Subcommand, examples
from kybflow.cli.output import echo
from kybflow.core.exit_codes import DRIVER_FAILED

EXAMPLES = examples(
    "kybflow ardrone join --ssid lab --address 192.168.1.11",
    "kybflow ardrone join --ssid lab --address 192.168.1.11 --write",
)


@click.group("ardrone", no_args_is_help=True)
def command() -> None:
    """Prepare an AR.Drone."""


@command.command("join", cls=Subcommand, epilog=EXAMPLES)
@click.option("--ssid", required=True, help="The network to join; an open one, without WPA.")
@click.option("--address", required=True, help="The address that the drone is to have there.")
@click.option("--netmask", default="255.255.255.0", help="The network's mask.")
@click.option("--drone", default="192.168.1.1", help="Where the drone is now.")
@click.option("--write", is_flag=True, help="Do it; else it is only shown.")
def join(ssid: str, address: str, netmask: str, drone: str, write: bool) -> None:
    """Take a drone from its own network into another, over its telnet shell.

    It stays there until it is switched off. Join the drone's own network first; shown is what is
    done there, and nothing is done without --write.
    """
    from kybflow.core.errors import DriverError
    from kybflow.drivers.ardrone.joining import TELNET, join_lines, run_lines

    try:
        lines = join_lines(ssid, address, netmask)
    except DriverError as error:
        raise click.UsageError(str(error)) from None
    if not write:
        echo(f"would be sent to {drone}, port {TELNET}:")
        for line in lines:
            echo(f"  {line}")
        echo("nothing is sent without --write")
        return
    try:
        run_lines(lines, drone, echo)
    except DriverError as error:
        echo(f"error: {error}", err=True)
        raise Exit(DRIVER_FAILED) from None
    echo(f"the drone joins `{ssid}` as {address}; join that network too")
