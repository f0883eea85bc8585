"""MAVLink in datagrams."""

from __future__ import annotations

import socket
from typing import Any, ClassVar

from kybflow.core.signals import Time
from kybflow.drivers.mavlink.transport.address import Address
from kybflow.drivers.mavlink.transport.pipe import listening, said, target
from kybflow.drivers.mavlink.transport.wire import Received, Wire

MOST_AT_ONCE = 1000
MOST_BYTES = 1 << 16
"""What is taken in one poll, in datagrams and in bytes, so that a flood can't hold up a tick."""
LONGEST = 65536
ROOM = 1 << 20
"""Bytes that the system keeps for us while a tick is late."""


class _Udp(Wire):
    """One socket for datagrams, and what was last wrong with it."""

    def __init__(self, address: Address, opened: socket.socket) -> None:
        super().__init__(str(address))
        self._socket = opened
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, ROOM)
        self._trouble: str | None = None

    def trouble(self) -> str | None:
        return self._trouble

    def close(self) -> None:
        self._socket.close()


class UdpIn(_Udp):
    """Waits for datagrams, and answers whoever sent them; several vehicles may come to one port.
    `port`: where it listens."""

    answers: ClassVar[bool] = True

    def __init__(self, address: Address) -> None:
        """Raises DriverError."""
        super().__init__(address, listening(address, socket.SOCK_DGRAM))
        self.port: int = self._socket.getsockname()[1]
        self._newest: Any = None

    def _receive(self, now: Time) -> Received:
        came: list[tuple[bytes, Any]] = []
        left = MOST_BYTES
        try:
            while left > 0 and len(came) < MOST_AT_ONCE:
                came.append(self._socket.recvfrom(LONGEST))
                left -= len(came[-1][0])
        except BlockingIOError:
            pass
        except OSError as error:
            self._trouble = f"{self.address}: {said(error)}"
        if came:
            self._newest, self._trouble = came[-1][1], None
        return came

    def _send(self, data: bytes, to: Any) -> None:
        """To the newest sender where nobody is named; to nobody before one was heard."""
        if (to := to or self._newest) is None:
            return
        try:
            self._socket.sendto(data, to)
        except BlockingIOError:
            pass  # no room: lost, as any datagram may be
        except OSError as error:
            self._trouble = f"{self.address}: {said(error)}"


class UdpOut(_Udp):
    """Sends datagrams to one place, and hears what comes back from there alone."""

    def __init__(self, address: Address) -> None:
        """Raises DriverError."""
        super().__init__(address, socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        self._socket.setblocking(False)
        self._socket.connect(target(address))

    def _receive(self, now: Time) -> Received:
        came: list[tuple[bytes, Any]] = []
        left = MOST_BYTES
        for _ in range(MOST_AT_ONCE):
            try:
                came.append((self._socket.recv(LONGEST), None))
                left -= len(came[-1][0])
            except BlockingIOError:
                break
            except OSError as error:  # that nobody listens there, after something was sent
                self._trouble = f"{self.address}: {said(error)}"
            if left <= 0:
                break
        if came:
            self._trouble = None
        return came

    def _send(self, data: bytes, to: Any) -> None:
        for _ in range(2):  # the first may fail for what was sent before
            try:
                self._socket.send(data)
            except BlockingIOError:
                return
            except OSError as error:
                self._trouble = f"{self.address}: {said(error)}"
            else:
                return
