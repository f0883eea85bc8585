"""A command server whose tick is played by a thread, and clients that speak bytes to it."""

from __future__ import annotations

import json
import shutil
import socket
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from waiting import until

from kybflow.command_server.client import RunClient
from kybflow.command_server.server import CommandServer
from kybflow.runtime.commanding.command_queue import (
    ClientDisconnected,
    ClientsRefused,
    CommandQueue,
    GivenCommand,
    Question,
    ServerFailure,
)
from kybflow.runtime.commanding.orders import Answer
from kybflow.runtime.commanding.situation import Situation

CALM = Situation("eight", 1.5, True, None, (), (), {})


class Served:
    """A run without vehicles: every command is accepted, in ticks of a thread or, where it has
    none, of `tick`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.server, self.queue = CommandServer(), CommandQueue()
        self.given: list[GivenCommand] = []
        self.gone: list[str] = []
        self.told: list[str] = []
        self.failed: list[str] = []
        self.path = Path()

    def tick(self) -> None:
        while self.queue.waiting:
            match self.queue.waiting.popleft():
                case GivenCommand() as given:
                    self.given.append(given)
                    given.answered(Answer(True))
                case Question(shown):
                    shown(CALM)
                case ClientDisconnected(by):
                    self.gone.append(by)
                case ClientsRefused(reason):
                    self.told.append(reason)
                case ServerFailure(reason):
                    self.failed.append(reason)

    def client(self, name: str = "anna", *, keeps_lease: bool = False) -> RunClient:
        return RunClient(self.path, name, keeps_lease=keeps_lease)

    def raw(self) -> Raw:
        return Raw(self.path)

    def until_refused(self, what: str, count: int) -> None:
        until(lambda: self.server.refused[what] >= count, f"{count} {what}")


class Raw:
    """A client that speaks bytes."""

    def __init__(self, path: Path) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.connect(str(path))
        self.socket.settimeout(60)
        self._file = self.socket.makefile("rb")

    def send(self, data: bytes) -> Raw:
        self.socket.sendall(data)
        return self

    def read(self) -> dict[str, Any] | None:
        """The next message, None at the end."""
        try:
            line = self._file.readline()
        except ConnectionResetError:
            return None
        return json.loads(line) if line else None

    def close(self) -> None:
        self._file.close()
        self.socket.close()


@contextmanager
def served(setenv: Callable[[str, str], None], *, ticks: bool = True) -> Iterator[Served]:
    """Serve a run in a runtime folder of its own."""
    base = Path(tempfile.mkdtemp(dir="/tmp"))
    setenv("XDG_RUNTIME_DIR", str(base))
    folder = base / "eight-1"
    folder.mkdir()
    run, over = Served(folder), threading.Event()

    def tick() -> None:
        while not over.wait(0.001):
            run.tick()

    thread = threading.Thread(target=tick)
    try:
        with run.server.serve(run.queue, folder) as path:
            run.path = path
            if ticks:
                thread.start()
            try:
                yield run
            finally:
                run.queue.close()
                over.set()
                if ticks:
                    thread.join()
    finally:
        shutil.rmtree(base)
