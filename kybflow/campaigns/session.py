"""Flies the cases of `kybflow test` in parallel processes, so that a crash ends only one flight.

A worker process receives cases through its connection and sends results back. When the connection
closes, as after Ctrl-C, the worker lands and ends, so that no worker outlives the session.
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

from kybflow.campaigns.cases import Coverage, FlightCase, FlightResult, Verdict, covered, fly_case
from kybflow.core.errors import DRIVER_FAILED, FAILED, INTERRUPTED, INVALID
from kybflow.runtime.interrupts import Interrupts

Fly = Callable[[FlightCase], FlightResult]
_INTERRUPT_POLL_S = 0.1
"""The longest time until the session notices an interrupt, s."""
_EXIT: tuple[tuple[Verdict, int], ...] = (
    ("invalid", INVALID),
    ("driver_failed", DRIVER_FAILED),
    ("failed", FAILED),
)
"""The exit code of each verdict, most serious first."""


def run_cases(
    cases: Sequence[FlightCase],
    jobs: int,
    done: Callable[[FlightResult], None],
    fly: Fly = fly_case,
) -> list[FlightResult]:
    """Fly all cases, `jobs` at a time, and return the results in the order of `cases`. done: called
    with each result. A first interrupt lands the running flights, which give no result, and starts
    no others; a second one kills them."""
    results: dict[FlightCase, FlightResult] = {}

    def keep(result: FlightResult) -> None:
        results[result.case] = result
        done(result)

    Pool(jobs, keep, fly).run(cases)
    return [results[case] for case in cases if case in results]


def exit_code(results: Sequence[FlightResult], asked: int) -> int:
    """Return 0 if all `asked` flights succeeded, otherwise the code of the most serious verdict, or
    INTERRUPTED if results are missing."""
    if len(results) < asked:
        return INTERRUPTED
    verdicts = {one.verdict for one in results}
    return next((code for verdict, code in _EXIT if verdict in verdicts), 0)


def coverage_of(results: Sequence[FlightResult]) -> dict[Path, Coverage]:
    """Return the coverage of each mission by all its flights; a mission that never flew has
    none."""
    coverage: dict[Path, Coverage] = {}
    for path in dict.fromkeys(one.case.path for one in results):
        flights = [one for one in results if one.case.path == path and one.taken]
        if flights:
            taken = frozenset[object]().union(*(one.taken for one in flights))
            coverage[path] = covered(flights[0].items, taken)  # type: ignore[arg-type]
    return coverage


class Pool:
    """Flies cases, `jobs` at a time. interrupts: the number of signals received. The first one
    lands the running flights and starts no others; the second one kills the workers."""

    def __init__(
        self, jobs: int, done: Callable[[FlightResult], None], fly: Fly = fly_case
    ) -> None:
        self.interrupts, self.interrupted_by = 0, ""
        self._jobs, self._done, self._fly = jobs, done, fly
        self._workers: list[_Worker] = []
        self._is_landing = False

    def run(self, cases: Sequence[FlightCase]) -> None:
        """Fly `cases` and call `done` with each result. Must run in the main thread."""
        waiting = deque(cases)
        with Interrupts(self):
            try:
                while self._step(waiting):
                    pass
            finally:
                for worker in self._workers:
                    worker.kill()

    def _step(self, waiting: deque[FlightCase]) -> bool:
        """Assign cases, then wait shortly for results; return whether there is more to do."""
        if self.interrupts > 1:
            return False
        if not self.interrupts:
            self._assign(waiting)
        elif not self._is_landing:
            self._is_landing = True
            for worker in self._workers:
                worker.land()
        busy = [worker for worker in self._workers if worker.case is not None]
        ready = wait([worker.line for worker in busy], _INTERRUPT_POLL_S) if busy else []
        for worker in busy:
            if worker.line not in ready:
                continue
            result = worker.result()
            if worker.is_dead:
                self._workers.remove(worker)
            if result.verdict == "interrupted":
                self.interrupts = max(self.interrupts, 1)
            elif not (worker.is_dead and self._is_landing):
                self._done(result)
        return bool(busy)

    def _assign(self, waiting: deque[FlightCase]) -> None:
        """Give cases to idle workers, and start more workers if there is need."""
        idle = [worker for worker in self._workers if worker.case is None]
        while waiting and (idle or len(self._workers) < self._jobs):
            if not idle:
                idle.append(_Worker())
                self._workers += idle
            idle.pop().begin(self._fly, waiting.popleft())


class _Worker:
    """A process that flies cases. It runs in its own session, so that Ctrl-C in the terminal
    doesn't reach it. case: the case that it is flying."""

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
        """Land the flight and end the process."""
        self._send(None)

    def _send(self, what: object) -> None:
        with suppress(OSError):  # the process has died, and `result` will report it
            self.line.send(what)

    def result(self) -> FlightResult:
        """Wait for the result of the case, or for the worker's death."""
        case, self.case = self.case, None
        assert case is not None
        try:
            result: FlightResult = self.line.recv()
        except (EOFError, OSError):
            self.is_dead = True
            code = self.kill()
            cause = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            reason = f"the process that flew it died ({cause})"
            folder = case.out if case.out.exists() else None
            return FlightResult(case, "driver_failed", (reason,), folder=folder)
        return result

    def kill(self) -> int:
        """Kill the process and return its exit code."""
        self._process.kill()
        self.line.close()
        return self._process.wait()


def work(descriptor: int) -> None:
    """Run a worker: fly the cases that the connection delivers and send back their results."""
    line = Connection(descriptor)
    jobs: SimpleQueue[tuple[Fly, FlightCase] | None] = SimpleQueue()
    threading.Thread(target=_listen, args=(line, jobs), daemon=True).start()
    while (job := jobs.get()) is not None:
        fly, case = job
        try:
            result = fly(case)
        except Exception as error:
            reason = f"kybflow failed: {type(error).__name__}: {error}"
            lines = (reason, traceback.format_exc().rstrip())
            result = FlightResult(case, "driver_failed", lines)
        with suppress(OSError):  # the session is gone
            line.send(result)


def _listen(line: Connection, jobs: SimpleQueue[tuple[Fly, FlightCase] | None]) -> None:
    """Queue the cases that the connection delivers. When it closes, land the flight and end the
    process."""
    try:
        while (job := line.recv()) is not None:
            jobs.put(job)
    except (EOFError, OSError):
        pass
    finally:
        jobs.put(None)
        os.kill(os.getpid(), signal.SIGTERM)
