"""Wakes a thread that waits for sockets or pipes."""

from __future__ import annotations

import contextlib
import socket
import threading

CHUNK = 1 << 16
"""The most bytes that are read at once."""


class Waker:
    """Ends another thread's wait, and its work once `ended` is set."""

    def __init__(self) -> None:
        self.ended = threading.Event()
        self.ear, self._mouth = socket.socketpair()
        self.ear.setblocking(False)
        self._mouth.setblocking(False)

    def wake(self) -> None:
        with contextlib.suppress(OSError):  # full: it is awake already; closed: so is it
            self._mouth.send(b"\0")

    def end(self) -> None:
        self.ended.set()
        self.wake()

    def hush(self) -> None:
        """Forget every call so far."""
        with contextlib.suppress(OSError):
            self.ear.recv(CHUNK)

    def close(self) -> None:
        self.ear.close()
        self._mouth.close()
