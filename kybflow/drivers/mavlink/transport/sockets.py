"""Wires over sockets and serial lines: UDP in both directions, a TCP client and a serial line that
are reopened when the connection is lost, and a TCP server for several clients."""

from __future__ import annotations

import os
import socket
from abc import abstractmethod
from collections.abc import Callable, Mapping
from errno import EACCES, EAGAIN, EBUSY, EINPROGRESS, ENOENT
from typing import Any, ClassVar

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.transport.wire import Address, Received, Wire, read_address

MOST_AT_ONCE = 1000
MOST_BYTES = 1 << 16
"""The largest numbers of datagrams and bytes read in one poll, so that a flood can't delay a
tick."""
MAX_DATAGRAM = 65536
BUFFER_BYTES = 1 << 20
"""The bytes that the operating system buffers while a tick is late."""


def os_error(error: OSError) -> str:
    """Return a short description of a system error."""
    return os.strerror(error.errno).lower() if error.errno else str(error).lower()


def resolved(address: Address) -> tuple[str, int]:
    """Return the IP address and port of an address. Raises DriverError."""
    try:
        found = socket.getaddrinfo(address.place, address.number, socket.AF_INET)
    except OSError as error:
        raise DriverError(f"`{address}`: no host `{address.place}`: {error.strerror}") from error
    host, port = found[0][4][:2]
    return str(host), int(port)


def listener(address: Address, kind: socket.SocketKind) -> socket.socket:
    """Return a bound, non-blocking socket. Raises DriverError."""
    place = resolved(address)
    opened = socket.socket(socket.AF_INET, kind)
    opened.setblocking(False)
    if kind == socket.SOCK_STREAM:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        opened.bind(place)
    except OSError as error:
        opened.close()
        raise DriverError(
            f"can't listen at `{address}`: {os_error(error)}; is a ground station or another run"
            " there? Close it, or take another port"
        ) from error
    return opened


class _Udp(Wire):
    """A wire over one UDP socket; keeps the socket's last error. `_newest`: the newest sender."""

    def __init__(self, address: Address, opened: socket.socket) -> None:
        super().__init__(str(address))
        self._socket = opened
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        self._trouble: str | None = None
        self._newest: Any = None

    def trouble(self) -> str | None:
        return self._trouble

    def close(self) -> None:
        self._socket.close()

    def receive(self, now: Time) -> Received:
        came: list[tuple[bytes, Any]] = []
        left = MOST_BYTES
        for _ in range(MOST_AT_ONCE):
            try:
                came.append(self._socket.recvfrom(MAX_DATAGRAM))
                left -= len(came[-1][0])
            except BlockingIOError:
                break
            except OSError as error:  # such as that nobody listens there, as ICMP reports
                self._trouble = f"{self.address}: {os_error(error)}"
            if left <= 0:
                break
        if came:
            self._newest, self._trouble = came[-1][1], None
        return came


class UdpIn(_Udp):
    """Waits for datagrams and answers their senders; several vehicles may use one port. `port`: the
    port on which it listens."""

    answers: ClassVar[bool] = True

    def __init__(self, address: Address) -> None:
        """Open the socket. Raises DriverError."""
        super().__init__(address, listener(address, socket.SOCK_DGRAM))
        self.port: int = self._socket.getsockname()[1]

    def send(self, data: bytes, to: Any = None) -> None:
        """Send to `to`, or to the newest sender if it is None."""
        if (to := to or self._newest) is None:
            return
        try:
            self._socket.sendto(data, to)
        except BlockingIOError:
            pass  # no room: lost, as any datagram may be
        except OSError as error:
            self._trouble = f"{self.address}: {os_error(error)}"


