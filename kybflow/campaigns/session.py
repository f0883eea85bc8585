"""All the cases of one call of `kybflow test`, flown in parallel processes: one that dies takes no
other flight with it.

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
from pathlib import Path
from queue import SimpleQueue

from kybflow.campaigns.cases import FlightCase, FlightResult, Verdict, fly_case
from kybflow.campaigns.coverage import Coverage, covered
from kybflow.core.exit_codes import DRIVER_FAILED, FAILED, INTERRUPTED, INVALID
from kybflow.runtime.interrupts import Interrupts

Fly = Callable[[FlightCase], FlightResult]
_LOOK = 0.1
"""Seconds after which an interrupt is noticed at the latest."""
_EXIT: tuple[tuple[Verdict, int], ...] = (
    ("invalid", INVALID),
    ("driver_failed", DRIVER_FAILED),
    ("failed", FAILED),
)
"""What the exit code is, the gravest first."""


def run_cases(
    cases: Sequence[FlightCase],
    jobs: int,
    done: Callable[[FlightResult], None],
    fly: Fly = fly_case,
) -> list[FlightResult]:
    """Fly every case, `jobs` at a time; the results in the order of `cases`. `done` is told of each
    as it ends. An interrupt lands what flies, and leaves that and the rest out; a second one ends
    it at once."""
    results: dict[FlightCase, FlightResult] = {}

    def keep(result: FlightResult) -> None:
        results[result.case] = result
        done(result)

    Pool(jobs, keep, fly).run(cases)
    return [results[case] for case in cases if case in results]


def exit_code(results: Sequence[FlightResult], asked: int) -> int:
    """0 when each of the `asked` flights succeeded; else that of the gravest."""
    if len(results) < asked:
        return INTERRUPTED
    verdicts = {one.verdict for one in results}
    return next((code for verdict, code in _EXIT if verdict in verdicts), 0)


def coverage_of(results: Sequence[FlightResult]) -> dict[Path, Coverage]:
    """What all flights of each mission took together; nothing of one that never flew."""
    coverage: dict[Path, Coverage] = {}
    for path in dict.fromkeys(one.case.path for one in results):
        flights = [one for one in results if one.case.path == path and one.taken]
        if flights:
            taken = frozenset[object]().union(*(one.taken for one in flights))
            coverage[path] = covered(flights[0].items, taken)  # type: ignore[arg-type]
    return coverage


class Pool:
    """Flies cases, `jobs` at a time. `interrupts` counts the signals that ask it to end: on the
    first, what flies lands and nothing more begins; on the second, the workers are killed."""

    def __init__(
        self, jobs: int, done: Callable[[FlightResult], None], fly: Fly = fly_case
    ) -> None:
        self.interrupts = 0
        self._jobs, self._done, self._fly = jobs, done, fly
        self._workers: list[_Worker] = []
        self._told = False

    def run(self, cases: Sequence[FlightCase]) -> None:
        """Fly `cases`, and tell `done` of each that came to its end. Main thread only."""
        waiting = deque(cases)
        with Interrupts(self):
            try:
                while self._step(waiting):
                    pass
            finally:
                for worker in self._workers:
                    worker.kill()

    def _step(self, waiting: deque[FlightCase]) -> bool:
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

    def _employ(self, waiting: deque[FlightCase]) -> None:
        """Give each that is idle a case, and take on others."""
        idle = [worker for worker in self._workers if worker.case is None]
        while waiting and (idle or len(self._workers) < self._jobs):
            if not idle:
                idle.append(_Worker())
                self._workers += idle
            idle.pop().begin(self._fly, waiting.popleft())

    def _hear(self, worker: _Worker) -> None:
        result = worker.result()
        if worker.is_dead:
            self._workers.remove(worker)
        if result.verdict == "interrupted":
            self.interrupts = max(self.interrupts, 1)
        elif not (worker.is_dead and self._told):
            self._done(result)


class _Worker:
    """A process that flies, in a session of its own: a terminal's Ctrl-C is not for it. `case` is
    what it flies."""

    def __init__(self) -> None:
        self.case: FlightCase | None = None
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

    def begin(self, fly: Fly, case: FlightCase) -> None:
        self.case = case
        self._send((fly, case))

    def land(self) -> None:
        """Land what flies, and end."""
        self._send(None)

    def _send(self, what: object) -> None:
        with suppress(OSError):  # it has died, as its line will tell
            self.line.send(what)

    def result(self) -> FlightResult:
        """What became of its case. It waits for the worker to say so, or to die."""
        case, self.case = self.case, None
        assert case is not None
        try:
            result: FlightResult = self.line.recv()
        except (EOFError, OSError):
            self.is_dead = True
            reason = f"the process that flew it died ({_end(self.kill())})"
            folder = case.out if case.out.exists() else None
            return FlightResult(case, "driver_failed", (reason,), folder=folder)
        return result

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
    jobs: SimpleQueue[tuple[Fly, FlightCase] | None] = SimpleQueue()
    threading.Thread(target=_listen, args=(line, jobs), daemon=True).start()
    while (job := jobs.get()) is not None:
        result = _result(*job)
        with suppress(OSError):  # nobody is there to hear it
            line.send(result)


def _listen(line: Connection, jobs: SimpleQueue[tuple[Fly, FlightCase] | None]) -> None:
    """Take what comes down the line; at its end, end the process, a flight by a landing."""
    try:
        while (job := line.recv()) is not None:
            jobs.put(job)
    except (EOFError, OSError):
        pass
    finally:
        jobs.put(None)
        os.kill(os.getpid(), signal.SIGTERM)


def _result(fly: Fly, case: FlightCase) -> FlightResult:
    """What became of a case, whatever happens."""
    try:
        return fly(case)
    except Exception as error:
        reason = f"kybflow failed: {type(error).__name__}: {error}"
        return FlightResult(case, "driver_failed", (reason, traceback.format_exc().rstrip()))
