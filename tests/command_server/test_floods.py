"""Floods at the socket of a run that flies in real time: refused, counted, bounded, and no tick
comes later than without them."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import mean
from typing import Any, NamedTuple

import pytest
from plans import plan, vehicle
from short_flights import down, hold, named, path, up

from kybflow.api import flight
from kybflow.api.flight import RunRequest, fly
from kybflow.command_server.server import (
    CUT_OFF,
    REPORT_PERIOD,
    TOO_MANY,
    UNREADABLE,
    CommandServer,
)
from kybflow.core.signals import NS
from kybflow.runtime.clock import SimulatedClock
from kybflow.runtime.engine import Engine
from kybflow.runtime.vehicle.requests import Requester

FUZZ = """
import os, random, socket, sys
path, count = sys.argv[1], int(sys.argv[2])
draw = random.Random(1)
good = b'{"id": 1, "command": "switch a nowhere", "take": true}'
def message():
    kind = draw.randrange(4)
    if kind == 0:
        return draw.randbytes(draw.randrange(1, 200)).replace(b"\\n", b"")
    if kind == 1:
        return bytes(b ^ (draw.random() < 0.05) for b in good)
    if kind == 2:
        return b"[" * draw.randrange(1, 3000)
    return b'{"id": %d, "command": "%s"}' % (draw.randrange(9), b"x" * draw.randrange(1500))
def connected():
    one = socket.socket(socket.AF_UNIX)
    one.connect(path)
    return one
sent = refused = 0
try:
    while sent < count:
        one = connected()
        batch = [message() for _ in range(50)]
        batch = [line.replace(b"\\n", b" ") for line in batch if line.strip()]
        one.sendall(b"\\n".join(batch) + b"\\n")
        one.shutdown(socket.SHUT_WR)
        while data := one.recv(65536):
            refused += data.count(b"false")
        sent += len(batch)
        one.close()
except OSError as error:
    print(error)
