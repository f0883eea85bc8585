"""MAVLink over a serial line: a cable or a telemetry radio. The only user of pyserial."""

from __future__ import annotations

import os
from errno import EACCES, EAGAIN, EBUSY, ENOENT
from typing import Any

from kybflow.core.errors import DriverError
from kybflow.drivers.mavlink.transport.address import Address
from kybflow.drivers.mavlink.transport.wire import Pipe, ReopeningWire, os_error

_WAYS_OUT = {
    ENOENT: "there is no such device: is it plugged in?",
    EACCES: "no permission: join the group that owns it, as `dialout`, and log in again",
    EAGAIN: "another program has it: close it",
    EBUSY: "another program has it: close it",
}


class SerialLine(ReopeningWire):
    """Opened again when it was unplugged."""

    def __init__(self, address: Address) -> None:
        """Raises DriverError where pyserial is missing."""
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
        except ValueError as error:  # a baud rate that the line can't have
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

    def _words(self, error: OSError) -> str:
        return _WAYS_OUT.get(error.errno or 0, os_error(error))
