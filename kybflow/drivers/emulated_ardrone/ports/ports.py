"""What an emulated drone asks of its ports."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence


class Ports(ABC):
    """The ports of one drone. None of them waits."""

    @abstractmethod
    def commands(self) -> Sequence[tuple[bytes, Hashable]]:
        """The datagrams at the port for AT commands since the last call, each with its sender."""

    @abstractmethod
    def requests(self) -> Sequence[tuple[bytes, Hashable]]:
        """The same at the port for navigation data."""

    @abstractmethod
    def answer(self, sender: Hashable) -> bool:
        """Send navigation data to that sender from now on; whether it is one to be sent to."""

    @abstractmethod
    def send(self, data: bytes) -> None:
        """Send a packet of navigation data."""

    @abstractmethod
    def send_configuration(self, data: bytes) -> None:
        """Send the configuration to who is connected for it."""

    @property
    @abstractmethod
    def is_watched(self) -> bool:
        """Whether somebody is connected for video."""

    @abstractmethod
    def send_video(self, data: bytes) -> None:
        """Send a picture to who watches; one who is behind gets none of it."""

    @abstractmethod
    def close(self) -> None: ...
