"""Waiting for other threads and programs: for what they do, never for a time."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from typing import Any

HANGS = 300.0
"""Seconds after which what doesn't come never will; never waited for in full."""


def until(condition: Callable[[], Any], what: str) -> None:
    """Return as soon as `condition` holds; fail, saying `what` was waited for, where it hangs."""
    deadline = time.monotonic() + HANGS
    while not condition():
        assert time.monotonic() < deadline, f"waited {HANGS:g} s in vain: {what}"
        time.sleep(0.002)


def free_port() -> int:
    """A port of this machine on which nobody listens, neither by TCP nor by datagrams."""
    with socket.socket() as stream, socket.socket(type=socket.SOCK_DGRAM) as datagrams:
        stream.bind(("127.0.0.1", 0))
        port: int = stream.getsockname()[1]
        datagrams.bind(("127.0.0.1", port))
        return port
