"""A socket that wakes a thread waiting in a selector."""

from __future__ import annotations

import contextlib
import socket
import threading

CHUNK = 1 << 16
"""Largest number of bytes to read at once."""


class Waker:
    """Ends another thread's wait on `receiver`. ended: set when the thread must stop."""

    def __init__(self) -> None:
        self.ended = threading.Event()
        self.receiver, self._sender = socket.socketpair()
        self.receiver.setblocking(False)
        self._sender.setblocking(False)

    def wake(self) -> None:
        with contextlib.suppress(OSError):  # full or closed: the thread is awake already
            self._sender.send(b"\0")

    def end(self) -> None:
        self.ended.set()
        self.wake()

    def drain(self) -> None:
        """Discard all wake-ups so far."""
        with contextlib.suppress(OSError):
            self.receiver.recv(CHUNK)

    def close(self) -> None:
        self.receiver.close()
        self._sender.close()