class UdpOut(_Udp):
    """Sends datagrams to one address, and receives from there only."""

    def __init__(self, address: Address) -> None:
        """Open the socket. Raises DriverError."""
        super().__init__(address, socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        self._socket.setblocking(False)
        self._socket.connect(resolved(address))

    def send(self, data: bytes, to: Any = None) -> None:
        for _ in range(2):  # the first call may report an earlier failure
            try:
                self._socket.send(data)
            except BlockingIOError:
                return
            except OSError as error:
                self._trouble = f"{self.address}: {os_error(error)}"
            else:
                return


FIRST_RETRY_NS: Time = NS // 4
LAST_RETRY_NS: Time = 2 * NS
"""The first and the longest pause between two attempts to open; the pause doubles each time."""
OPENING_TIMEOUT_NS: Time = 3 * NS
"""How long an attempt to open may last."""


class Pipe:
    """A non-blocking connection for bytes.

    read: takes the largest number of bytes to read, and returns b"" if none have arrived.
    write: returns how many bytes it took.
    Both raise OSError if the connection is lost.

    A partly sent frame is finished first; frames written in the meantime are lost, since a late
    setpoint is worse than none.
    """

    def __init__(self, read: Callable[[int], bytes], write: Callable[[bytes], int]) -> None:
        self._read, self._write = read, write
        self._rest = b""

    def read(self) -> bytes:
        self._flush()
        return self._read(MOST_BYTES)

    def write(self, data: bytes) -> None:
        self._flush()
        if not self._rest:
            taken = self._write(data)
            self._rest = data[taken:] if taken else b""

    def _flush(self) -> None:
        if self._rest:
            self._rest = self._rest[self._write(self._rest) :]


def socket_pipe(opened: socket.socket) -> Pipe:
    """Return a pipe over a connected socket."""

    def read(most: int) -> bytes:
        try:
            data = opened.recv(most)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionResetError("the other end closed it")
        return data

    def write(data: bytes) -> int:
        try:
            return opened.send(data)
        except BlockingIOError:
            return 0

    return Pipe(read, write)


class ReopeningWire(Wire):
    """A connection that is reopened when it is lost, with growing pauses."""

    _ways_out: ClassVar[Mapping[int, str]] = {}
    """What to say and to advise instead of the system's own words, by `errno`."""

    def __init__(self, address: Address) -> None:
        super().__init__(str(address))
        self._pipe: Pipe | None = None
        self._trouble: str | None = f"{address}: not open yet"
        self._began: Time | None = None
        self._next: Time | None = None
        self._pause: Time = FIRST_RETRY_NS
        self._now: Time = 0

    def trouble(self) -> str | None:
        return self._trouble

    def close(self) -> None:
        self._pipe = None
        self._end()

    def receive(self, now: Time) -> Received:
        self._now = now
        try:
            pipe = self._pipe or self._open(now)
            data = pipe.read() if pipe is not None else b""
        except OSError as error:
            self._lost(error)
            return ()
        if data:
            self._pause = FIRST_RETRY_NS
        return ((data, None),) if data else ()

    def send(self, data: bytes, to: Any = None) -> None:
        if self._pipe is None:
            return
        try:
            self._pipe.write(data)
        except OSError as error:
            self._lost(error)

    def _open(self, now: Time) -> Pipe | None:
        if self._began is None:
            if self._next is not None and now < self._next:
                return None
            self._began = now
            self._begin()
        self._pipe = self._opened()
        if self._pipe is not None:
            self._trouble = None
        elif now > self._began + OPENING_TIMEOUT_NS:
            raise TimeoutError("no answer")
        return self._pipe

    def _lost(self, error: OSError) -> None:
        words = self._ways_out.get(error.errno or 0) or os_error(error)
        self._trouble = f"{self.address}: {words}"
        self._pipe = self._began = None
        self._next = self._now + self._pause
        self._pause = min(2 * self._pause, LAST_RETRY_NS)
        self._end()

    @abstractmethod
    def _begin(self) -> None:
        """Begin to open the connection. Raises OSError."""

    @abstractmethod
    def _opened(self) -> Pipe | None:
        """Return the opened connection, or None while it is being opened. Raises OSError."""

    @abstractmethod
    def _end(self) -> None:
        """Close the connection, if it is open."""


MOST_CLIENTS = 32


class TcpClient(ReopeningWire):
    """Connects to a server, and reconnects when the connection is lost."""

    def __init__(self, address: Address) -> None:
        """Resolve the host. Raises DriverError if it is unknown."""
        super().__init__(address)
        self._place = resolved(address)
        self._socket: socket.socket | None = None

    def _begin(self) -> None:
        self._socket = _quick(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
        failed = self._socket.connect_ex(self._place)
        if failed not in {0, EINPROGRESS}:
            raise OSError(failed, "")

    def _opened(self) -> Pipe | None:
        if self._socket is None:
            return None
        if failed := self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            raise OSError(failed, "")
        try:
            self._socket.getpeername()
        except OSError:
            return None
        return socket_pipe(self._socket)

    def _end(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class TcpServer(Wire):
    """Accepts connections. `port`: the port on which it listens."""

    answers: ClassVar[bool] = True

    def __init__(self, address: Address) -> None:
        """Begin to listen. Raises DriverError."""
        super().__init__(str(address))
        self._listener = listener(address, socket.SOCK_STREAM)
        self._listener.listen(MOST_CLIENTS)
        self.port: int = self._listener.getsockname()[1]
        self._clients: dict[tuple[str, int], tuple[socket.socket, Pipe]] = {}

    def trouble(self) -> str | None:
        return None

    def close(self) -> None:
        self._listener.close()
        for sender in list(self._clients):
            self._drop(sender)

    def is_open(self, sender: Any) -> bool:
        return sender in self._clients

    def receive(self, now: Time) -> Received:
        while len(self._clients) < MOST_CLIENTS:
            try:
                client, sender = self._listener.accept()
            except OSError:  # no client, or it has already gone
                break
            self._clients[sender] = (_quick(client), socket_pipe(client))
        came: list[tuple[bytes, Any]] = []
        for sender, (_, pipe) in list(self._clients.items()):
            try:
                if data := pipe.read():
                    came.append((data, sender))
            except OSError:
                self._drop(sender)
        return came

    def send(self, data: bytes, to: Any = None) -> None:
        """Send to `to`, or to every client if it is None."""
        for sender in list(self._clients) if to is None else [to]:
            if sender not in self._clients:
                continue
            try:
                self._clients[sender][1].write(data)
            except OSError:
                self._drop(sender)

    def _drop(self, sender: Any) -> None:
        self._clients.pop(sender)[0].close()


def _quick(opened: socket.socket) -> socket.socket:
    """Make a socket non-blocking, and disable Nagle's algorithm, which would delay frames."""
    opened.setblocking(False)
    opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return opened


class SerialLine(ReopeningWire):
    """A serial cable or a telemetry radio; reopened after it was unplugged."""

    _ways_out: ClassVar[Mapping[int, str]] = {
        ENOENT: "there is no such device: is it plugged in?",
        EACCES: "no permission: join the group that owns it, such as `dialout`, and log in again",
        EAGAIN: "another program is using it: close that program",
        EBUSY: "another program is using it: close that program",
    }

    def __init__(self, address: Address) -> None:
        """Prepare the line without opening it. Raises DriverError if pyserial is missing."""
        super().__init__(address)
        try:
            import serial
        except ImportError as error:
            raise DriverError(
                f"`{address}` needs pyserial: pip install 'kybflow[mavlink]'"
            ) from error
        self._line: Any = serial.Serial(
            baudrate=address.number, timeout=0, write_timeout=0, exclusive=True
        )
        self._line.port = address.place

    def _begin(self) -> None:
        try:
            self._line.open()
        except ValueError as error:  # a baud rate that the device doesn't support
            raise OSError(str(error)) from error

    def _opened(self) -> Pipe | None:
        return Pipe(self._line.read, self._write)

    def _write(self, data: bytes) -> int:
        try:
            return os.write(self._line.fileno(), data)
        except BlockingIOError:
            return 0

    def _end(self) -> None:
        self._line.close()


def open_wire(address: str | Address) -> Wire:
    """Open the wire to an address. Raises DriverError if it cannot work: a port in use, an unknown
    host, pyserial missing. A device or simulator that may still appear is reported by `trouble`
    instead."""
    place = read_address(address) if isinstance(address, str) else address
    kinds: dict[str, Callable[[Address], Wire]] = {
        "tcp": TcpClient, "tcpin": TcpServer, "udpin": UdpIn, "udpout": UdpOut,
        "serial": SerialLine,
    }  # fmt: skip
    return kinds[place.kind](place)
