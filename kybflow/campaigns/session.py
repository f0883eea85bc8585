"""All the cases of one call of `kybflow test`, in parallel processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from kybflow.campaigns.cases import Case, Tried, Verdict, try_case
from kybflow.campaigns.coverage import Coverage, covered
from kybflow.campaigns.pool import Fly, Pool

_EXIT: tuple[tuple[Verdict, int], ...] = (
    ("invalid", 2),
    ("driver_failed", 3),
    ("failed", 1),
)
"""What the exit code is, the gravest first."""
INTERRUPTED = 130


def run_cases(
    cases: Sequence[Case], jobs: int, done: Callable[[Tried], None], fly: Fly = try_case
) -> list[Tried]:
    """Fly every case, `jobs` at a time; the results in the order of `cases`. `done` is told of each
    as it ends. An interrupt lands what flies, and leaves that and the rest out; a second one ends
    it at once."""
    results: dict[Case, Tried] = {}

    def keep(tried: Tried) -> None:
        results[tried.case] = tried
        done(tried)

    Pool(jobs, keep, fly).run(cases)
    return [results[case] for case in cases if case in results]


def exit_code(tried: Sequence[Tried], asked: int) -> int:
    """0 when each of the `asked` flights succeeded; else that of the gravest."""
    if len(tried) < asked:
        return INTERRUPTED
    verdicts = {one.verdict for one in tried}
    return next((code for verdict, code in _EXIT if verdict in verdicts), 0)


def coverage_of(tried: Sequence[Tried]) -> dict[Path, Coverage]:
    """What all flights of each mission took together; nothing of one that never flew."""
    coverage: dict[Path, Coverage] = {}
    for path in dict.fromkeys(one.case.path for one in tried):
        flights = [one for one in tried if one.case.path == path and one.taken]
        if flights:
            taken = frozenset[object]().union(*(one.taken for one in flights))
            coverage[path] = covered(flights[0].written, taken)  # type: ignore[arg-type]
    return coverage
