"""Options, discovery and descriptions shared by the commands of `kybflow mavlink`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Exit, Option

from kybflow.cli.arguments import refusing
from kybflow.cli.output import echo
from kybflow.core.errors import DRIVER_FAILED

if TYPE_CHECKING:
    from kybflow.core.signals import Time
    from kybflow.drivers.mavlink.discovery import Discovery
    from kybflow.drivers.mavlink.telemetry.received_status import ReceivedStatus

RATE = 100

OwnSystem = Annotated[
    int, Option(min=1, max=255, help="The system id of this program, as in the mission.")
]
Key = Annotated[Path | None, Option(help="File with the secret of signed messages.")]


def ticks() -> Iterator[Time]:
    """Yield the time of each tick in real time."""
    from kybflow.runtime.clock import WallClock

    clock = WallClock(RATE)
    while True:
        yield clock.step()


@contextmanager
def meeting(
    address: str,
    system: int | None,
    own_system: int,
    key: Path | None,
    note: Callable[[], str] = str,
) -> Iterator[Discovery]:
    """Open the discovery of autopilots at an address. A failure ends the command with a message.
    note: returns text to append to the message."""
    from kybflow.core.errors import DriverError
    from kybflow.drivers.mavlink.protocol.signing import read_key
    from kybflow.drivers.mavlink.transport.wire import read_address

    with refusing("--key", DriverError):
        secret = None if key is None else read_key(key)
    with refusing("--address", DriverError):
        place = read_address(address)
    try:
        from kybflow.drivers.mavlink.discovery import Discovery
        from kybflow.drivers.mavlink.transport.sockets import open_wire

        with closing(open_wire(place)) as wire:
            yield Discovery(wire, system, own_system, secret)
    except DriverError as error:
        echo(f"error: {error}{note()}", err=True)
        raise Exit(DRIVER_FAILED) from None


def described(status: ReceivedStatus) -> str:
    """Describe an autopilot by firmware, mode and arming."""
    from kybflow.drivers.mavlink.firmware import firmware_by, profile_of

    name = firmware_by(status.autopilot)
    arming = "armed" if status.armed else "disarmed"
    if name is None:
        return f"an unsupported autopilot (MAV_AUTOPILOT {status.autopilot}), {arming}"
    mode = "unknown mode" if status.mode is None else profile_of(name).mode_name(status.mode)
    return f"{name}, {mode}, {arming}"
