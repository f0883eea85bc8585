"""Processes that fly cases, each one at a time: one that dies takes no other flight with it.

Flights to fly come down the line of a worker, what became of them goes up. A line that closes ends
its worker, so that none outlives its session: what flies then lands, as after Ctrl-C.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe, wait
from queue import SimpleQueue

from kybflow.campaigns.cases import Case, Tried, try_case
from kybflow.runtime.interrupts import Interrupts

Fly = Callable[[Case], Tried]
_LOOK = 0.1
"""Seconds after which an interrupt is noticed at the latest."""


class Pool:
    """Flies cases, `jobs` at a time. `interrupts` counts the signals that ask it to end: on the
    first, what flies lands and nothing more begins; on the second, the workers are killed."""

    def __init__(self, jobs: int, done: Callable[[Tried], None], fly: Fly = try_case) -> None:
        self.interrupts = 0
        self._jobs, self._done, self._fly = jobs, done, fly
        self._workers: list[_Worker] = []
        self._told = False

    def run(self, cases: Sequence[Case]) -> None:
        """Fly `cases`, and tell `done` of each that came to its end. Main thread only."""
        waiting = deque(cases)
        with Interrupts(self):
            try:
                while self._step(waiting):
                    pass
            finally:
                for worker in self._workers:
                    worker.kill()

    def _step(self, waiting: deque[Case]) -> bool:
        """Wait for something to happen; whether there is more to do."""
        if self.interrupts > 1:
            return False
        if not self.interrupts:
            self._employ(waiting)
        elif not self._told:
            self._told = True
            for worker in self._workers:
                worker.land()
        busy = [worker for worker in self._workers if worker.case is not None]
        heard = wait([worker.line for worker in busy], _LOOK) if busy else []
        for worker in busy:
            if worker.line in heard:
                self._hear(worker)
        return bool(busy)

    def _employ(self, waiting: deque[Case]) -> None:
        """Give each that is idle a case, and take on others."""
        idle = [worker for worker in self._workers if worker.case is None]
        while waiting and (idle or len(self._workers) < self._jobs):
            if not idle:
                idle.append(_Worker())
                self._workers += idle
            idle.pop().begin(self._fly, waiting.popleft())

    def _hear(self, worker: _Worker) -> None:
        tried = worker.result()
        if worker.is_dead:
            self._workers.remove(worker)
        if tried.verdict == "interrupted":
            self.interrupts = max(self.interrupts, 1)
        elif not (worker.is_dead and self._told):
            self._done(tried)


class _Worker:
    """A process that flies, in a session of its own: a terminal's Ctrl-C is not for it. `case` is
    what it flies."""

    def __init__(self) -> None:
        self.case: Case | None = None
        self.is_dead = False
        self.line, theirs = Pipe()
        code = f"from {__name__} import work; work({theirs.fileno()})"
        paths = os.pathsep.join(filter(None, sys.path))
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", code],
                stdin=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": paths},
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )

    def begin(self, fly: Fly, case: Case) -> None:
        self.case = case
        self._send((fly, case))

    def land(self) -> None:
        """Land what flies, and end."""
        self._send(None)

    def _send(self, what: object) -> None:
        with suppress(OSError):  # it has died, as its line will tell
            self.line.send(what)

    def result(self) -> Tried:
        """What became of its case. It waits for the worker to say so, or to die."""
        case, self.case = self.case, None
        assert case is not None
        try:
            tried: Tried = self.line.recv()
        except (EOFError, OSError):
            self.is_dead = True
            reason = f"the process that flew it died ({_end(self.kill())})"
            folder = case.out if case.out.exists() else None
            return Tried(case, "driver_failed", (reason,), folder=folder)
        return tried

    def kill(self) -> int:
        """End it at once; its exit code."""
        self._process.kill()
        self.line.close()
        return self._process.wait()


def _end(code: int) -> str:
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


def work(descriptor: int) -> None:
    """What a worker does: fly what comes down its line."""
    line = Connection(descriptor)
    jobs: SimpleQueue[tuple[Fly, Case] | None] = SimpleQueue()
    threading.Thread(target=_listen, args=(line, jobs), daemon=True).start()
    while (job := jobs.get()) is not None:
        tried = _tried(*job)
        with suppress(OSError):  # nobody is there to hear it
            line.send(tried)


def _listen(line: Connection, jobs: SimpleQueue[tuple[Fly, Case] | None]) -> None:
    """Take what comes down the line; at its end, end the process, a flight by a landing."""
    try:
        while (job := line.recv()) is not None:
            jobs.put(job)
    except (EOFError, OSError):
        pass
    finally:
        jobs.put(None)
        os.kill(os.getpid(), signal.SIGTERM)


def _tried(fly: Fly, case: Case) -> Tried:
    """What became of a case, whatever happens."""
    try:
        return fly(case)
    except Exception as error:
        reason = f"kybflow failed: {type(error).__name__}: {error}"
        return Tried(case, "driver_failed", (reason, traceback.format_exc().rstrip()))
