"""Makes `support/` and `bench/` importable, and hypothesis draw the same in every run.

Programs that a test starts hear Ctrl-C, which a shell takes from what it runs in the background.
OpenCV and BLAS take one thread, for every core has a worker already. What is collected stays until
the end: the garbage collector doesn't look through it again and again. Every worker has its own
folder for the sockets of runs, so that none finds a run of another by its name. `run` flies a plan
in the simulator; every event of a vehicle names it, and none of the run does.
"""

from __future__ import annotations

import atexit
import gc
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Generator
from pathlib import Path

import pytest
from hypothesis import settings

TESTS = Path(__file__).parent
sys.path.insert(0, str(TESTS / "support"))
sys.path.append(str(TESTS.parent / "bench"))

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # programs that a test starts inherit it
    signal.signal(signal.SIGINT, signal.default_int_handler)

for library in ("OPENCV_FOR_THREADS_NUM", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(library, "1")

os.environ["XDG_RUNTIME_DIR"] = tempfile.mkdtemp(prefix="kyb")
atexit.register(shutil.rmtree, os.environ["XDG_RUNTIME_DIR"], ignore_errors=True)

settings.register_profile("seeded", derandomize=True, database=None, deadline=None)
settings.load_profile("seeded")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the file that takes longest, so that no worker waits for it at the end."""
    items.sort(key=lambda item: item.path.name != "test_compiled.py")


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., object]:
    from plans import plan

    from kybflow.api.flight import RunRequest, fly
    from kybflow.core.events import VehicleEvent
    from kybflow.parts.events import ENGINE_EVENTS

    def run(
        *vehicles,
        seed=0,
        options=(),
        emitted=(),
        observers=(),
        listeners=(),
        servers=(),
        again=(),
        said=None,
        **facts,
    ):
        told = []
        out = tmp_path / str(len(list(tmp_path.iterdir())))
        request = RunRequest(
            seed=seed, out=out, options=options, emitted=emitted, again=again, inputs=said or {}
        )
        listeners = (*listeners, told.append)
        flown = fly(plan(*vehicles, **facts), request, listeners, observers, servers)
        for event in told:
            if event.name in ENGINE_EVENTS:
                cls = ENGINE_EVENTS[event.name]
                assert bool(event.vehicle) == issubclass(cls, VehicleEvent), event
        return flown, told

    return run
