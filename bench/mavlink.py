"""What many autopilots in one process cost, as a share of one core, and how late setpoints leave.

    python bench/mavlink.py [--vehicles 16] [--seconds 10] [--profile 30]

Flies the vehicle `mk` of missions/figure_eight.yaml, sixteen of it, recording on, against emulated
autopilots, first over datagrams of this machine, then over wires in memory. All of it is in one
process and in simulated time, so that a busy machine delays nobody; what the emulator takes, with
its physics, is told apart. Every twentieth of a simulated second pymavlink's own parser reads once
more what came, so that whatever else the machine does slows both. A setpoint is late by how much
longer than its period it left after the one before: by ticks, and by the processor's time of all
that is done earlier in the same tick. `ours` is the whole program but the emulator: driver, engine,
estimators, trackers, recorder. Then the driver alone is given the same flight once more, and
measured against pymavlink's parser too (`mavlink_driver`): on the frames that came, of which there
are fewer the less is asked for, and on a telemetry that stays. What the machine takes for a million
additions is told too: a share is one of a core that is as fast as that.
"""

from __future__ import annotations

import argparse
import cProfile
import dataclasses
import gc
import pstats
import random
import statistics
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from time import process_time
from typing import Any, ClassVar

from mavlink_driver import CALLED, Tapped, Traffic, frozen_frames, noting, show_driver
from pymavlink.dialects.v20 import all as dialect

from kybflow.api.flight import RunRequest, fly
from kybflow.drivers.emulated_autopilot import EmulatedAutopilot
from kybflow.drivers.emulated_autopilot.firmware import SetupPlan
from kybflow.drivers.emulated_autopilot.session import open_fleet
from kybflow.drivers.emulation.fleet import Fleet
from kybflow.drivers.mavlink.link import MavlinkSession, open_session
from kybflow.drivers.mavlink.transport.sockets import open_wire
from kybflow.drivers.mavlink.transport.wire import MemoryWire, Wire
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan
from kybflow.parts import Seat, Session
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.engine import Engine

MISSION = Path(__file__).parent.parent / "missions" / "figure_eight.yaml"
PERIOD, SPACING, GOAL = 20.0, 2.0, 0.5
"""Milliseconds between setpoints; metres between vehicles; the share that is allowed."""
ADDITIONS = 5000


class Lockstep(Session):
    """The driver for real autopilots on one socket, and the emulator at its other end."""

    def __init__(self, seats: Sequence[Seat], generator: random.Random, traffic: Traffic) -> None:
        plan = SetupPlan("px4", True, True, seats[0].params.own_system, {})
        bare = load_catalog().get("drivers", "emulated_autopilot").params()
        contexts = [Seat(seat.context, bare) for seat in seats]
        self._fleet = open_fleet(contexts, [plan] * len(seats), generator)
        wire = Tapped(traffic)
        self._far: list[Wire] = []
        for member in self._fleet.members:
            self._far.append(open_wire(f"udpout:127.0.0.1:{wire.port}"))
            member.onboard.connect(self._far[-1])
        self._traffic = traffic
        self._near: MavlinkSession = open_session(seats, lambda _: wire)
        self.links = self._near.links
        traffic.seats = seats
        for name, link in self.links.items():
            for method in CALLED:
                setattr(link, method, noting(traffic, name, method, getattr(link, method)))

    def advance(self, now: int) -> None:
        self._fleet.advance(now)
        self._near.advance(now)

    def close(self) -> None:
        self._traffic.frozen = frozen_frames(self._fleet.members[0].onboard.autopilot)
        for closes in (self._near, self._fleet, *self._far):
            closes.close()


class Datagrams(EmulatedAutopilot):
    traffic: ClassVar[Traffic]

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        return Lockstep(seats, generator, cls.traffic)


class Costs:
    """An observer that adds up what flying takes, in slices of a twentieth of a second, and ends
    the flight after `seconds` in which all were in the air."""

    def __init__(self, traffic: Traffic, seconds: float, profile: bool) -> None:
        self.flown = self.total = self.fleet = 0.0
        self.messages = 0
        self.ratios: list[float] = []
        self.additions: list[float] = []
        self.profile = cProfile.Profile() if profile else None
        """Of what is ours; it makes everything slower."""
        self._traffic, self._seconds = traffic, seconds
        self._parser = dialect.MAVLink(None)
        self._parser.robust_parsing = True
        self._last: tuple[float, float, float] | None = None

    def __call__(self, engine: Engine) -> None:
        if not engine.flying or not all(v.runner.off_ground for v in engine.vehicles):
            return
        arrived = process_time()
        if self.profile is not None:
            self.profile.disable()
        traffic, now = self._traffic, engine.seconds()
        if self._last is None:
            traffic.left.clear()
            traffic.ground = len(traffic.steps)
        else:
            self._slice(arrived - self._last[0], traffic.fleet - self._last[1], now - self._last[2])
        traffic.came.clear()
        gc.freeze()  # what was noted need not be searched for garbage
        if self.flown >= self._seconds:
            engine.interrupts = 2  # ends it at once
        elif self.profile is not None:
            self.profile.enable()
        self._last = (process_time(), traffic.fleet, now)

    def _slice(self, total: float, fleet: float, flown: float) -> None:
        began = process_time()
        for frame in self._traffic.came:
            self._parser.parse_buffer(frame)
        parsed = process_time() - began
        began = process_time()
        x = 0
        for number in range(ADDITIONS):
            x += number
        self.additions.append((process_time() - began) * 1e6 / ADDITIONS)
        self.flown, self.total, self.fleet = (
            self.flown + flown, self.total + total, self.fleet + fleet,
        )  # fmt: skip
        self.messages += len(self._traffic.came)
        if self._traffic.came:
            self.ratios.append((total - fleet) / parsed)


