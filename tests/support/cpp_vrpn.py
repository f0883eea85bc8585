"""The C++ library of VRPN, inside the wheel `motioncapture`, as peers: a server and a client, each
a program of its own on this machine."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

HERE = Path(__file__).parent


@contextmanager
def cpp_server(port: int, *names: str) -> Iterator[subprocess.Popen[str]]:
    """The C++ library as a server."""
    program = [sys.executable, str(HERE / "cpp_vrpn_server.py"), str(port), *names]
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
            [sys.executable, str(HERE / "cpp_vrpn_client.py"), host],
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

    def __exit__(self, *error: object) -> None:
        self._process.kill()
        self._process.wait()
        self._thread.join()
        assert self._process.stdout is not None
        self._process.stdout.close()
