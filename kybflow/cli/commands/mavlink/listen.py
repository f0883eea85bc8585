"""`kybflow mavlink listen`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

from typer import Option

from kybflow.cli.arguments import quantity, wrong
from kybflow.cli.commands.mavlink import meeting
from kybflow.cli.output import echo
from kybflow.core.units import DURATION

if TYPE_CHECKING:
    from kybflow.core.signals import Time
    from kybflow.drivers.mavlink.discovery import Discovery

MAX_LISTENING_S = 3600
MOST_TEXTS = 3
"""The most status texts printed per autopilot, newest last."""


def command(
    address: Annotated[str, Option(help="Address to listen at, such as udpin:127.0.0.1:14540.")],
    lasts: Annotated[str, Option("--for", metavar="TIME", help="How long.")] = "5s",
    own_system: meeting.OwnSystem = 245,
    key: meeting.Key = None,
) -> None:
    """List the autopilots at an address.

    \b
    Exit codes:
    0: there is an autopilot.
    2: the command line is invalid.
    3: there is none.

    \b
    Examples:
      kybflow mavlink listen --address udpin:127.0.0.1:14540
      kybflow mavlink listen --address serial:/dev/ttyUSB0:57600 --for 20s
    """
    from kybflow.core.signals import NS

    seconds = quantity(lasts, DURATION, "--for")
    if not 0.0 < seconds <= MAX_LISTENING_S:
        raise wrong("--for", f"`{lasts}` is not between 0 s and {MAX_LISTENING_S} s")
    with meeting.meeting(address, None, own_system, key) as discovery:
        listen_to(discovery, meeting.ticks(), round(seconds * NS))


def listen_to(discovery: Discovery, steps: Iterator[Time], lasts: Time) -> None:
    """Print a line for each autopilot. Raises DriverError if there is none."""
    discovery.watch(steps, lasts)
    for system in discovery.found():
        status = discovery.statuses[system]
        echo(f"system {system}: {meeting.described(status)}")
        for newest in list(status.texts)[-MOST_TEXTS:]:
            echo(f"    status text: {newest.text}")
