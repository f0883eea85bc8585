"""Peers on loopback for the tests of VRPN, and waiting for them with a deadline."""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

HERE = Path(__file__).parent
PATIENCE = 60.0
"""Seconds after which a peer that does nothing has failed; never waited for in full."""


def until(condition: Callable[[], bool], what: str) -> None:
    """Wait for it."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, f"waited {PATIENCE:g} s in vain: {what}"
        time.sleep(0.002)


def free_port() -> int:
    """A port on which nobody listens, neither by TCP nor by datagrams."""
    with socket.socket() as stream, socket.socket(type=socket.SOCK_DGRAM) as datagrams:
        stream.bind(("127.0.0.1", 0))
        port: int = stream.getsockname()[1]
        datagrams.bind(("127.0.0.1", port))
        return port


@contextmanager
def cpp_server(port: int, *names: str) -> Iterator[subprocess.Popen[str]]:
    """The C++ library as a server."""
    program = [sys.executable, str(HERE / "cpp_server.py"), str(port), *names]
    with subprocess.Popen(
        program, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield process
        finally:
            process.kill()


class CppClient:
    """The C++ library as a client: `lines` is what it saw, (name, seven numbers)."""

    def __init__(self, host: str) -> None:
        self.lines: list[tuple[str, tuple[float, ...]]] = []
        self._process = subprocess.Popen(
            [sys.executable, str(HERE / "cpp_client.py"), host],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            name, *numbers = line.split()
            self.lines.append((name, tuple(map(float, numbers))))

    def __enter__(self) -> CppClient:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._process.kill()
        self._process.wait()
        self._thread.join()
        assert self._process.stdout is not None
        self._process.stdout.close()
