"""One drone over the network: UDP for commands and navigation data, TCP for the configuration.

A thread sends at a fixed rate and receives in between, a bounded number of datagrams per period, so
that a flood can't delay it further. It passes accepted packets to the tick as immutable values. The
system assigns the local ports, so any number of drones can share a computer.
"""

from __future__ import annotations

import os
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from ipaddress import AddressValueError, IPv4Address

from kybflow.core.errors import DriverError, described
from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.at import END, MAX_CONFIGURATION
from kybflow.drivers.ardrone.wire import AT, CONTROL, NAVDATA, NAVDATA_REQUEST, Arrived, DroneWire

MAX_DATAGRAM = 8192
MOST_PER_PERIOD = 64
"""Largest number of datagrams received per period; 25 Hz of commands and 200 Hz of data make 8."""
BUFFER = 1 << 17
"""Size of the socket's receive buffer, bytes."""
MOST_HELD = 4096
RECONNECT_PAUSE: Time = NS
"""Pause between two attempts to connect."""


def is_address(text: str) -> bool:
    try:
        IPv4Address(text)
    except AddressValueError:
        return False
    return True


class UdpWire(DroneWire):
    """A connection with a thread, which runs until `close`. rate: of the commands, Hz. clock: the
    time by which commands age, ns."""

    def __init__(
        self, host: str, rate: float, clock: Callable[[], Time] = time.monotonic_ns
    ) -> None:
        """Open the sockets and start the thread. Raises DriverError."""
        super().__init__(clock)
        self._host, self._clock, self._period = host, clock, round(NS / rate)
        self._arrived: deque[Arrived] = deque(maxlen=MOST_HELD)
        self._file: bytes | None = None
        self._taken: Time = 0
        self._failure: str | None = None
        self._over = False
        self._commands, self._data = _socket(host), _socket(host)
        self._control = _ControlChannel(host)
        self._thread = threading.Thread(target=self._run, name=f"ardrone {host}", daemon=True)
        self._thread.start()

    def poll(self, now: Time) -> None:
        """Do nothing: the thread sends and receives."""

    def take(self, now: Time) -> Sequence[Arrived]:
        if self._failure is not None:
            raise DriverError(f"the connection to {self._host} has ended: {self._failure}")
        offset, taken = now - self._clock(), []
        while self._arrived:
            at, packet = self._arrived.popleft()
            self._taken = max(self._taken + 1, min(now, at + offset))
            taken.append((self._taken, packet))
        return taken

    def ask(self) -> None:
        if not self.mute:
            self._send(self._data, NAVDATA_REQUEST, NAVDATA)

    def listen_for_configuration(self) -> None:
        self._control.wanted = True

    def configuration(self) -> bytes | None:
        found, self._file = self._file, None
        return found

    def close(self) -> None:
        self._over = True
        self._thread.join(2.0)
        self._control.close()
        self._commands.close()
        self._data.close()

    def _run(self) -> None:
        """Run the thread; `take` raises DriverError after an exception here."""
        try:
            self._serve()
        except Exception as error:
            self._failure = described(error)

    def _serve(self) -> None:
        due = self._clock()
        while not self._over:
            now = self._clock()
            if now >= due:
                for data in self.stream.due():
                    if not self.mute:
                        self._send(self._commands, data, AT)
                due = due + self._period if now - due < self._period else now + self._period
            self._receive(due)
            found = self._control.poll(now)
            self._file = found or self._file

    def _receive(self, due: Time) -> None:
        """Receive until `due`, at most `MOST_PER_PERIOD` datagrams."""
        for _ in range(MOST_PER_PERIOD):
            waits = max(0, due - self._clock()) / NS
            if not select.select((self._data,), (), (), waits)[0]:
                return
            try:
                data, sender = self._data.recvfrom(MAX_DATAGRAM)
            except OSError as error:
                self.trouble = _words(error)
                continue
            if self.deaf:
                continue
            now = self._clock()
            packet = self.gate.admit(data, sender == (self._host, NAVDATA), now)
            if packet is not None:
                self.trouble = ""
                self._arrived.append((now, packet))
        time.sleep(max(0, due - self._clock()) / NS)

    def _send(self, through: socket.socket, data: bytes, port: int) -> None:
        try:
            through.sendto(data, (self._host, port))
        except OSError as error:
            self.trouble = _words(error)


class _ControlChannel:
    """The TCP connection that receives configurations; it is reopened when it is lost. Only the
    thread of the wire uses it, except for `wanted`."""

    def __init__(self, host: str) -> None:
        self.wanted = False
        self._host = host
        self._socket: socket.socket | None = None
        self._data = b""
        self._next: Time = 0

    def poll(self, now: Time) -> bytes | None:
        """Receive without blocking. Return a configuration that is complete now, or None."""
        if not self.wanted:
            return None
        if self._socket is None:
            if now >= self._next:
                self._next = now + RECONNECT_PAUSE
                self._socket, self._data = _socket(self._host, socket.SOCK_STREAM), b""
                self._socket.connect_ex((self._host, CONTROL))
            return None
        try:
            data = self._socket.recv(MAX_CONFIGURATION)
        except BlockingIOError:
            return None
        except OSError:
            data = b""
        if not data or len(self._data) > MAX_CONFIGURATION:
            self.close()
            return None
        whole, end, rest = (self._data + data).rpartition(END)
        self._data = rest
        return whole.rpartition(END)[2] if end else None

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


def _socket(host: str, kind: socket.SocketKind = socket.SOCK_DGRAM) -> socket.socket:
    try:
        opened = socket.socket(socket.AF_INET, kind)
        opened.setblocking(False)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        if kind is socket.SOCK_DGRAM:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                probe.connect((host, AT))  # finds this computer's address in the drone's network
                opened.bind((probe.getsockname()[0], 0))
    except OSError as error:
        raise DriverError(f"no socket for the drone at {host}: {_words(error)}") from None
    return opened


def _words(error: OSError) -> str:
    return os.strerror(error.errno).lower() if error.errno else str(error).lower()
