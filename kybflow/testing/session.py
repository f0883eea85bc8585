"""All the cases of one call of `kybflow test`, in parallel processes."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from kybflow.testing.cases import Case, Tried, Verdict, try_case
from kybflow.testing.coverage import Coverage, covered

_EXIT: tuple[tuple[Verdict, int], ...] = (
    ("interrupted", 130),
    ("invalid", 2),
    ("driver_failed", 3),
    ("failed", 1),
)
"""What the exit code is, the gravest first."""


def run_cases(cases: Sequence[Case], jobs: int, done: Callable[[Tried], None]) -> list[Tried]:
    """Fly every case, `jobs` at a time; the results in the order of `cases`. `done` is told of each
    as it ends. An interrupt lands what flies, and leaves the rest out."""
    results: dict[Case, Tried] = {}
    for one in _alone(cases) if jobs == 1 or len(cases) == 1 else _together(cases, jobs):
        results[one.case] = one
        done(one)
        if one.verdict == "interrupted":
            break
    return [results[case] for case in cases if case in results]


def _alone(cases: Sequence[Case]) -> Iterator[Tried]:
    for case in cases:
        yield try_case(case)


def _together(cases: Sequence[Case], jobs: int) -> Iterator[Tried]:
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(jobs, len(cases)), mp_context=context) as pool:
        flights = {pool.submit(try_case, case): case for case in cases}
        try:
            for flight in as_completed(flights):
                yield _result(flight, flights[flight])
        except KeyboardInterrupt:
            yield Tried(cases[0], "interrupted", ("interrupted",))
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _result(flight: Future[Tried], case: Case) -> Tried:
    try:
        return flight.result()
    except BrokenProcessPool:
        return Tried(case, "driver_failed", ("the process that flew it died",))


def exit_code(tried: Sequence[Tried]) -> int:
    """0 when every case succeeded; else that of the gravest."""
    verdicts = {one.verdict for one in tried}
    return next((code for verdict, code in _EXIT if verdict in verdicts), 0)


def coverage_of(tried: Sequence[Tried]) -> dict[Path, Coverage]:
    """What all flights of each mission took together."""
    coverage: dict[Path, Coverage] = {}
    for path in dict.fromkeys(one.case.path for one in tried):
        flights = [one for one in tried if one.case.path == path and one.written]
        if flights:
            taken = frozenset[object]().union(*(one.taken for one in flights))
            coverage[path] = covered(flights[0].written, taken)  # type: ignore[arg-type]
    return coverage
