"""`kybflow mavlink listen`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

from typer import BadParameter, Option

from kybflow.cli.arguments import duration
from kybflow.cli.commands.mavlink import meeting
from kybflow.cli.output import echo

if TYPE_CHECKING:
    from kybflow.core.signals import Time
    from kybflow.drivers.mavlink.discovery import Discovery

LONGEST = 3600
SHOWN = 3
"""Of what an autopilot said, the newest."""


def patience(text: str) -> float:
    """How long to listen, seconds."""
    seconds = duration(text)
    if not 0.0 < seconds <= LONGEST:
        raise BadParameter(f"`{text}` is not within 0 s to {LONGEST} s")
    return seconds


def command(
    address: Annotated[str, Option(help="Where to listen, such as udpin:127.0.0.1:14540.")],
    lasts: Annotated[
        float, Option("--for", parser=patience, metavar="TIME", help="How long, such as 5s.")
    ] = 5.0,
    own_system: meeting.OwnSystem = 245,
    key: meeting.Key = None,
) -> None:
    """Say which autopilots are heard at an address.

    \b
    Exit codes:
    0: at least one is heard.
    2: the command line is invalid.
    3: none is.

    \b
    Examples:
      kybflow mavlink listen --address udpin:127.0.0.1:14540
      kybflow mavlink listen --address serial:/dev/ttyUSB0:57600 --for 20s
    """
    from kybflow.core.signals import NS

    with meeting.meeting(address, None, own_system, key) as discovery:
        listen_to(discovery, meeting.ticks(), round(lasts * NS))


def listen_to(discovery: Discovery, steps: Iterator[Time], patience: Time) -> None:
    """Print a line for each autopilot that is heard. Raises DriverError where none is."""
    discovery.watch(steps, patience)
    for system in discovery.found():
        status = discovery.statuses[system]
        echo(f"system {system}: {meeting.described(status)}")
        for said in list(status.texts)[-SHOWN:]:
            echo(f"    it says: {said.text}")