print(sent, refused)
"""
CROWDED = """
import resource, socket, sys
resource.setrlimit(resource.RLIMIT_NOFILE, (2048, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
clients = []
for _ in range(int(sys.argv[2])):
    one = socket.socket(socket.AF_UNIX)
    one.connect(sys.argv[1])
    try:
        one.sendall(b'{"id": 1, "ask": "state"}\\n')
    except OSError:
        pass
    clients.append(one)
answered = 0
for one in clients:
    try:
        answered += b"state" in one.recv(100000)
    except OSError:
        pass
print(len(clients), answered)
"""
KILLED = """
import os, signal, socket, sys
one = socket.socket(socket.AF_UNIX)
one.connect(sys.argv[1])
one.sendall(b'{"id": 1, "command": "sto')
os.kill(os.getpid(), signal.SIGKILL)
"""


BUSY = """
end = time.monotonic() + 8
while time.monotonic() < end:
    pass
"""


LONGEST = 90.0
"""Seconds that a flight waits for its flood to end."""


class Flown(NamedTuple):
    """A flight beside a flood. late: by how many seconds each tick was."""

    told: list[Any]
    server: CommandServer
    late: list[float]
    said: str


class WatchedClock(SimulatedClock):
    """Notes how late each tick begins after it was due, s."""

    def __init__(self, rate: int, speed: float | None) -> None:
        super().__init__(rate, speed)
        self.late: list[float] = []

    def step(self) -> int:
        now = super().step()
        self.late.append(time.monotonic() - self._began - now / NS)
        return now


WAITS = """
import glob, os, sys, time
os.nice(10)
deadline = time.monotonic() + 60
while not (found := glob.glob(sys.argv[1] + "/kybflow/*.sock")) and time.monotonic() < deadline:
    time.sleep(0.05)
sys.argv[1] = found[0]
time.sleep(2)  # it opens its devices and takes off
"""


@contextmanager
def flood(base: Path, code: str, *words: str) -> Iterator[subprocess.Popen[str]]:
    """A program that begins before the flight, for to start one takes time from a tick."""
    words = (sys.executable, "-I", "-S", "-c", WAITS + code, str(base), *words)
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as program:
        try:
            yield program
        finally:
            program.kill()


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Flown]]:
    base = Path(tempfile.mkdtemp(dir="/tmp"))

    def beside(code: str, *words: str, seconds: float = 10.0) -> Flown:
        """Fly in real time for so many seconds, and on until the program beside it, which is given
        the socket, has ended."""
        clocks: list[WatchedClock] = []

        def clock_for(plan: Any, speed: float | None) -> WatchedClock:
            clocks.append(WatchedClock(plan.control_rate, speed))
            return clocks[0]

        server, told = CommandServer(), []
        flying = plan(vehicle("a", [up("hold"), hold(LONGEST, "down"), down()]), time_limit=120.0)
        request = RunRequest(out=tmp_path_factory.mktemp("floods") / "run", speed=1.0)
        with pytest.MonkeyPatch.context() as patch, flood(base, code, *words) as program:
            patch.setenv("XDG_RUNTIME_DIR", str(base))
            patch.setattr(flight, "clock_for", clock_for)

            def lands(engine: Engine) -> None:
                (own,) = engine.vehicles
                is_over = engine.seconds() > seconds and program.poll() is not None
                if is_over and own.state == "hold":
                    own.requests.switch("down", Requester.OPERATOR)

            flown = fly(flying, request, (told.append, server.on_event), (lands,), (server.serve,))
            assert program.poll() is not None, "the flood outlasted the flight"
            said = program.communicate()[0]
        assert flown.exit_code == 0, flown.summary["reason"]
        assert path(told, "a") == ["up", "hold", "down", "landed"]
        assert named(told, "observer_failed") == []
        return Flown(told, server, sorted(clocks[0].late), said)

    yield beside
    shutil.rmtree(base)


@pytest.fixture(scope="module")
def calm(beside: Callable[..., Flown]) -> Flown:
    """A flight beside a program that takes a processor's time and leaves the run alone."""
    return beside(BUSY)


def figures(name: str, flown: Flown) -> str:
    late = flown.late
    ranks = (late[len(late) // 2], late[int(0.99 * len(late))], late[-1])
    missed = sum(one > 1.0 / 250.0 for one in late)
    shown = " ".join(f"{1e3 * one:.2f}" for one in ranks)
    return f"{name}: {len(late)} ticks, late by {shown} ms (50 %, 99 %, most), {missed} missed"


def is_as_punctual(flood: Flown, calm: Flown) -> None:
    """No larger share of the ticks is missed than beside a busy program, but for what chance adds
    to either. The two flights last differently long."""
    flights = (flood, calm)
    shares = [mean(one > 1.0 / 250.0 for one in flown.late) for flown in flights]
    seen = figures("calm", calm), figures("flood", flood)
    assert shares[0] <= 2.0 * shares[1] + 0.005, "\n".join(seen)
    sys.stdout.write("\n".join((*seen, "")))


@pytest.mark.thorough
def test_fuzzed_messages(beside: Callable[..., Flown]) -> None:
    flown = beside(FUZZ, "10000")
    sent, refused = map(int, flown.said.split())
    assert sent >= 10_000
    counted = flown.server.refused
    assert counted[UNREADABLE] > 0.9 * sent
    assert refused >= counted[UNREADABLE]
    most = 2 + flown.told[-1].time / NS / REPORT_PERIOD
    assert 1 <= len(named(flown.told, "clients_refused")) <= most


@pytest.mark.thorough
def test_a_thousand_clients(beside: Callable[..., Flown]) -> None:
    flown = beside(CROWDED, "1000")
    clients, answered = map(int, flown.said.split())
    assert clients == 1000
    assert answered <= 64
    assert flown.server.refused[TOO_MANY] == clients - 64


@pytest.mark.slow
@pytest.mark.parametrize(("code", "count"), [(FUZZ, "100000"), (CROWDED, "1000")])
def test_a_flood_delays_no_more_than_a_busy_program(
    code: str, count: str, beside: Callable[..., Flown], calm: Flown
) -> None:
    """Beside other tests, which take the processors, the two flights can't be compared."""
    is_as_punctual(beside(code, count), calm)


@pytest.mark.thorough
def test_a_client_that_is_killed(beside: Callable[..., Flown]) -> None:
    flown = beside(KILLED, seconds=5.0)
    assert flown.server.refused == {CUT_OFF: 1}
    assert [event.fields["reason"] for event in named(flown.told, "clients_refused")] == [
        f"1 {CUT_OFF}"
    ]
