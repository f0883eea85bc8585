"""How late setpoints leave by the clock on the wall, with autopilots in a process of their own.

    python bench/mavlink_wall.py [--vehicles 8] [--seconds 10]

`kybflow emulate autopilot` is one process; this one flies the vehicle `mk` of
missions/figure_eight.yaml, so many of it, in real time, recording on. A setpoint is late by how
much more than its period after the one before it leaves. Both processes need a core that is their
own; what this one takes of its own is told, and what a million additions take, for comparison with
other machines. `bench/mavlink.py` needs no second core, and more vehicles fit into it.
"""

from __future__ import annotations

import argparse
import dataclasses
import random
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, ClassVar

from mavlink import GOAL, PERIOD, lateness, plan_of
from mavlink_driver import SET_POINT, SYSTEM

from kybflow.api.flight import RunRequest, fly
from kybflow.drivers.mavlink import Mavlink
from kybflow.drivers.mavlink.link import open_session
from kybflow.drivers.mavlink.transport.sockets import open_wire
from kybflow.drivers.mavlink.transport.wire import Wire
from kybflow.parts import Seat, Session
from kybflow.runtime.engine import Engine

ADDITIONS = 1_000_000


class Timed(Mavlink):
    """`left`: when each vehicle's setpoints did, in ms."""

    left: ClassVar[dict[int, list[float]]] = defaultdict(list)

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        return open_session(seats, cls._open)

    @classmethod
    def _open(cls, address: Any) -> Wire:
        wire = open_wire(address)
        send = wire.send

        def timed(data: bytes, to: Any = None) -> None:
            send(data, to)
            if data[7] == SET_POINT and not data[8]:
                cls.left[data[SYSTEM]].append(1e3 * perf_counter())

        wire.send = timed  # type: ignore[method-assign]
        return wire


class Watch:
    """An observer that ends the flight `seconds` after all were in the air."""

    def __init__(self, seconds: float) -> None:
        self.flown = self.taken = 0.0
        self.late = 0
        self._seconds = seconds
        self._began: tuple[float, float, int] | None = None

    def __call__(self, engine: Engine) -> None:
        if not engine.flying or not all(v.runner.off_ground for v in engine.vehicles):
            return
        if self._began is None:
            Timed.left.clear()
            self._began = perf_counter(), process_time(), engine.clock.late
        since, taken, late = self._began
        self.flown, self.taken = perf_counter() - since, process_time() - taken
        self.late = engine.clock.late - late
        if self.flown >= self._seconds:
            engine.interrupts = 2  # ends it at once


def measure(count: int, seconds: float) -> Watch:
    """Fly against an emulator of its own."""
    watch, plan = Watch(seconds), plan_of(count, Timed, None)
    command = (
        f"{sys.executable} -m kybflow emulate autopilot --vehicle px4 --no-gps --count {count}"
    )
    emulator = subprocess.Popen(command.split(), stdout=subprocess.DEVNULL)
    try:
        with tempfile.TemporaryDirectory() as folder:
            plan = dataclasses.replace(plan, simulated=False)
            flown = fly(plan, RunRequest(out=Path(folder) / "run"), observers=(watch,))
    finally:
        emulator.terminate()
        emulator.wait()
    if not watch.flown:
        raise SystemExit(f"it did not fly: {flown.summary['reason']}")
    return watch


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--vehicles", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=10.0, help="in the air")
    o = parser.parse_args()
    watch = measure(o.vehicles, o.seconds)
    late = lateness(Timed.left)
    began, x = process_time(), 0
    for number in range(ADDITIONS):
        x += number
    print(f"{o.vehicles} vehicles; the goal: {GOAL:.0%} of a core, no setpoint {PERIOD:g} ms late")
    print("  ours  1e6+ms  sp/s/v  late ms  99.9 %  late ticks")
    print(
        f"{watch.taken / watch.flown:6.1%}  {1e3 * (process_time() - began):6.1f}"
        f"  {len(late) / watch.flown / o.vehicles:6.1f}  {late[-1]:7.2f}"
        f"  {late[int(0.999 * len(late))]:6.2f}  {watch.late:10d}"
    )


if __name__ == "__main__":
    main()
