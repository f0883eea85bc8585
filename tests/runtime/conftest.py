"""`run` flies a plan in the simulator."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from plans import plan

from kybflow.runtime.flight import Flown, Request, fly
from kybflow.signals import Event

Run = Callable[..., tuple[Flown, list[Event]]]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    def run(*vehicles, seed=0, options=(), observers=(), listeners=(), **facts):
        told: list[Event] = []
        request = Request(
            seed=seed, out=tmp_path / str(len(list(tmp_path.iterdir()))), options=options
        )
        return fly(plan(*vehicles, **facts), request, (*listeners, told.append), observers), told

    return run
