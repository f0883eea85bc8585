"""What a link asks of its connection to a drone."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

from kybflow.core.signals import Time
from kybflow.drivers.ardrone.protocol.navdata.packet import Packet
from kybflow.drivers.ardrone.transport.gate import Gate
from kybflow.drivers.ardrone.transport.stream import CommandStream

AT, NAVDATA, VIDEO, CONTROL = 5556, 5554, 5555, 5559
"""The drone's ports."""
ASKS = b"\x01\x00\x00\x00"
"""What makes a drone send navigation data to who sent it."""
Arrived = tuple[Time, Packet]


class DroneWire(ABC):
    """The connection to one drone. `stream`: what is sent. `gate`: what is admitted. Faults set
    `deaf` and `mute`."""

    def __init__(self, clock: Callable[[], Time]) -> None:
        self.stream, self.gate = CommandStream(clock), Gate()
        self.deaf = self.mute = False

    @abstractmethod
    def poll(self, now: Time) -> None:
        """Let what is due happen, where no thread does it. now: the run's time."""

    @abstractmethod
    def take(self, now: Time) -> Sequence[Arrived]:
        """The packets since the last call, oldest first, each with the run's time at which it
        arrived. Raises DriverError."""

    @abstractmethod
    def ask(self) -> None:
        """Ask the drone for navigation data."""

    @abstractmethod
    def listen_for_configuration(self) -> None:
        """Open the connection on which the drone sends its configuration when it is asked to."""

    @abstractmethod
    def configuration(self) -> bytes | None:
        """The newest whole configuration, once; None where there is none."""

    @property
    @abstractmethod
    def trouble(self) -> str:
        """Why nothing can arrive; empty while nothing is known to be wrong."""

    @abstractmethod
    def close(self) -> None: ...