def plan_of(count: int, cls: type, address: str | None = "udpin:127.0.0.1:1") -> Plan:
    """`count` vehicles side by side, all on the figure eight."""
    target = "emulated_px4" if cls is EmulatedAutopilot else "px4"
    result = compile_mission(MISSION, catalog=load_catalog(), target=target)
    if result.plan is None:
        raise SystemExit(f"{MISSION} does not compile: {result.diagnostics}")
    first = result.plan.vehicles[0]
    driver = dataclasses.replace(first.driver, cls=cls)
    vehicles = tuple(
        dataclasses.replace(
            first, name=f"v{number}", start=(0.0, SPACING * number, 0.0),
            driver=driver if cls is EmulatedAutopilot else dataclasses.replace(
                driver, params=dataclasses.replace(
                    driver.params, address=address, system=number + 1
                ),
            ),
        )
        for number in range(count)
    )  # fmt: skip
    return dataclasses.replace(
        result.plan, vehicles=vehicles, simulated=True, fence=None, expectations=()
    )


def measure(name: str, count: int, seconds: float, cls: type, lines: int) -> None:
    """Fly, and print one row."""
    traffic = Traffic()
    Datagrams.traffic = traffic
    costs = Costs(traffic, seconds, bool(lines))
    advance, send = Fleet.advance, MemoryWire.send

    def timed(fleet: Fleet, now: int) -> None:
        if costs.profile is not None and costs.flown:
            costs.profile.disable()
        began = process_time()
        advance(fleet, now)
        traffic.tick(now, process_time() - began)
        if costs.profile is not None and costs.flown:
            costs.profile.enable()

    def noted(wire: MemoryWire, data: bytes, to: Any = None) -> None:
        send(wire, data, to)
        traffic.sent(data)

    Fleet.advance, MemoryWire.send = timed, noted  # type: ignore[method-assign]
    try:
        with tempfile.TemporaryDirectory() as folder:
            request = RunRequest(out=Path(folder) / "run")
            flown = fly(plan_of(count, cls), request, observers=(costs,))
    finally:
        Fleet.advance, MemoryWire.send = advance, send  # type: ignore[method-assign]
    if not costs.flown:
        raise SystemExit(f"it did not fly: {flown.summary['reason']}")
    show(name, count, costs, traffic)
    if traffic.seats:
        show_driver(traffic, costs.flown, costs.total - costs.fleet)
    if costs.profile is not None:
        pstats.Stats(costs.profile).sort_stats("tottime").print_stats(lines)


def lateness(left: dict[int, list[float]]) -> list[float]:
    """By how much setpoints left later than their period after the one before, ms, sorted."""
    return sorted(
        after - before - PERIOD for times in left.values() for before, after in pairwise(times)
    )


def show(name: str, count: int, costs: Costs, traffic: Traffic) -> None:
    late = lateness(traffic.left)
    flown, ours = costs.flown, costs.total - costs.fleet
    ratio = f"{statistics.median(costs.ratios):6.2f}" if costs.ratios else "     -"
    print(
        f"{name:9s}  {ours / flown:6.1%}  {costs.fleet / flown:6.1%}"
        f"  {1e3 * statistics.median(costs.additions):6.1f}"
        f"  {ratio}  {costs.messages / flown / count:7.0f}  {len(late) / flown / count:6.1f}"
        f"  {late[-1]:6.2f}  {late[int(0.999 * len(late))]:6.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--vehicles", type=int, default=16)
    parser.add_argument("--seconds", type=float, default=10.0, help="in the air, simulated")
    parser.add_argument("--profile", type=int, default=0, metavar="LINES")
    o = parser.parse_args()
    print(f"{o.vehicles} vehicles; the goal: {GOAL:.0%} of a core, no setpoint {PERIOD:g} ms late")
    print("wires        ours  emulat.  1e6+ms  x pymav  msg/s/v  sp/s/v  late ms   99.9 %")
    measure("datagrams", o.vehicles, o.seconds, Datagrams, o.profile)
    measure("memory", o.vehicles, o.seconds, EmulatedAutopilot, o.profile)


if __name__ == "__main__":
    main()
