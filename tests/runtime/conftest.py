"""`run` flies a plan in the simulator; every event carries what the table of events says."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from plans import plan

from kybflow.observables import EVENT_FIELDS
from kybflow.runtime.flight import Flown, Request, fly
from kybflow.signals import Event

Run = Callable[..., tuple[Flown, list[Event]]]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    def run(*vehicles, seed=0, options=(), emitted=(), observers=(), listeners=(), **facts):
        told: list[Event] = []
        out = tmp_path / str(len(list(tmp_path.iterdir())))
        request = Request(seed=seed, out=out, options=options, emitted=emitted)
        flown = fly(plan(*vehicles, **facts), request, (*listeners, told.append), observers)
        for event in told:
            if event.name in EVENT_FIELDS:
                assert set(event.fields) <= set(EVENT_FIELDS[event.name]), event
        return flown, told

    return run
